"""The seam to the refinement: surfaces made exact by the images, the solid rebuilt with the same topology."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.brep.job import Attempt, Job, Rung
from brepgaussian.brep.likeness import OTHER_TOPOLOGY, closer, difference, left_out, named
from brepgaussian.brep.patches import with_floor
from brepgaussian.brep.shown import ShownEdge, shown_edges
from brepgaussian.brep.structure import Structure
from brepgaussian.brep.tangents import cleared
from brepgaussian.brep.worker import Worker, WorkerError
from brepgaussian.errors import BrepGaussianError
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.log import get_logger
from brepgaussian.settings.brep import BrepSettings

Array = NDArray[np.float64]

_EXPLAINED = 0.5  # reaches from the surface: the median of a patch that is explained; beyond one reach it is not
_ROUNDS = 3  # of refining and rebuilding
_MARGINS = (0.02, 0.04)  # of the sheets that are rebuilt from refined faces, unit frame
_ROUNDING = 1e-9
_MASK_LIMITS = 1.0  # of what may be wrong with silhouettes, all counts together
_IOU_SLACK = 1e-3  # what the kernel's solid may lose against the refined triangulation


@dataclass(frozen=True)
class Polished:
    """A solid after the refinement.

    Attributes:
        attempt: the rebuilt solid, or the given one where that is better or cannot be rebuilt.
        report: `silhouette_px`, `mask_iou`, `accepted` of that solid, and how the refinement went.
        shown: the edges within its outline that the images show.
        off: (P, 4) places that lie elsewhere, and by how many px they should lie deeper, where edges agree.
    """

    attempt: Attempt
    report: dict[str, Any]
    shown: tuple[ShownEdge, ...] = ()
    off: Array = field(default_factory=lambda: np.zeros((0, 4)))


def polish(worker: Worker, job: Job, rung: Rung, attempt: Attempt, views: Views, hopeless: float = np.inf) -> Polished:
    """Refine the surfaces of a solid against the images, rebuild it, and judge the result by the images.

    Where the rebuilt solid has another topology (faces that touch in a point join or part), it is refined
    once more. Nothing that goes wrong here costs the solid that there is. What is refused with a `hopeless` badness
    once it is refined is not built again.
    """
    from brepgaussian.brep.refine import acceptance, refine

    log, settings = get_logger("brep"), job.settings
    best: Polished | None = None
    footprint = views.cameras.footprint()
    lost = partial(_is_hopeless, hopeless=hopeless, settings=settings) if np.isfinite(hopeless) else None
    try:
        structure, mesh = inspect(worker, attempt, settings)
        if not settings.refine:
            test = acceptance(mesh, structure, attempt.surfaces, views, settings)
            return _polished(attempt, {"refined": False}, structure, test, job, footprint)
        for _ in range(_ROUNDS):
            given = (structure, mesh, attempt.surfaces, views, settings)
            result = refine(*given, hopeless=lost)
            drawn = _drawn(job, structure, attempt, result)
            if drawn:
                firm = refine(*given, drawn, lost)
                result = firm if firm.accepted or not result.accepted else result
            if job.clear:
                result = replace(result, surfaces=_cleared(job, result.surfaces))
            details = {k: v for k, v in result.report.items() if k != "seconds"}  # a rerun gives the same bytes
            if best is None:
                notes = {"refined": False, "refinement": details | _tables(result.before)}
                best = _polished(attempt, notes, structure, result.before, job, footprint)
            if not result.report["kept"] or (lost is not None and lost(result.acceptance)):
                break
            parted = _parted(worker, job, rung, attempt, result, views)
            rebuilt = parted or _rebuilt(worker, job, rung, attempt, result, views)
            if parted:
                result = replace(result, surfaces=result.parted)
            if isinstance(rebuilt, str):
                log.warning("refined surfaces are not published: %s", rebuilt)
                best.report["refinement_fault"] = rebuilt
                break
            same = named(rebuilt[0]) == named(attempt)
            attempt, test, structure, mesh = rebuilt
            notes = {"refined": True, "refinement": details | _tables(test)}
            best = _polished(attempt, notes, structure, test, job, footprint)
            if same:
                break
            job = with_surfaces(job, rung, result)
    except (WorkerError, BrepGaussianError, ValueError, ArithmeticError, RuntimeError, IndexError) as error:
        log.warning("no refinement: %s", error)
        best = best or Polished(attempt, {"refined": False})
        best.report["refinement_fault"] = str(error)
    assert best is not None
    return best


def _is_hopeless(test: Any, hopeless: float, settings: BrepSettings) -> bool:
    """Whether a refinement leaves so much to object to that no other solid of the same surfaces makes up for it.

    What lies elsewhere is one of these; between solids it doesn't count, for of worse ones it isn't known.
    """
    figures = _figures(test)
    displaced = in_limits(figures["displaced"] or 0.0, settings.accept_displaced)
    return not test.accepted and badness(figures, settings) + max(displaced - 1, 0.0) > hopeless


def _polished(
    attempt: Attempt, notes: dict[str, Any], structure: Structure, test: Any, job: Job, footprint: float
) -> Polished:
    """A solid with the figures of its acceptance test, and notes on the refinement."""
    places = np.zeros((0, 4)) if test.displaced is None else np.asarray(test.displaced.places)
    shown = shown_edges(structure, test.edges, footprint, {b.patch for b in job.blends})
    figures = _figures(test)
    off = test.silhouette_px > job.settings.accept_silhouette_px
    if sum(map(bool, (off, attempt.verdict.doubts, attempt.verdict.hints))) > 1:
        # few samples alone may excuse such an edge, and images a patch left out or missing points; but no two at once
        figures["accepted"] = False
    return Polished(attempt, figures | notes, shown, places)


def _tables(test: Any) -> dict[str, Any]:
    """The acceptance test's rows of edges and faces."""
    return {"edges": test.edges, "faces": test.faces}


