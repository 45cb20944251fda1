"""The seam to the refinement: surfaces made exact by the images, the solid rebuilt with the same topology."""

from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

from brepgaussian.artifacts.views import Views
from brepgaussian.brep.job import Attempt, Job, Rung
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.structure import Structure
from brepgaussian.brep.worker import Worker, WorkerError
from brepgaussian.errors import BrepGaussianError
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.log import get_logger

OTHER_TOPOLOGY = "its topology differs"
_SLACK = 0.01  # of the gate's score: what refined surfaces may lose on the points


@dataclass(frozen=True)
class Polished:
    """A solid after the refinement.

    Attributes:
        attempt: the rebuilt solid, or the given one where that is better or cannot be rebuilt.
        report: `silhouette_px`, `mask_iou`, `accepted` of that solid, and how the refinement went.
    """

    attempt: Attempt
    report: dict[str, Any]


def polish(worker: Worker, job: Job, rung: Rung, attempt: Attempt, views: Views) -> Polished:
    """Refine the surfaces of a solid against the images, rebuild it, and judge the result by the images.

    Nothing that goes wrong here costs the solid that there is.
    """
    from brepgaussian.brep.refine import acceptance, refine

    log, settings = get_logger("brep"), job.settings
    try:
        structure, mesh = worker.call("assemble:inspect", (attempt.shape, attempt.surfaces), settings.time_limit_s)
        if not settings.refine:
            test = acceptance(mesh, structure, attempt.surfaces, views, settings)
            return Polished(attempt, _figures(test) | {"refined": False})
        result = refine(structure, mesh, attempt.surfaces, views, settings)
        details = {k: v for k, v in result.report.items() if k != "seconds"}  # a rerun gives the same bytes
        if not details.get("kept", True):
            return Polished(attempt, _figures(result.before) | {"refined": False, "refinement": details})
        moved = with_surfaces(job, rung, result.surfaces, {f.surface for f in structure.faces})
        rebuilt = worker.call("assemble:attempt", (moved, rung), settings.time_limit_s)
        fault = _difference(attempt, rebuilt)
        if fault == OTHER_TOPOLOGY:
            structure, mesh = worker.call("assemble:inspect", (rebuilt.shape, rebuilt.surfaces), settings.time_limit_s)
            test = acceptance(mesh, structure, rebuilt.surfaces, views, settings, poses=result.poses)
            if test.mask_iou > result.before.mask_iou and rebuilt.verdict.score > attempt.verdict.score - _SLACK:
                figures = _figures(test) | {"refined": True, "refinement_fault": fault}
                return Polished(rebuilt, figures | {"refinement": details})
        if fault:
            log.warning("the refined solid is not published: %s", fault)
            figures = _figures(result.before) | {"refined": False, "refinement_fault": fault}
            return Polished(attempt, figures | {"refinement": details})
        return Polished(rebuilt, _figures(result) | {"refined": True, "refinement": details})
    except (WorkerError, BrepGaussianError, ValueError, ArithmeticError, RuntimeError, IndexError) as error:
        log.warning("no refinement: %s", error)
        return Polished(attempt, {"refined": False, "refinement_fault": str(error)})


def with_surfaces(job: Job, rung: Rung, surfaces: tuple[Surface, ...], used: set[int]) -> Job:
    """The same job with other surfaces under the same points; caps that the solid does not use are left out."""
    count = len(job.patches)
    patches = tuple(replace(p, surface=s) for p, s in zip(job.patches, surfaces[:count], strict=True))
    caps: tuple[Patch, ...] = ()
    if rung.caps:
        moved = [replace(p, surface=s) for p, s in zip(job.caps, surfaces[count:], strict=True)]
        caps = tuple(c for i, c in enumerate(moved, start=count) if i in used)
    return replace(job, patches=patches, caps=caps)


def _figures(test: Any) -> dict[str, Any]:
    """The acceptance test's figures; a residual that could not be measured is None."""
    px = float(test.silhouette_px)
    return {
        "silhouette_px": px if px == px else None,
        "mask_iou": float(test.mask_iou),
        "accepted": bool(test.accepted),
    }


def _difference(before: Attempt, after: Attempt) -> str:
    """Why a rebuilt solid is not the same one with better surfaces; empty if it is."""
    if after.shape is None or after.verdict.structure is None or before.verdict.structure is None:
        return "; ".join(after.verdict.faults) or "it has no structure"
    if _named(before) != _named(after):
        return OTHER_TOPOLOGY
    new = set(after.verdict.doubts) - set(before.verdict.doubts)
    return "; ".join(sorted(new)) if len(after.verdict.doubts) > len(before.verdict.doubts) else ""


def _named(attempt: Attempt) -> tuple[Counter[Any], Counter[Any]]:
    """The topology with used surfaces numbered in order: indices shift where unused caps are left out."""
    structure = attempt.verdict.structure
    assert structure is not None
    used = sorted({f.surface for f in structure.faces})
    return topology(structure, {s: i for i, s in enumerate(used)})


def topology(structure: Structure, name: dict[int, int]) -> tuple[Counter[Any], Counter[Any]]:
    """Faces by surface and adjacent pairs of surfaces (once for each pair of faces)."""
    faces = Counter(name[f.surface] for f in structure.faces)
    pairs = {tuple(sorted(e.faces)): tuple(sorted(name[s] for s in e.surfaces)) for e in structure.edges}
    return faces, Counter(pairs.values())
