"""The ladder: one attempt after another until the gate has no doubts; the last rung always closes."""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from brepgaussian.artifacts.points import Points
from brepgaussian.artifacts.primitives import Primitives
from brepgaussian.artifacts.views import Views
from brepgaussian.brep.borders import open_points
from brepgaussian.brep.caps import find_caps
from brepgaussian.brep.job import Attempt, Job, Rung
from brepgaussian.brep.patches import make_patches
from brepgaussian.brep.polish import Polished, polish
from brepgaussian.brep.silhouettes import make_silhouettes
from brepgaussian.brep.structure import Structure
from brepgaussian.brep.tidy import tidy
from brepgaussian.brep.verdict import Verdict
from brepgaussian.brep.worker import Worker, WorkerError
from brepgaussian.errors import BrepGaussianError, StageError
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.log import get_logger
from brepgaussian.settings.brep import BrepSettings

_MENDING = ("open_extended", "caps")  # rungs that make up for missing points
_CLEARLY = 0.02  # of the score: two percent of the points, or .4 percent of the silhouettes
_SHAPE_DIGITS = 3  # of the volume of two solids that count as one shape
_SAME_ENOUGH = 3  # rungs after the first that gave its solid again
_DIGITS = 6  # of figures in the report


@dataclass(frozen=True)
class Outcome:
    """What is published.

    Attributes:
        shape: the solid as OCC bytes, unit frame.
        structure: its faces, edges and vertices by surface.
        surfaces: which the structure's indices mean.
        report: for `brep.h5`.
    """

    shape: bytes
    structure: Structure
    surfaces: tuple[Surface, ...]
    report: dict[str, Any]


def make_job(views: Views, points: Points, primitives: Primitives, settings: BrepSettings) -> Job:
    """Collect what every attempt needs."""
    patches = make_patches(primitives.items, points, settings.max_reach)
    silhouettes = make_silhouettes(views.alpha, views.cameras, settings.gate_views, settings.gate_side)
    if settings.tidy:
        patches = tidy(patches)
    borders = open_points(patches)
    caps = find_caps(patches, borders, settings.seed)
    ends = np.concatenate([*(p.xyz[b] for p, b in zip(patches, borders, strict=True)), np.zeros((0, 3))])
    open_patches = tuple(i for i, b in enumerate(borders) if len(b))
    get_logger("brep").info("%d patches, open borders at %s, %d caps", len(patches), open_patches, len(caps))
    return Job(tuple(patches), tuple(caps), ends, open_patches, silhouettes, settings)


def rungs(job: Job) -> list[Rung]:
    """The attempts in order of preference."""
    settings = job.settings
    result = [Rung("support", settings.margin)]
    some = job.open_patches
    if 0 < len(some) <= settings.max_extended:
        result.append(Rung("open_extended", settings.margin, some))
    if job.caps and len(some) <= settings.max_extended:
        result.append(Rung("caps", settings.margin, some, caps=True))
    result.append(Rung("wide", settings.wide_margin))
    everything = tuple(range(len(job.patches)))
    if len(everything) <= settings.max_extended:
        result.append(Rung("extended", settings.wide_margin, everything))
    result.append(Rung("points_only", settings.margin, silhouettes=False))
    result.append(Rung("lenient", settings.wide_margin, unsupported=0.25))
    return result


def climb(worker: Worker, job: Job, points: Points, start: float, views: Views | None = None) -> Outcome:
    """Try the rungs in order.

    The first solid without doubts is published; failing that the best of those with doubts, if it explains
    enough; failing that the polyhedral fallback. With views, the chosen solid is refined against them.

    Raises:
        StageError: not even the fallback closes.
    """
    log, settings = get_logger("brep"), job.settings
    tried: list[Attempt] = []
    ladder = rungs(job) if job.patches else []
    guesses = [r.name for r in ladder if r.name in _MENDING]
    for rung in ladder:
        if time.monotonic() - start > settings.total_time_s:
            break
        try:
            result = worker.call("assemble:attempt", (job, rung), settings.time_limit_s)
        except (WorkerError, BrepGaussianError) as error:
            result = Attempt(rung.name, None, Verdict((str(error),)))
        tried.append(result)
        log.info("rung %s: %s", rung.name, _remarks(result) or "accepted")
        if _settled(tried, guesses) or _repeating(tried):
            break
    chosen = _choose(tried, settings)
    if chosen is None:
        chosen = _fallback(worker, job, points)
        tried.append(chosen)
    judged: dict[str, Any] = {}
    if views is not None and not chosen.fallback:
        polished = _judge(worker, job, {r.name: r for r in ladder}, tried, chosen, views)
        chosen, judged = polished.attempt, polished.report
        log.info("refined: %s", {k: v for k, v in judged.items() if k != "refinement"})
    assert chosen.shape is not None
    assert chosen.verdict.structure is not None
    return Outcome(chosen.shape, chosen.verdict.structure, chosen.surfaces, _report(chosen, tried, job) | judged)