def _drawn(job: Job, structure: Structure, attempt: Attempt, result: Any) -> frozenset[int]:
    """Surfaces that left the points that they explained: an edge that is not theirs, such as a rim's, drew them."""
    used = {f.surface for f in structure.faces}
    moved = zip(job.patches, attempt.surfaces, result.surfaces, strict=False)
    off = {i: [np.median(np.abs(s.signed_distance(p.xyz))) / p.reach for s in (old, new)]
           for i, (p, old, new) in enumerate(moved) if i in used and not p.cap}  # fmt: skip
    return frozenset(i for i, (before, after) in off.items() if before < _EXPLAINED and after > 1)


def badness(report: Mapping[str, Any], settings: BrepSettings) -> float:
    """How much the images dislike a solid, in units of the acceptance limits; infinite if it was not judged."""
    px, iou = report.get("silhouette_px"), report.get("mask_iou")
    if px is None or iou is None:
        return float("inf")
    disputed = in_limits(report.get("disputed", 0.0), settings.accept_disputed)
    stepped = in_limits(report.get("stepped", 0.0), settings.accept_stepped)
    beyond = max(disputed - 1, 0.0) + max(stepped - 1, 0.0)  # of less, chance has its share
    return float(in_limits(px, settings.accept_silhouette_px) + wrong_masks(report, settings) + beyond)


def wrong_masks(report: Mapping[str, Any], settings: BrepSettings) -> float:
    """How far the silhouettes of a judged solid are wrong, in limits."""
    missing = in_limits(1 - report["mask_iou"], 1 - settings.accept_iou)
    return missing + in_limits(report.get("astray", 0.0), settings.accept_astray)


def outlined(report: Mapping[str, Any], settings: BrepSettings) -> bool:
    """Whether edges and silhouettes of a judged solid are right, whatever lies between them."""
    px, iou = report.get("silhouette_px"), report.get("mask_iou")
    if px is None or iou is None:
        return False
    return bool(px < settings.accept_silhouette_px and wrong_masks(report, settings) < _MASK_LIMITS)


def in_limits(value: float, limit: float) -> float:
    """A figure in units of a limit, which may be none."""
    return float(value / max(limit, _ROUNDING))


def inspect(worker: Worker, attempt: Attempt, settings: BrepSettings) -> Any:
    """Structure and triangulation of an attempt's solid."""
    return worker.call("assemble:inspect", (attempt.shape, attempt.surfaces), settings.time_limit_s)


_Rebuilt = tuple[Attempt, Any, Structure, Any]


def _parted(worker: Worker, job: Job, rung: Rung, attempt: Attempt, result: Any, views: Views) -> _Rebuilt | None:
    """The same as `_rebuilt` where cylinders part each other as they cross, if images like that no less."""
    from brepgaussian.brep.refine.accept import keeps

    if not result.parted:
        return None
    rebuilt = _rebuilt(worker, job, rung, attempt, replace(result, surfaces=result.parted), views)
    if isinstance(rebuilt, str) or not keeps(rebuilt[1], result.acceptance):
        return None
    return rebuilt if named(rebuilt[0])[0].total() >= named(attempt)[0].total() else None


