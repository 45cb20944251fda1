"""Refine a solid and build it again: what the brep stage does after the ladder.

The refined triangulation is the support of the second build: every face is covered evenly and without
noise, so the arrangement and its cut find the same topology again. Whatever fails or is no better by the
images' own test leaves the first solid as it was.
"""

import time
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.brep.job import Attempt, Job, Rung
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.refine.accept import Acceptance, acceptance
from brepgaussian.brep.refine.mesh import FaceMesh
from brepgaussian.brep.refine.refinement import RefineResult, refine
from brepgaussian.brep.structure import Structure
from brepgaussian.brep.worker import Worker, WorkerError
from brepgaussian.errors import BrepGaussianError
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.log import get_logger

Array = NDArray[np.float64]

_SPACING = 0.008  # of the samples that support the second build, unit frame
_SMALL_FACE = 40  # samples at least on a face, however small
_REACH = 2.5  # spacings within which a place on a face surely holds a sample
_TENTH_PX = 0.1  # a rebuilt solid may differ from the refined triangulation by less than this
_MARGINS = (0.02, 0.04)  # unit frame, of the sheets of the second build


@dataclass(frozen=True)
class Polished:
    """Outcome of `polish`.

    Attributes:
        shape: the solid as OCC bytes; the one given where refinement did not help.
        structure, surfaces: of that solid.
        report: keys `silhouette_px`, `mask_iou`, `accepted`, `refined` (whether the shape is the refined one)
            and `refinement` (details).
    """

    shape: bytes
    structure: Structure
    surfaces: tuple[Surface, ...]
    report: dict[str, Any]


def polish(
    worker: Worker, job: Job, shape: bytes, structure: Structure, surfaces: tuple[Surface, ...], views: Views
) -> Polished:
    """Judge a solid by the images, refine it, build it again, and keep the better one.

    Args:
        worker: the kernel's process.
        job: settings, silhouettes.
        shape: the solid as OCC bytes, unit frame.
        structure: its faces, edges and vertices; `surfaces`: what its indices mean.
        views: images and cameras.
    """
    log, settings, start = get_logger("brep"), job.settings, time.monotonic()
    try:
        mesh = worker.call("refine.mesh:from_bytes", (shape,), settings.time_limit_s)
        if not settings.refine or not any(f.surface >= 0 for f in structure.faces):
            verdict = acceptance(mesh, structure, surfaces, views, settings)
            return Polished(shape, structure, surfaces, _report(verdict, False, {"kept": False}))
        result = refine(structure, mesh, surfaces, views, settings)
        details: dict[str, Any] = dict(result.report)
        if not details["kept"]:
            return Polished(shape, structure, surfaces, _report(result.before, False, details))
        rebuilt = _rebuild(worker, job, result, structure, views)
    except (WorkerError, BrepGaussianError, np.linalg.LinAlgError) as error:
        log.warning("not refined: %s", error)
        return Polished(shape, structure, surfaces, _nothing(f"not refined: {error}"))
    details["seconds"] = round(time.monotonic() - start, 2)
    if rebuilt is None:
        details["fault"] = "the refined surfaces gave no solid that is as good"
        log.warning(details["fault"])
        return Polished(shape, structure, surfaces, _report(result.before, False, details))
    attempt, verdict = rebuilt
    log.info(
        "refined: silhouettes %.3f -> %.3f px, IoU %.5f -> %.5f, %s",
        result.before.silhouette_px,
        verdict.silhouette_px,
        result.before.mask_iou,
        verdict.mask_iou,
        "accepted" if verdict.accepted else "not accepted",
    )
    assert attempt.shape is not None
    assert attempt.verdict.structure is not None
    return Polished(attempt.shape, attempt.verdict.structure, attempt.surfaces, _report(verdict, True, details))