def _judge(
    worker: Worker, job: Job, ladder: dict[str, Rung], tried: list[Attempt], chosen: Attempt, views: Views
) -> Polished:
    """The chosen solid refined; where the images do not accept it, the runner-up of another shape gets its chance."""
    first = polish(worker, job, ladder[chosen.rung], chosen, views)
    rivals = [t for t in _publishable(tried, job.settings) if _shape(t) != _shape(chosen)]
    close = (first.report.get("mask_iou") or 0.0) >= job.settings.accept_iou
    if first.report.get("accepted") is not False or close or not rivals:
        return first
    rival = _best(rivals)
    second = polish(worker, job, ladder[rival.rung], rival, views)
    return max((first, second), key=lambda p: (bool(p.report.get("accepted")), p.report.get("mask_iou") or 0.0))


def _shape(attempt: Attempt) -> tuple[int, int, int, float]:
    verdict = attempt.verdict
    return verdict.faces, verdict.edges, verdict.vertices, round(verdict.volume, _SHAPE_DIGITS)


def _remarks(result: Attempt) -> str:
    return "; ".join(result.verdict.faults + result.verdict.doubts + result.verdict.hints)


def _settled(tried: list[Attempt], guesses: list[str]) -> bool:
    """Whether a solid is good enough to stop: no doubts, and no rung left that could mend a bare area."""
    good = [t for t in tried if t.shape is not None and not t.verdict.doubts]
    if not good:
        return False
    names = {t.rung for t in tried}
    return all(g in names for g in guesses) or any(not t.verdict.hints for t in good)


def _choose(tried: list[Attempt], settings: BrepSettings) -> Attempt | None:
    clean = [t for t in tried if t.shape is not None and not t.verdict.doubts]
    some = clean or _publishable(tried, settings)
    return _best(some) if some else None


def _repeating(tried: list[Attempt]) -> bool:
    """Whether rungs keep giving one and the same solid: the doubts lie in the primitives, not in the rung."""
    shapes = [_shape(t) for t in tried if t.shape is not None]
    return len(shapes) > _SAME_ENOUGH and len(set(shapes[-_SAME_ENOUGH - 1 :])) == 1


def _publishable(tried: list[Attempt], settings: BrepSettings) -> list[Attempt]:
    """Solids that beat the polyhedral fallback, doubts or not."""
    return [
        t
        for t in tried
        if t.shape is not None
        and not t.fallback
        and t.verdict.explained_all >= settings.weak_explained
        and (t.verdict.iou is None or t.verdict.iou >= settings.weak_iou)
    ]


def _best(solids: list[Attempt]) -> Attempt:
    """The highest score; an earlier rung stands unless a later one is clearly better."""
    best = solids[0]
    for other in solids[1:]:
        if other.verdict.score > best.verdict.score + _CLEARLY:
            best = other
    return best


def _fallback(worker: Worker, job: Job, points: Points) -> Attempt:
    """The polyhedral solid.

    Raises:
        StageError: it does not close either.
    """
    xyz, normals = points.xyz.astype(float), points.normals.astype(float)
    arguments = (xyz, normals, job.silhouettes, job.settings.polyhedron_faces, job)
    try:
        return worker.call("assemble:fallback", arguments, job.settings.time_limit_s)  # type: ignore[no-any-return]
    except WorkerError as error:
        try:  # without what may have crashed
            return worker.call("assemble:fallback", (xyz, None, None, *arguments[3:]), job.settings.time_limit_s)  # type: ignore[no-any-return]
        except WorkerError:
            raise StageError(f"no solid could be built from the points ({error})") from error


def _report(chosen: Attempt, tried: list[Attempt], job: Job) -> dict[str, Any]:
    verdict = chosen.verdict
    return {
        "rung": chosen.rung,
        "fallback": chosen.fallback,
        "doubts": list(verdict.doubts),
        "explained": {
            str(p.primitive): round(e, _DIGITS) for p, e in zip(job.patches, verdict.explained, strict=False)
        },
        "explained_all": round(verdict.explained_all, _DIGITS),
        "bare": round(verdict.bare, _DIGITS),
        "ends": round(verdict.ends, _DIGITS),
        "hints": list(verdict.hints),
        "caps": verdict.caps,
        "faces": verdict.faces,
        "edges": verdict.edges,
        "vertices": verdict.vertices,
        "volume": round(verdict.volume, 9),
        "silhouette_px": None,
        "mask_iou": None if verdict.iou is None else round(verdict.iou, _DIGITS),
        "accepted": None,
        "attempts": [
            {
                "rung": t.rung,
                "faults": list(t.verdict.faults),
                "doubts": list(t.verdict.doubts),
                "hints": list(t.verdict.hints),
                "notes": t.notes,
            }
            for t in tried
        ],
    }