def _rebuilt(worker: Worker, job: Job, rung: Rung, attempt: Attempt, result: Any, views: Views) -> _Rebuilt | str:
    """The solid of the refined surfaces with its acceptance test, structure and triangulation, or what is wrong.

    First from the refined faces themselves, then from the points as before.
    """
    from brepgaussian.brep.refine import acceptance

    settings = job.settings
    moved = with_surfaces(job, rung, result)
    own = (result.mesh, result.structure, result.surfaces, moved, rung)
    calls: list[tuple[str, tuple[Any, ...]]] = [("assemble:attempt", (moved, rung))]
    if not job.blends:  # fillets are rolled on the faces themselves
        calls = [("refine.support:rebuild", (*own, margin)) for margin in _MARGINS] + calls
    fault, spare = "", None
    for function, arguments in calls:
        try:
            rebuilt: Attempt = worker.call(function, arguments, settings.time_limit_s)
        except (WorkerError, BrepGaussianError) as error:
            fault = fault or str(error)
            continue
        rebuilt = replace(rebuilt, verdict=rebuilt.verdict.with_moved_borders())
        fresh = difference(attempt, rebuilt)
        lost = left_out(attempt, rebuilt, settings.gate_explained) if fresh else ""
        if fresh not in ("", OTHER_TOPOLOGY) or lost:
            fault = fault or "; ".join(filter(None, (fresh, lost)))
            continue
        structure, mesh = inspect(worker, rebuilt, settings)
        poses = result.poses if result.poses.any() else None
        test = acceptance(mesh, structure, rebuilt.surfaces, views, settings, poses=poses, tone=result.tone)
        same = not fresh or closer(attempt, rebuilt)
        if _as_good(test, result, same):
            found = rebuilt, test, structure, mesh
            if not (same and result.accepted and not test.accepted):
                return found
            spare = spare or found  # refused for an edge that few samples show
        fault = fault or fresh or "the rebuilt solid agrees less with the images than its surfaces"
    return spare or fault


def _as_good(test: Any, result: Any, same: bool) -> bool:
    """Whether a rebuilt solid is what the refinement meant; another topology must convince by the images."""
    from brepgaussian.brep.refine.refinement import better

    if same:
        return test.mask_iou > result.mask_iou - _IOU_SLACK and better(test, result.before)
    if test.mask_iou < max(result.mask_iou, result.before.mask_iou) - _IOU_SLACK:
        return False  # what silhouettes show is not left out
    if test.accepted != result.before.accepted:
        return bool(test.accepted)
    return bool(test.mask_iou > result.before.mask_iou and not test.silhouette_px > result.before.silhouette_px)


def with_surfaces(job: Job, rung: Rung, result: Any) -> Job:
    """The same job with refined surfaces under the same points; caps that the solid does not use are left out.

    Points of floors that were moved to where none are, and those of walls below, follow.
    """
    surfaces, count = result.surfaces, len(job.patches)
    used = {f.surface for f in result.structure.faces}
    before = {index: job.patches[index] for index in result.plumbed if index < count}
    moved = [replace(p, surface=s) for p, s in zip(job.guesses(rung), surfaces[count:], strict=True)]
    floors, rest = moved[: len(job.floors)], enumerate(moved[len(job.floors) :], start=count + len(job.floors))
    caps = tuple(c for i, c in rest if i in used)
    job = replace(with_patches_on(job, surfaces), floors=tuple(floors), caps=caps)
    for index, floor in before.items():
        job = replace(job, patches=tuple(with_floor(job.patches, index, floor)))
    return job


def _cleared(job: Job, surfaces: tuple[Surface, ...]) -> tuple[Surface, ...]:
    """Refined surfaces, planes kept clear of the cylinders that they touch in a point."""
    patches = with_patches_on(job, surfaces).patches
    return (*(patch.surface for patch in cleared(patches)), *surfaces[len(patches) :])


def with_patches_on(job: Job, surfaces: tuple[Surface, ...]) -> Job:
    """The same job with other surfaces under its patches, the first ones; caps stay."""
    count = len(job.patches)
    return replace(
        job, patches=tuple(replace(p, surface=s) for p, s in zip(job.patches, surfaces[:count], strict=True))
    )


def _figures(test: Any) -> dict[str, Any]:
    """The acceptance test's figures; a residual that could not be measured is None."""
    px = float(test.silhouette_px)
    return {
        "silhouette_px": px if px == px else None,
        "mask_iou": float(test.mask_iou),
        "mask_pixels": int(test.mask_pixels),
        "astray": float(test.astray),
        "disputed": float(test.disputed),
        "displaced": None if test.displaced is None else float(test.displaced.area),
        "stepped": float(test.stepped),
        "accepted": bool(test.accepted),
    }
