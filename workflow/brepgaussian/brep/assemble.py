"""One rung of the ladder: sheets, arrangement, minimum cut, solid, gate."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep import occ
from brepgaussian.brep.blends import exact_blends, size
from brepgaussian.brep.build_faces import build_face
from brepgaussian.brep.cells import arrange
from brepgaussian.brep.evidence import gather
from brepgaussian.brep.exact import exact
from brepgaussian.brep.gate import examine
from brepgaussian.brep.job import Attempt, Job, Rung
from brepgaussian.brep.labelling import Weights, label, one_body
from brepgaussian.brep.offcuts import Offcut, offcuts
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.polyhedron import polyhedral
from brepgaussian.brep.refine.mesh import FaceMesh, from_solid
from brepgaussian.brep.rounding import rounded_off
from brepgaussian.brep.sheets import Sheet, make_sheet
from brepgaussian.brep.silhouettes import Silhouettes
from brepgaussian.brep.solid import boundary, solid_from_facets
from brepgaussian.brep.structure import Structure, extract
from brepgaussian.brep.verdict import Verdict
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]

_SMALL_HOLLOW = 1e-3  # share of the volume below which an enclosed hollow is an artefact of the arrangement


def attempt(job: Job, rung: Rung) -> Attempt:
    """Run one rung; what OCC or the gate has against it becomes a fault, not an exception."""
    try:
        shape, notes = assemble(job, rung)
        patches = patches_of(job, rung)
        verdict = examine(shape, patches, job.silhouettes, job.settings, job.ends, job.left_out)
        verdict, surfaces = oriented(verdict, tuple(p.surface for p in patches))
        data = None if verdict.faults else occ.to_bytes(shape)
    except Exception as error:  # OCC raises types of its own; whatever it is, the next rung is tried
        data, notes, surfaces, verdict = None, {}, (), Verdict((str(error) or type(error).__name__,))
    return _told(job, rung, Attempt(rung.name, data, verdict, surfaces, notes=notes))


def judge(data: bytes, job: Job, rung: Rung, notes: dict[str, Any]) -> Attempt:
    """A solid from elsewhere (OCC bytes, unit frame) as an attempt of a job."""
    patches = patches_of(job, rung)
    verdict = examine(occ.from_bytes(data), patches, job.silhouettes, job.settings, job.ends, job.left_out)
    verdict, surfaces = oriented(verdict, tuple(p.surface for p in patches))
    return _told(job, rung, Attempt(rung.name, None if verdict.faults else data, verdict, surfaces, notes=notes))


def _told(job: Job, rung: Rung, attempt: Attempt) -> Attempt:
    """The attempt with where its patches are from."""
    return replace(attempt, primitives=tuple(p.primitive for p in patches_of(job, rung)), labelling=job.labelling)


def oriented(verdict: Verdict, surfaces: tuple[Surface, ...]) -> tuple[Verdict, tuple[Surface, ...]]:
    """Surfaces whose normals point out of the solid on most of their area, and the structure to match."""
    structure = verdict.structure
    if structure is None:
        return verdict, surfaces
    vote = np.zeros(len(surfaces))
    for face in structure.faces:
        if face.surface >= 0:
            vote[face.surface] += -face.area if face.flipped else face.area
    faces = tuple(
        replace(f, flipped=f.flipped != bool(f.surface >= 0 and vote[f.surface] < 0)) for f in structure.faces
    )
    turned = tuple(s.flip() if v < 0 else s for s, v in zip(surfaces, vote, strict=True))
    return replace(verdict, structure=replace(structure, faces=faces)), turned


def inspect(data: bytes, surfaces: tuple[Surface, ...]) -> tuple[Structure, FaceMesh]:
    """Structure and triangulation of one and the same shape, for the refinement."""
    shape = occ.from_bytes(data)
    structure = extract(shape, surfaces)
    return structure, from_solid(shape)


def assemble(job: Job, rung: Rung) -> tuple[Any, dict[str, Any]]:
    """The solid of one rung (TopoDS_Shape) with notes on the arrangement.

    Raises:
        StageError: there is none.
    """
    patches = patches_of(job, rung)
    if not job.blends:
        return _arranged(job, rung, patches)
    fillets = {b.patch for b in job.blends}
    faces = [i for i in range(len(patches)) if i not in fillets]
    widest = max(size(patches[i].surface) for i in fillets)  # sharp edges lie that far beyond the faces' ends
    wider = replace(rung, margin=rung.margin + widest, extend=tuple(k for k, i in enumerate(faces) if i in rung.extend))
    gone = offcuts(patches, job.blends, faces)
    sharp, notes = _arranged(job, wider, [patches[i] for i in faces], gone)
    return rounded_off(sharp, patches, job.blends), notes


def _arranged(
    job: Job, rung: Rung, patches: Sequence[Patch], gone: Sequence[Offcut] = ()
) -> tuple[Any, dict[str, Any]]:
    """The solid of some patches, each edge of which is where its faces meet; `gone`: what its fillets will change."""
    settings = job.settings
    sheets = make_sheets(patches, rung)
    arrangement = arrange([build_face(s) for s in sheets], [s.patch for s in sheets], settings.fuzzy)
    evidence = gather(arrangement, patches, job.silhouettes if rung.silhouettes else None, gone)
    weights = Weights(
        unsupported=settings.unsupported_weight * rung.unsupported,
        smooth=settings.smooth_weight,
        free=settings.free_length,
        filled=settings.filled_weight,
    )
    inside = one_body(arrangement, label(arrangement, evidence, weights), evidence.volume, _SMALL_HOLLOW)
    facets = [arrangement.facets[i] for i in boundary(arrangement, inside)]
    notes = {"cells": arrangement.cells, "facets": len(arrangement.facets), "inside": int(np.sum(inside))}
    return solid_from_facets(facets), notes


def patches_of(job: Job, rung: Rung) -> tuple[Patch, ...]:
    """The patches that take part in a rung."""
    return tuple(exact_blends((*job.patches, *job.guesses(rung)), job.blends))


def make_sheets(patches: Sequence[Patch], rung: Rung) -> list[Sheet]:
    """The sheets of all patches for one rung."""
    patches = exact(patches)
    extended = {*rung.extend, *(i for i, patch in enumerate(patches) if patch.whole)}
    return [make_sheet(i, patches, rung.margin, extended) for i in range(len(patches))]


def fallback(xyz: Array, normals: Array | None, silhouettes: Silhouettes | None, faces: int, job: Job) -> Attempt:
    """The polyhedral last resort."""
    data, source = polyhedral(xyz, normals, silhouettes, faces)
    shape = occ.from_bytes(data)
    verdict = examine(shape, (), job.silhouettes, job.settings)
    surfaces = occ.planes(shape)
    structure = extract(shape, surfaces)
    verdict = replace(verdict, doubts=(), structure=structure)
    return Attempt("polyhedron", data, verdict, tuple(surfaces), fallback=True, notes={"source": source})
