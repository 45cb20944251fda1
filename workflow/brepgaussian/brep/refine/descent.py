"""The present solid under refinement, and its descent: measure all edges, move all surfaces, and again."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.brep.refine.accept import WINDOW_PX, Acceptance, judge, judge_faces, watch
from brepgaussian.brep.refine.constraints import Row, Tie, tie_rows
from brepgaussian.brep.refine.mesh import FaceMesh, follow, slave
from brepgaussian.brep.refine.observe import Found, Images, measure, whole_images
from brepgaussian.brep.refine.parallax import Displaced, displaced
from brepgaussian.brep.refine.samples import followed
from brepgaussian.brep.refine.solve import Prior, State, Step, step
from brepgaussian.brep.refine.soundings import Soundings
from brepgaussian.brep.refine.tangency import tangent_rows
from brepgaussian.brep.refine.visibility import Scene, Seen, compare_masks
from brepgaussian.brep.structure import Structure
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.settings.brep import BrepSettings

Array = NDArray[np.float64]

# Search windows (silhouettes, interior edges) in px, one iteration each; the last is repeated until it settles.
WINDOWS = ((12.0, 6.0), (6.0, 4.0), (3.0, 3.0), (2.0, 2.0))
_MOST_LAST = 3
_WIDE_SHARE = 4  # of the observations is enough while windows are wide
_SETTLED = 1e-3  # of the prior's sigma: 3e-6 of the unit frame
_SOUNDINGS = 8  # rounds with depths, each of which halves what is left of the error,
_STILL = 1e-4  # unit frame, a twentieth of a pixel: until no vertex moves by more
_SETTLING = 0.9  # of a round's largest move is that of the next, or there is more amiss than depths
_SAME_PX = 0.05  # by which the triangulation is off anyway: edges that moved by less are as visible as they were


@dataclass(frozen=True)
class _Watched:
    """Usable observations `seen` of a solid, and with which mesh and poses of the cameras they were told usable."""

    seen: Seen
    mesh: FaceMesh
    poses: Array

    def is_near(self, mesh: FaceMesh, poses: Array, least: float) -> bool:
        """Whether nothing has moved since by as much as a `least` distance, unit frame."""
        return np.array_equal(self.poses, poses) and largest_move(self.mesh, mesh) < least


@dataclass
class Run:
    """The inputs and the present solid."""

    structure: Structure
    mesh: FaceMesh
    state: State
    prior: Prior
    views: Views
    images: Images
    limit: int
    _seen: dict[int, Seen] = field(default_factory=dict, init=False)  # by the limit; another run has its own
    _watched: dict[int, _Watched] = field(default_factory=dict, init=False)  # the same, of solids before this one

    @cached_property
    def scene(self) -> Scene:
        """The present triangulation for ray casting."""
        return Scene(self.mesh)

    def moved(self, state: State) -> "Run":
        """With surfaces moved, and mesh and structure behind them."""
        structure = move_structure(self.structure, state.surfaces)
        run = replace(self, state=state, structure=structure, mesh=follow(self.mesh, self.structure, state.surfaces))
        run._watched = dict(self._watched)
        return run

    def observe(self, window: float, interior: float) -> tuple[Seen, Found]:
        """Measure all edges; a wide search needs fewer samples."""
        limit = self.limit if window <= WINDOWS[-1][0] else self.limit // _WIDE_SHARE
        if limit not in self._seen:
            self._seen[limit] = self._watch(limit)
        seen = self._seen[limit]
        return seen, measure(self.images, seen, window, interior)

    def _watch(self, limit: int) -> Seen:
        """All usable observations: those of a solid before, where nothing has moved since that could hide others."""
        known, poses, least = self._watched.get(limit), self.state.poses, _SAME_PX * self.views.cameras.footprint()
        if known is not None and known.is_near(self.mesh, poses, least):
            rows, rays = followed(known.seen.rays, self.state.surfaces, self.views.cameras, poses)
            return Seen(rays, known.seen.kind[rows])
        seen = watch(self.mesh, self.scene, self.structure, self.state, self.views, limit)
        self._watched[limit] = _Watched(seen, self.mesh, poses)
        return seen

    def outlined(self, settings: BrepSettings) -> Acceptance:
        """The part of the acceptance test that is about edges and silhouettes."""
        seen, found = self.observe(WINDOW_PX, WINDOW_PX / 2)
        masks = compare_masks(self.scene, self.views.cameras, self.views.alpha, self.state.poses)
        return judge(seen, found, self.structure, self.state.tone, masks, settings)

    def test(self, settings: BrepSettings) -> Acceptance:
        """The acceptance test."""
        test = self.outlined(settings)
        return judge_faces(test, self.scene, self.structure, self.views, self.state.poses, settings)

    def displaced(self) -> Displaced:
        """What parallax places elsewhere."""
        return displaced(self.scene, self.structure, whole_images(self.views), self.state.poses)


def descend(
    run: Run,
    ties: Sequence[Tie],
    windows: Sequence[tuple[float, float]],
    free_poses: bool,
    soundings: Soundings | None = None,
) -> tuple[Run, Step]:
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


def sounded(run: Run, found: Displaced, ties: Sequence[Tie], free_poses: bool) -> Run:
    """The solid with its surfaces also through the places whose depth parallax tells.

    Greys are linear in a surface's error only nearly: depths are told again until nothing moves, or moves do not
    shrink: what no depth of its faces explains has another shape.
    """
    last = np.inf
    for _ in range(_SOUNDINGS):
        places = Soundings.of(found.depths, run.structure, run.views.cameras.footprint())
        before = run
        run, _ = descend(run, ties, WINDOWS[-1:], free_poses, places)
        move = largest_move(before.mesh, run.mesh)
        if move < _STILL or move > _SETTLING * last:
            break
        last, found = move, run.displaced()
    return run


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


def largest_move(before: FaceMesh, after: FaceMesh) -> float:
    """How far the farthest vertex of a triangulation moved, unit frame."""
    return float(np.linalg.norm(after.vertices - before.vertices, axis=1).max(initial=0.0))
