"""All surfaces together against the images: the outer loop."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.brep.refine.accept import PX_NOISE, WINDOW_PX, Acceptance, keeps
from brepgaussian.brep.refine.constraints import Tie
from brepgaussian.brep.refine.descent import WINDOWS, Run, descend, largest_move, move_structure, sounded
from brepgaussian.brep.refine.mesh import FaceMesh, follow
from brepgaussian.brep.refine.observe import prepare, whole_images
from brepgaussian.brep.refine.parallax import Displaced
from brepgaussian.brep.refine.parameters import recentre
from brepgaussian.brep.refine.pits import floors as floors_of
from brepgaussian.brep.refine.plumb import plumbed, soundings_of
from brepgaussian.brep.refine.regularity import crossings, given, parting, shown, unopposed
from brepgaussian.brep.refine.repair import doubtful_merges, merge
from brepgaussian.brep.refine.solve import TONES, Prior, State, residuals
from brepgaussian.brep.refine.soundings import Soundings
from brepgaussian.brep.refine.visibility import SILHOUETTE
from brepgaussian.brep.structure import Structure
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.settings.brep import BrepSettings

Array = NDArray[np.float64]

_IOU_SLACK = 1e-3  # loss of IoU that no better edge makes up for
_PX_SLACK = 1.1  # by which the worst edge may lose where the masks gain: a solid with a wrong edge is refined too
_TWIN = 1e-6  # distance within which two surfaces are the same
_PROBES = 0.2 * np.random.default_rng(0).uniform(-1, 1, (12, 3))  # places where surfaces are compared
_POSE_PX = 0.1  # median silhouette residual above which poses are freed
_POSE_GAIN = 0.7  # freed poses are kept if they reduce it below this share


@dataclass(frozen=True)
class RefineResult:
    """Outcome of the refinement.

    Attributes:
        surfaces: refined surfaces, in the order given; the start where that was better.
        silhouette_px, mask_iou, accepted: the acceptance test of the result.
        mesh: its triangulation.
        structure: its structure (polylines and vertices moved).
        acceptance: with residuals per edge and face.
        before: the acceptance test of the start.
        poses: (V, 3) image corrections du, dv (px), roll (rad); zero unless poses were freed.
        tone: (2,) tone coefficients, px.
        plumbed: surfaces of floors that were moved away from their points, to where the rays into their pits meet them.
        parted: surfaces whose cylinders part each other where they cross, which this topology doesn't; empty if none.
        report: JSON-able summary.
    """

    surfaces: tuple[Surface, ...]
    silhouette_px: float
    mask_iou: float
    accepted: bool
    mesh: FaceMesh
    structure: Structure
    acceptance: Acceptance
    before: Acceptance
    poses: Array
    tone: Array
    plumbed: frozenset[int] = frozenset()
    parted: tuple[Surface, ...] = ()
    report: dict[str, Any] = field(default_factory=dict)


def refine(
    structure: Structure,
    mesh: FaceMesh,
    surfaces: Sequence[Surface],
    views: Views,
    settings: BrepSettings,
    held: frozenset[int] = frozenset(),
    hopeless: Callable[[Acceptance], bool] | None = None,
) -> RefineResult:
    """Refine all surfaces of a solid together, its topology kept.

    If the images refuse the result, faces at bad edges are tried as pieces of their neighbours' surfaces.

    Args:
        structure: edges, faces and vertices of the solid by surface (`brep.structure.extract`).
        mesh: triangulation of the same solid (`mesh.from_solid`).
        surfaces: the surfaces that `structure` names; a surface that no face uses stays as it is.
        views: images and cameras.
        settings: prior, limits, switches.
        held: surfaces that stay where they are: what the images show beside them is not theirs.
        hopeless: of what is tested while no relations are kept: whether it isn't worth going on; None = it always is.

    Returns:
        The refined surfaces with the acceptance test; never worse than the start by that test.
    """
    first = _refine(structure, mesh, surfaces, views, settings, held, hopeless)
    if first.accepted:
        return first
    limit = settings.accept_silhouette_px
    merges = doubtful_merges(first.structure, first.mesh, first.surfaces, first.acceptance, limit)
    if not merges:
        return first
    merged = move_structure(merge(structure, merges), surfaces)
    second = _refine(merged, follow(mesh, merged, surfaces), surfaces, views, settings, held, hopeless)
    if not second.accepted and not (second.silhouette_px < first.silhouette_px and second.mask_iou > first.mask_iou):
        return first
    result = list(second.surfaces)
    for index, other in merges.items():
        result[index] = result[other]
    report = second.report | {
        "kept": True,
        "merged": [[int(a), int(b)] for a, b in merges.items()],
        "silhouette_px_before": first.report["silhouette_px_before"],
        "mask_iou_before": first.report["mask_iou_before"],
    }
    return replace(second, surfaces=tuple(result), before=first.before, report=report)


def _refine(
    structure: Structure,
    mesh: FaceMesh,
    surfaces: Sequence[Surface],
    views: Views,
    settings: BrepSettings,
    held: frozenset[int],
    hopeless: Callable[[Acceptance], bool] | None,
) -> RefineResult:
    """The refinement of one structure."""
    clock = time.perf_counter()
    anchored = tuple(_anchored(structure, mesh, surfaces))
    prior = Prior(anchored, np.radians(settings.refine_angle_deg), settings.refine_length, held)
    state = State(anchored, np.zeros(TONES), np.zeros((len(views.cameras), 3)))
    start = Run(structure, mesh, state, prior, views, prepare(views), settings.refine_observations)
    before = start.test(settings)
    found = _solved(start, settings, hopeless)
    strayed = _strayed(found)
    if strayed:  # an edge that few samples show may have been taken for another one, and have drawn a floor with it
        firm = _solved(replace(start, prior=replace(prior, held=held | strayed)), settings, hopeless)
        found = firm if _less_displaced(firm.after, found.after) else found
    run, after, ties, freed = found.run, found.after, found.ties, found.freed
    moved: frozenset[int] = frozenset()
    if after.displaced is not None:  # else there is more amiss than depths
        if after.displaced.depths.told.any():
            other = sounded(run, after.displaced, ties, freed)
            verdict = other.test(settings)
            if _closer(verdict, after):
                run, after = other, verdict
        run, after, moved = _plumbed(run, after, ties, freed, settings)
    kept = better(after, before)
    result, verdict = (run, after) if kept else (start, before)
    report = {
        "kept": kept,
        "seconds": round(time.perf_counter() - clock, 2),
        "silhouette_px_before": _number(before.silhouette_px),
        "mask_iou_before": before.mask_iou,
        "tone_px": [float(t) for t in result.state.tone],
        "poses_freed": freed and kept,
        "relations": [[t.kind, *t.members] for t in ties],
        "largest_move": largest_move(start.mesh, result.mesh),
        "image_noise": start.images.noise,
        "edges": verdict.edges,
        "faces": verdict.faces,
    }
    refined = _with_twins(structure, surfaces, result) if kept else tuple(surfaces)
    return RefineResult(
        surfaces=refined,
        silhouette_px=verdict.silhouette_px,
        mask_iou=verdict.mask_iou,
        accepted=verdict.accepted,
        mesh=result.mesh,
        structure=result.structure,
        acceptance=verdict,
        before=before,
        poses=result.state.poses,
        tone=result.state.tone,
        plumbed=moved if kept else frozenset(),
        parted=parting(result.structure, refined) if kept else (),
        report=report,
    )


@dataclass(frozen=True)
class _Solved:
    """Where the search for edges ended: the solid, its test, the relations that it holds, whether poses are free."""

    run: Run
    after: Acceptance
    ties: list[Tie]
    freed: bool


def _solved(start: Run, settings: BrepSettings, hopeless: Callable[[Acceptance], bool] | None) -> _Solved:
    """All edges measured and all surfaces moved, first without relations, then with those that show."""
    run, last = descend(start, [], WINDOWS, False)
    if hopeless is not None:
        test = run.outlined(settings)
        if hopeless(test):  # as it is, it says as well as with relations what is wrong
            return _Solved(run, test, [], False)
    freed = False
    if settings.refine_poses and _typical(run) > _POSE_PX:
        other, other_last = descend(run, [], WINDOWS[1:], True)
        if _typical(other) < _POSE_GAIN * _typical(run):
            run, last, freed = other, other_last, True
    ties = list(shown(run.structure, run.state.surfaces, last))
    designed = unopposed(given(start.structure, start.state.surfaces, last), ties, run.state.surfaces)
    free = run
    run, _ = descend(free, ties, WINDOWS[-1:], freed)
    after = run.test(settings)
    for meant in (designed, crossings(run.structure, free.state.surfaces)):
        more = [tie for tie in meant if tie not in ties]
        if not more:
            continue
        other, _ = descend(free, [*ties, *more], WINDOWS[-1:], freed)
        verdict = other.test(settings)
        if _no_worse(verdict, after):
            run, after, ties = other, verdict, [*ties, *more]
    return _Solved(run, after, ties, freed)


def _plumbed(
    run: Run, after: Acceptance, ties: Sequence[Tie], freed: bool, settings: BrepSettings
) -> tuple[Run, Acceptance, frozenset[int]]:
    """The solid, its test, and the floors that were moved to where all rays into their pits place them."""
    if after.displaced is None or _more_amiss(run, after.displaced, settings):
        return run, after, frozenset()
    floors = plumbed(run.scene, run.structure, whole_images(run.views), run.images.noise, run.state.poses)
    if not floors:
        return run, after, frozenset()
    footprint = run.views.cameras.footprint()
    places = Soundings.of(after.displaced.depths, run.structure, footprint).joined(soundings_of(floors, footprint))

    def lowered(surfaces: Sequence[Surface]) -> tuple[Surface, ...]:
        moves = {index: floor.move for index, floor in floors.items()}
        return tuple(replace(s, origin=s.origin + moves.get(index, 0.0)) for index, s in enumerate(surfaces))

    # what a floor's edges and the points said is of where it was
    prior = replace(run.prior, surfaces=lowered(run.prior.surfaces), held=run.prior.held - frozenset(floors))
    free = replace(run, prior=prior).moved(replace(run.state, surfaces=lowered(run.state.surfaces)))
    other, _ = descend(free, ties, WINDOWS[-1:], freed, places)
    verdict = other.test(settings)
    return (other, verdict, frozenset(floors)) if _no_worse(verdict, after) else (run, after, frozenset())


def _more_amiss(run: Run, displaced: Displaced, settings: BrepSettings) -> bool:
    """Whether more lies elsewhere than is accepted of faces that are no floors: where these lie does not mend it."""
    others = np.delete(displaced.areas, floors_of(run.mesh, run.structure))
    return bool(others.max(initial=0.0) > settings.accept_displaced)


def _strayed(found: _Solved) -> frozenset[int]:
    """Surfaces with places that parallax puts elsewhere."""
    if found.after.displaced is None:
        return frozenset()
    depths = found.after.displaced.depths
    faces = np.unique(depths.places[depths.off, 3])
    return frozenset(found.run.structure.faces[int(face)].surface for face in faces) - {-1}


def _less_displaced(new: Acceptance, old: Acceptance) -> bool:
    """Whether parallax places less of a solid elsewhere, and the images like it no less."""
    if new.displaced is None or old.displaced is None:
        return False
    return new.displaced.area < old.displaced.area and _no_worse(new, old)


def _no_worse(new: Acceptance, old: Acceptance) -> bool:
    """Whether the images like a solid with more relations no less."""
    return keeps(new, old) and not new.silhouette_px > old.silhouette_px + PX_NOISE


def _closer(new: Acceptance, old: Acceptance) -> bool:
    """Whether parallax places less of a solid elsewhere, and the images like it no less."""
    if new.displaced is None or old.displaced is None or new.displaced.area > old.displaced.area:
        return False
    return new.displaced.misfit < old.displaced.misfit and _no_worse(new, old)


def _typical(run: Run) -> float:
    """Median |silhouette residual| in px."""
    seen, found = run.observe(WINDOW_PX, WINDOW_PX / 2)
    outline = np.abs(residuals(seen, found, run.state.tone)[seen.kind == SILHOUETTE])
    outline = outline[np.isfinite(outline)]
    return float(np.median(outline)) if len(outline) else 0.0


def _anchored(structure: Structure, mesh: FaceMesh, surfaces: Sequence[Surface]) -> list[Surface]:
    """Every surface with its reference point beside its faces."""
    owner = np.array([f.surface for f in structure.faces], np.int64)[mesh.face]
    result = []
    for index, surface in enumerate(surfaces):
        triangles = mesh.triangles[owner == index]
        result.append(recentre(surface, mesh.vertices[np.unique(triangles)]) if len(triangles) else surface)
    return result


def _with_twins(structure: Structure, before: Sequence[Surface], run: Run) -> tuple[Surface, ...]:
    """The refined surfaces; one that no face names, since it was the same as another, follows that one."""
    used = sorted({f.surface for f in structure.faces if f.surface >= 0})
    result = list(run.state.surfaces)
    for index in sorted(set(range(len(before))) - set(used)):
        for other in used:
            points = before[other].project(run.prior.surfaces[other].origin + _PROBES)
            same = before[other].kind == before[index].kind
            if same and np.abs(before[index].signed_distance(points)).max() < _TWIN:
                agree = np.einsum("ni,ni->n", before[other].normals(points), before[index].normals(points)).sum()
                result[index] = result[other] if agree > 0 else result[other].flip()
                break
    return tuple(result)


def better(after: Acceptance, before: Acceptance) -> bool:
    """Whether the test likes the result better than the start.

    Acceptance decides. Short of it, no figure may get clearly worse: an edge that few samples show in few views may
    be drawn away from where the points had it, while the masks as a whole improve.
    """
    if before.accepted != after.accepted:
        return after.accepted
    if after.mask_iou < before.mask_iou - (_IOU_SLACK if after.accepted else 0.0):
        return False
    if not after.accepted and after.silhouette_px > _PX_SLACK * before.silhouette_px:  # NaN compares false
        return False
    return after.mask_iou > before.mask_iou or after.silhouette_px < before.silhouette_px or _closer(after, before)


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
