"""All surfaces together against the images: the outer loop."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.brep.refine.accept import IOU_NOISE, PX_NOISE, WINDOW_PX, Acceptance, judge, judge_faces, watch
from brepgaussian.brep.refine.constraints import Row, Tie, tangent_rows, tie_rows
from brepgaussian.brep.refine.mesh import FaceMesh, follow, slave
from brepgaussian.brep.refine.observe import Found, Images, measure, prepare
from brepgaussian.brep.refine.parallax import Displaced, displaced
from brepgaussian.brep.refine.parameters import recentre
from brepgaussian.brep.refine.regularity import given, shown, unopposed
from brepgaussian.brep.refine.repair import doubtful_merges, merge
from brepgaussian.brep.refine.solve import TONES, Prior, State, Step, residuals, step
from brepgaussian.brep.refine.soundings import Soundings
from brepgaussian.brep.refine.visibility import SILHOUETTE, Scene, Seen, compare_masks
from brepgaussian.brep.structure import Structure
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.splatting.concave import Images as Shown

Array = NDArray[np.float64]

# Search windows (silhouettes, interior edges) in px, one iteration each; the last is repeated until it settles.
_WINDOWS = ((12.0, 6.0), (6.0, 4.0), (3.0, 3.0), (2.0, 2.0))
_MOST_LAST = 3
_WIDE_SHARE = 4  # of the observations is enough while windows are wide
_SETTLED = 1e-3  # of the prior's sigma: 3e-6 of the unit frame
_IOU_SLACK = 1e-3  # loss of IoU that no better edge makes up for
_PX_SLACK = 1.1  # by which the worst edge may lose where the masks gain: a solid with a wrong edge is refined too
_TWIN = 1e-6  # distance within which two surfaces are the same
_PROBES = 0.2 * np.random.default_rng(0).uniform(-1, 1, (12, 3))  # places where surfaces are compared
_SOUNDINGS = 8  # rounds with depths, each of which halves what is left of the error,
_STILL = 1e-4  # unit frame, a twentieth of a pixel: until no vertex moves by more
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
    report: dict[str, Any] = field(default_factory=dict)


@dataclass
class _Run:
    """The inputs and the present solid."""

    structure: Structure
    mesh: FaceMesh
    state: State
    prior: Prior
    views: Views
    images: Images
    limit: int
    _watched: dict[int, Seen] = field(default_factory=dict, init=False)  # by the limit; another run has its own

    @cached_property
    def scene(self) -> Scene:
        """The present triangulation for ray casting."""
        return Scene(self.mesh)

    def moved(self, state: State) -> "_Run":
        """With surfaces moved, and mesh and structure behind them."""
        structure = move_structure(self.structure, state.surfaces)
        return replace(self, state=state, structure=structure, mesh=follow(self.mesh, self.structure, state.surfaces))

    def observe(self, window: float, interior: float) -> tuple[Seen, Found]:
        """Measure all edges; a wide search needs fewer samples."""
        limit = self.limit if window <= _WINDOWS[-1][0] else self.limit // _WIDE_SHARE
        if limit not in self._watched:
            self._watched[limit] = watch(self.mesh, self.scene, self.structure, self.state, self.views, limit)
        seen = self._watched[limit]
        return seen, measure(self.images, seen, window, interior)

    def test(self, settings: BrepSettings) -> Acceptance:
        """The acceptance test."""
        seen, found = self.observe(WINDOW_PX, WINDOW_PX / 2)
        masks = compare_masks(self.scene, self.views.cameras, self.views.alpha, self.state.poses)
        test = judge(seen, found, self.structure, self.state.tone, masks, settings)
        return judge_faces(test, self.scene, self.structure, self.images, self.views, self.state.poses, settings)

    def displaced(self) -> Displaced:
        """What parallax places elsewhere."""
        return displaced(self.scene, self.structure, Shown.of(self.views, self.images.noise), self.state.poses)


def refine(
    structure: Structure,
    mesh: FaceMesh,
    surfaces: Sequence[Surface],
    views: Views,
    settings: BrepSettings,
) -> RefineResult:
    """Refine all surfaces of a solid together, its topology kept.

    If the images refuse the result, faces at bad edges are tried as pieces of their neighbours' surfaces.

    Args:
        structure: edges, faces and vertices of the solid by surface (`brep.structure.extract`).
        mesh: triangulation of the same solid (`mesh.from_solid`).
        surfaces: the surfaces that `structure` names; a surface that no face uses stays as it is.
        views: images and cameras.
        settings: prior, limits, switches.

    Returns:
        The refined surfaces with the acceptance test; never worse than the start by that test.
    """
    first = _refine(structure, mesh, surfaces, views, settings)
    if first.accepted:
        return first
    limit = settings.accept_silhouette_px
    merges = doubtful_merges(first.structure, first.mesh, first.surfaces, first.acceptance, limit)
    if not merges:
        return first
    merged = move_structure(merge(structure, merges), surfaces)
    second = _refine(merged, follow(mesh, merged, surfaces), surfaces, views, settings)
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
    structure: Structure, mesh: FaceMesh, surfaces: Sequence[Surface], views: Views, settings: BrepSettings
) -> RefineResult:
    """The refinement of one structure."""
    clock = time.perf_counter()
    anchored = tuple(_anchored(structure, mesh, surfaces))
    prior = Prior(anchored, np.radians(settings.refine_angle_deg), settings.refine_length)
    state = State(anchored, np.zeros(TONES), np.zeros((len(views.cameras), 3)))
    start = _Run(structure, mesh, state, prior, views, prepare(views), settings.refine_observations)
    before = start.test(settings)
    run, last = _descend(start, [], _WINDOWS, False)
    freed = False
    if settings.refine_poses and _typical(run) > _POSE_PX:
        other, other_last = _descend(run, [], _WINDOWS[1:], True)
        if _typical(other) < _POSE_GAIN * _typical(run):
            run, last, freed = other, other_last, True
    ties = shown(run.structure, run.state.surfaces, last)
    designed = unopposed(given(start.structure, anchored, last), ties, run.state.surfaces)
    free = run
    run, _ = _descend(free, ties, _WINDOWS[-1:], freed)
    after = run.test(settings)
    if designed:
        other, _ = _descend(free, [*ties, *designed], _WINDOWS[-1:], freed)
        verdict = other.test(settings)
        if _no_worse(verdict, after):
            run, after, ties = other, verdict, [*ties, *designed]
    run, after = _sounded(run, after, ties, freed, settings)
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
        "largest_move": _largest_move(start.mesh, result.mesh),
        "image_noise": start.images.noise,
        "edges": verdict.edges,
        "faces": verdict.faces,
    }
    return RefineResult(
        surfaces=_with_twins(structure, surfaces, result) if kept else tuple(surfaces),
        silhouette_px=verdict.silhouette_px,
        mask_iou=verdict.mask_iou,
        accepted=verdict.accepted,
        mesh=result.mesh,
        structure=result.structure,
        acceptance=verdict,
        before=before,
        poses=result.state.poses,
        tone=result.state.tone,
        report=report,
    )


def _no_worse(new: Acceptance, old: Acceptance) -> bool:
    """Whether the images like a solid with more relations no less."""
    if old.accepted and not new.accepted:
        return False
    worse = new.silhouette_px > old.silhouette_px + PX_NOISE
    return not worse and new.mask_iou > old.mask_iou - IOU_NOISE


def _sounded(
    run: _Run, test: Acceptance, ties: Sequence[Tie], free_poses: bool, settings: BrepSettings
) -> tuple[_Run, Acceptance]:
    """The solid with its surfaces also through the places whose depth parallax tells, and its test, if that is better.

    Greys are linear in a surface's error only nearly: depths are told again until nothing moves.
    """
    found, now = test.displaced, run
    if test.accepted or found is None:
        return run, test
    for _ in range(_SOUNDINGS):
        places = Soundings.of(found.depths, now.structure, now.views.cameras.footprint())
        before = now
        now, _ = _descend(now, ties, _WINDOWS[-1:], free_poses, places)
        found = now.displaced()
        if _largest_move(before.mesh, now.mesh) < _STILL:
            break
    verdict = now.test(settings)
    closer = verdict.displaced is not None and verdict.displaced.area < test.displaced.area
    return (now, verdict) if closer and _no_worse(verdict, test) else (run, test)


def _descend(
    run: _Run,
    ties: Sequence[Tie],
    windows: Sequence[tuple[float, float]],
    free_poses: bool,
    soundings: Soundings | None = None,
) -> tuple[_Run, Step]:
    """Iterate over the search windows, the last one until the step is small."""
    schedule = [*windows, *([windows[-1]] * _MOST_LAST)]
    for number, (window, interior) in enumerate(schedule):
        seen, found = run.observe(window, interior)
        rows: list[Row] = [*tangent_rows(run.structure, run.state.surfaces), *tie_rows(ties, run.state.surfaces)]
        result = step(run.state, run.prior, seen, found, run.structure, run.views.cameras, rows, free_poses, soundings)
        run = run.moved(result.state)
        if number >= len(windows) and result.largest < _SETTLED:
            break
    return run, result


def _typical(run: _Run) -> float:
    """Median |silhouette residual| in px."""
    seen, found = run.observe(WINDOW_PX, WINDOW_PX / 2)
    outline = np.abs(residuals(seen, found, run.state.tone)[seen.kind == SILHOUETTE])
    outline = outline[np.isfinite(outline)]
    return float(np.median(outline)) if len(outline) else 0.0


def move_structure(structure: Structure, surfaces: Sequence[Surface]) -> Structure:
    """Edges' polylines and vertices onto moved surfaces."""
    lines = [(e.polyline, sorted({s for s in e.surfaces if s >= 0})) for e in structure.edges]
    corners = [(v.point[None], [s for s in v.surfaces if s >= 0]) for v in structure.vertices]
    moved = _slaved([*lines, *corners], surfaces)
    edges = tuple(replace(e, polyline=p) for e, p in zip(structure.edges, moved, strict=False))
    points = moved[len(edges) :]
    vertices = tuple(replace(v, point=p[0]) for v, p in zip(structure.vertices, points, strict=True))
    return replace(structure, edges=edges, vertices=vertices)


