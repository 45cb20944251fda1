"""The ladder: one attempt after another until the gate has no doubts; the last rung always closes."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from brepgaussian.artifacts.points import Points
from brepgaussian.artifacts.primitives import Primitives
from brepgaussian.artifacts.views import Views
from brepgaussian.brep.borders import continuing, open_points
from brepgaussian.brep.budget import budget_of
from brepgaussian.brep.caps import find_caps
from brepgaussian.brep.explanations import bared, explanations, touching
from brepgaussian.brep.floors import floors_of_bores
from brepgaussian.brep.job import Attempt, Job
from brepgaussian.brep.patches import make_patches
from brepgaussian.brep.polish import Polished, badness, inspect
from brepgaussian.brep.search import Search
from brepgaussian.brep.shown import SHOWN_PX, edge_rows
from brepgaussian.brep.silhouettes import Silhouettes, make_silhouettes
from brepgaussian.brep.structure import CONVEX, Structure
from brepgaussian.brep.tidy import tidy
from brepgaussian.brep.worker import Worker, WorkerError
from brepgaussian.errors import BrepGaussianError, StageError
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.log import get_logger
from brepgaussian.primitives.afresh import alternatives
from brepgaussian.primitives.stage import primitives_of
from brepgaussian.primitives.unclaimed import with_unclaimed
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.settings.primitives import PrimitivesSettings

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
    silhouettes = make_silhouettes(views.alpha, views.cameras, settings.gate_views, settings.gate_side)
    return _job(points, primitives, silhouettes, settings)


def _job(
    points: Points,
    primitives: Primitives,
    silhouettes: Silhouettes | None,
    settings: BrepSettings,
    poor_too: bool = False,
) -> Job:
    patches = make_patches(primitives.items, points, settings.max_reach)
    if settings.tidy:
        patches = tidy(patches, PrimitivesSettings().sigma_floor, poor_too)
    borders = open_points(patches)
    caps, floors = find_caps(patches, borders, settings.seed), floors_of_bores(patches, borders)
    ends = np.concatenate([*(p.xyz[b] for p, b in zip(patches, borders, strict=True)), np.zeros((0, 3))])
    open_patches = tuple(sorted({*continuing(patches, borders), *(i for i, b in enumerate(borders) if len(b))}))
    get_logger("brep").info(
        "%d patches, open borders at %s, %d caps, %d floors", len(patches), open_patches, len(caps), len(floors)
    )
    return Job(tuple(patches), tuple(caps), ends, open_patches, silhouettes, settings, floors=tuple(floors))


def other_jobs(points: Points, primitives: Primitives, job: Job, labellings: Iterable[Points] = ()) -> Iterator[Job]:
    """Jobs of all primitives, of other explanations of the points, with surfaces for points that have none (walls that
    touch with them, too), of other labellings and what explains these, and afresh.
    """
    every = _job(points, primitives, job.silhouettes, job.settings, poor_too=True)
    poor_too = len(every.patches) > len(job.patches)
    if poor_too:
        yield every
    yield from explanations(job, primitives.sigma)
    if poor_too:
        yield from explanations(every, primitives.sigma)
    settings = PrimitivesSettings()
    more = with_unclaimed(points, primitives, settings)
    if more is not None:
        claimed = _job(points, more, job.silhouettes, job.settings)
        yield claimed
        yield from touching(claimed, more.sigma)
    for number, labelled in enumerate(labellings, 1):
        other = primitives_of(labelled, settings)
        relabelled = replace(_job(labelled, other, job.silhouettes, job.settings), labelling=number)
        yield relabelled
        yield from explanations(relabelled, other.sigma)
    for other in alternatives(points, primitives, settings):
        afresh = _job(points, other, job.silhouettes, job.settings)
        yield from bared(afresh)
        yield afresh


def climb(
    worker: Worker,
    job: Job,
    points: Points,
    views: Views | None = None,
    others: Iterable[Job] = (),
) -> Outcome:
    """Search for the best solid, and fall back to the polyhedral one where there is none.

    With views, solids are refined against the images, and these decide between them and those of `others`.

    Raises:
        StageError: not even the fallback closes.
    """
    search = Search(worker, job, budget_of(job.settings), views, others)
    found = _writable(worker, search, search.run())
    if found is None:
        found = Polished(_fallback(worker, job, points), {})
        search.tried.append(found.attempt)
    chosen, judged = found.attempt, found.report
    get_logger("brep").info("judged: %s", {k: v for k, v in judged.items() if k != "refinement"})
    assert chosen.shape is not None
    assert chosen.verdict.structure is not None
    report = _report(chosen, [*search.tried, *search.beside]) | judged
    guessed = _guessed(chosen, judged)
    if guessed:
        report["accepted"] = False
        report["hints"] = [*report["hints"], f"{guessed} faces are guessed: no view shows an edge of them where it is"]
    untold = _untold(worker, chosen, views, job.settings) if views is not None and report["accepted"] else []
    if untold:
        report["accepted"] = False
        report["hints"] = [*report["hints"], f"floors {untold} may lie deeper: views tell no better that they do not"]
    return Outcome(chosen.shape, chosen.verdict.structure, chosen.surfaces, report)


def _writable(worker: Worker, search: Search, found: Polished | None) -> Polished | None:
    """The solid that was found if a STEP file gives it back as it is, else the best other one of which that holds."""
    views, settings = search.views, search.job.settings
    judged = sorted(search.polished.values(), key=lambda p: badness(p.report, settings))
    others = [Polished(attempt, {}) for attempt in search.publishable()]
    frame = (np.eye(4), "mm") if views is None else (views.world_from_unit, views.unit)
    refused: list[bytes | None] = []
    for rival in [] if found is None else [found, *judged, *others]:
        if rival.attempt.shape in refused:
            continue
        try:
            worker.call("publish:check_step", (rival.attempt.shape, *frame), settings.time_limit_s)
        except (WorkerError, BrepGaussianError) as error:
            refused.append(rival.attempt.shape)
            get_logger("brep").warning("rung %s is not published: %s", rival.attempt.rung, error)
        else:
            return rival
    return None


def _guessed(chosen: Attempt, judged: Mapping[str, Any]) -> int:
    """Number of faces on surfaces without points, none of whose edges the images show where it is.

    Light that faces throw on each other shifts concave edges: where there are convex ones, these tell.
    """
    structure, details = chosen.verdict.structure, judged.get("refinement", {})
    if structure is None or not details:
        return 0
    off: dict[bool, dict[int, float]] = {True: {}, False: {}}  # px of a face's best convex edge, and of its best other
    for k, row in edge_rows(details["edges"]):
        told = [px for px in (row["silhouette_px"], row["interior_px"]) if px is not None]
        best = off[structure.edges[k].convexity == CONVEX]
        for face in structure.edges[k].faces if told else ():
            best[face] = min(best.get(face, np.inf), *told)
    missed = {face for face, px in off[True].items() if px > SHOWN_PX}
    seen = ({*off[True], *off[False]}) - missed
    primitives = [chosen.primitives[f.surface] if f.surface >= 0 else 0 for f in structure.faces]
    return sum(primitive < 0 and face not in seen for face, primitive in enumerate(primitives))


def _untold(worker: Worker, chosen: Attempt, views: Views, settings: BrepSettings) -> list[int]:
    """Faces that are floors of deep narrow holes, of which views do not tell where they lie."""
    from brepgaussian.brep.refine.floors import untold_floors
    from brepgaussian.brep.refine.visibility import Scene

    try:
        structure, mesh = inspect(worker, chosen, settings)
    except WorkerError as error:  # the kernel has made this solid, so the loss is a judgement only
        get_logger("brep").warning("floors are not judged: %s", error)
        return []
    return untold_floors(Scene(mesh), structure, views)


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


def _report(chosen: Attempt, tried: list[Attempt]) -> dict[str, Any]:
    verdict = chosen.verdict
    return {
        "rung": chosen.rung,
        "fallback": chosen.fallback,
        "labelling": chosen.labelling,
        "doubts": list(verdict.doubts),
        "explained": {
            str(p): round(e, _DIGITS) for p, e in zip(chosen.primitives, verdict.explained, strict=False) if p >= 0
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