def _rebuild(
    worker: Worker, job: Job, result: RefineResult, before: Structure, views: Views
) -> tuple[Attempt, Acceptance] | None:
    """The solid of the refined surfaces, if it has the first one's topology, or convinces by the images."""
    arguments = (result.mesh, result.structure, result.surfaces)
    patches = worker.call("refine.polish:make_patches", arguments, job.settings.time_limit_s)
    second = Job(
        patches=patches,
        caps=(),
        ends=np.zeros((0, 3)),
        open_patches=(),
        silhouettes=job.silhouettes,
        settings=job.settings,
    )
    for margin in _MARGINS:
        rung = Rung("refined", margin, silhouettes=False)
        try:
            attempt: Attempt = worker.call("assemble:attempt", (second, rung), job.settings.time_limit_s)
        except (WorkerError, BrepGaussianError):
            continue
        if attempt.shape is None or attempt.verdict.structure is None:
            continue
        mesh = worker.call("refine.mesh:from_bytes", (attempt.shape,), job.settings.time_limit_s)
        poses = result.poses if result.poses.any() else None
        verdict = acceptance(
            mesh, attempt.verdict.structure, attempt.surfaces, views, job.settings, poses=poses, tone=result.tone
        )
        same = topology(attempt.verdict.structure, attempt.surfaces) == topology(before, result.surfaces)
        if same and _as_good(verdict, result.acceptance):
            return attempt, verdict
        # Faces that touch in a point may join or part. The images decide.
        if verdict.accepted and not result.before.accepted:
            return attempt, verdict
    return None


def make_patches(mesh: FaceMesh, structure: Structure, surfaces: tuple[Surface, ...]) -> tuple[Patch, ...]:
    """Samples of the refined faces as the support of their surfaces, one patch a surface."""
    from brepgaussian.brep.cells import sample_triangles

    owner = np.array([f.surface for f in structure.faces], np.int64)[mesh.face]
    patches = []
    for index in sorted({f.surface for f in structure.faces if f.surface >= 0}):
        corners = mesh.vertices[mesh.triangles[owner == index]]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = 0.5 * float(np.linalg.norm(cross, axis=1).sum())
        spacing = min(_SPACING, np.sqrt(area / _SMALL_FACE)) if area > 0 else _SPACING
        points, _, source, _ = sample_triangles(corners, spacing)
        surface = surfaces[index]
        points = surface.project(np.concatenate([points, corners.reshape(-1, 3)]))
        outward = np.concatenate([cross[source], np.repeat(cross, 3, axis=0)])
        normals = surface.normals(points)
        sign = np.sign(np.einsum("ni,ni->n", normals, outward))
        normals = normals * np.where(sign == 0, 1.0, sign)[:, None]
        if float(sign.sum()) < 0:
            surface = surface.flip()
        patches.append(Patch(surface, index, points, normals, _REACH * spacing, 0.0))
    return tuple(patches)


def topology(structure: Structure, surfaces: tuple[Surface, ...]) -> tuple[Any, ...]:
    """Numbers of faces by kind and of adjacent pairs of kinds: equal for solids of the same topology."""
    kinds = [surfaces[f.surface].kind if f.surface >= 0 else "other" for f in structure.faces]
    pairs = {tuple(sorted(e.faces)) for e in structure.edges}
    meets = Counter(tuple(sorted((kinds[a], kinds[b]))) for a, b in pairs)
    return tuple(sorted(Counter(kinds).items())), tuple(sorted(meets.items()))


def _as_good(rebuilt: Acceptance, refined: Acceptance) -> bool:
    """Whether the kernel's solid is what the refinement meant."""
    if refined.accepted and not rebuilt.accepted:
        return False
    worse = rebuilt.silhouette_px - refined.silhouette_px
    return not worse > _TENTH_PX and rebuilt.mask_iou > refined.mask_iou - 1e-3


def _report(verdict: Acceptance, refined: bool, details: dict[str, Any]) -> dict[str, Any]:
    px = verdict.silhouette_px
    return {
        "silhouette_px": float(px) if np.isfinite(px) else None,
        "mask_iou": float(verdict.mask_iou),
        "accepted": verdict.accepted,
        "refined": refined,
        "refinement": {**details, "edges": verdict.edges, "faces": verdict.faces},
    }


def _nothing(reason: str) -> dict[str, Any]:
    return {"silhouette_px": None, "accepted": None, "refined": False, "refinement": {"fault": reason}}