def _slaved(parts: Sequence[tuple[Array, list[int]]], surfaces: Sequence[Surface]) -> list[Array]:
    """Each (N, 3) array of points onto the surfaces named with it; those with as many surfaces in one go."""
    result = [points for points, _ in parts]
    for width in {len(known) for _, known in parts} - {0}:
        chosen = [i for i, (_, known) in enumerate(parts) if len(known) == width]
        counts = [len(parts[i][0]) for i in chosen]
        table = np.repeat(np.array([parts[i][1] for i in chosen], np.int64), counts, axis=0)
        moved = slave(np.concatenate([parts[i][0] for i in chosen]), table, surfaces)
        for i, points in zip(chosen, np.split(moved, np.cumsum(counts)[:-1]), strict=True):
            result[i] = points
    return result


def _anchored(structure: Structure, mesh: FaceMesh, surfaces: Sequence[Surface]) -> list[Surface]:
    """Every surface with its reference point beside its faces."""
    owner = np.array([f.surface for f in structure.faces], np.int64)[mesh.face]
    result = []
    for index, surface in enumerate(surfaces):
        triangles = mesh.triangles[owner == index]
        result.append(recentre(surface, mesh.vertices[np.unique(triangles)]) if len(triangles) else surface)
    return result


def _with_twins(structure: Structure, before: Sequence[Surface], run: _Run) -> tuple[Surface, ...]:
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
    return after.mask_iou > before.mask_iou or after.silhouette_px < before.silhouette_px


def _largest_move(before: FaceMesh, after: FaceMesh) -> float:
    return float(np.linalg.norm(after.vertices - before.vertices, axis=1).max(initial=0.0))


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
