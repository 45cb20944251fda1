"""Pits: a floor and the walls around it, and how well views agree about both were it deeper or less deep.

The walls are exact where a solid has been refined, so each ray that looks into a pit tells of one place on a wall or on
the floor, whatever the depth of that is: at the right one, the rays of a place have one radiance.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import OPAQUE
from brepgaussian.brep.refine.mesh import FaceMesh
from brepgaussian.brep.refine.visibility import Scene, look
from brepgaussian.brep.structure import CONCAVE, Structure
from brepgaussian.geometry.rows import distinct
from brepgaussian.splatting.concave import Images as Shown
from brepgaussian.splatting.concave.agreement import advantage
from brepgaussian.splatting.concave.radiance import differences
from brepgaussian.splatting.concave.shapes import Costs

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_PLACE_PX = 4.0  # side of a place, in footprints of a pixel; within it radiance changes linearly
_PHASES = (0.0, 0.25, 0.5, 0.75)  # sides: where places begin is chance
_ROUNDING = 0.3  # grey levels: standard deviation of what 8 bits leave
_CAP = 3.0  # standard deviations of the noise: what differs by more is another surface's
_FAR = 9.0
_STIFFNESS = 3.6  # rays: a gradient is half free in a place of so many, for it is held to be small
_NORMAL_BINS = 2.0  # walls that meet at an edge are different places
_ONE_WAY = 0.4  # of a face's area is left of the sum of its normals: 1 of a plane, .5 of half a sphere, 0 all around
_WITHIN = 0.9  # of the way to the next face behind
_OFF = 1e-4  # unit frame; above the floor, where rays go on from
_BESIDE = 2.0  # places of wall above the highest floor, for comparison


@dataclass(frozen=True)
class Pit:
    """Rays that look into a pit.

    Attributes:
        origin, direction: (N, 3), unit directions; grey: (N,) levels that the images show there.
        wall: (N,) distance at which each meets the walls, which go on below the floor; inf = nowhere.
        facing: (N, 3) its direction there, in coarse bins.
        at: (N, 3) what each meets with the floor where it is: rays near each other err alike.
        floor: the floor's triangles; normal: (3,) unit, mean of its own; radius: of a circle as large.
        room: depth below the floor down to which the solid reaches.
        footprint: of a pixel, unit frame; noise: standard deviation of a grey level.
    """

    origin: Array
    direction: Array
    grey: Array
    wall: Array
    facing: Indices
    at: Array
    floor: FaceMesh
    normal: Array
    radius: float
    room: float
    footprint: float
    noise: float

    @cached_property
    def _scene(self) -> Scene:
        return Scene(self.floor)

    def costs(self, deeper: float) -> Costs:
        """Were the floor `deeper` by some length: what the images say against that.

        Returns:
            (N,) square of a ray's difference from its place, in standard deviations and capped, scaled by what a fit to
            few rays leaves of it; (N,) whether that tells any.
        """
        triangle, distance = self._scene.hit(self.origin + deeper * self.normal, self.direction)
        distance = np.where(triangle >= 0, distance, np.inf)
        on = distance <= self.wall
        distance = np.where(on, distance, self.wall)
        met = np.isfinite(distance)
        points = (self.origin + np.where(met, distance, 0.0)[:, None] * self.direction) / (_PLACE_PX * self.footprint)
        kind = np.column_stack([on, np.where(on[:, None], 0, self.facing)])
        costs, told = zip(*(self._costs(points + phase, kind) for phase in _PHASES), strict=True)
        return np.where(met, np.mean(costs, axis=0), _CAP**2), np.all(told, axis=0) & met

    def _costs(self, points: Array, kind: Indices) -> Costs:
        """The same of places on a surface, in sides of a place."""
        cells = np.floor(points).astype(np.int64)
        places = np.column_stack([cells, kind])
        difference, told = differences(places, points - cells - 0.5, self.grey, self.noise, _FAR)
        _, where, rays = distinct(places)
        left = 1 - (1 + 2 * rays / (rays + _STIFFNESS)) / rays
        return np.minimum(difference / np.sqrt(np.maximum(left, 0.1))[where], _CAP) ** 2, told

    @property
    def height(self) -> float:
        """By how much its walls are seen above its floor, unit frame."""
        over = self.at @ self.normal
        return float(np.ptp(over)) if len(over) else 0.0

    def advantage(self, before: Costs, after: Costs) -> float:
        """By how many standard errors rays that both tell of disagree less on the other."""
        return advantage(self.at, _PLACE_PX * self.footprint, before, after)


def floors(mesh: FaceMesh, structure: Structure) -> list[int]:
    """Faces all of whose edges are concave, one of them at least, and which look into one direction.

    A neck between two shoulders has concave edges only, too.
    """
    around: dict[int, set[bool]] = {}
    for edge in structure.edges:
        for face in edge.faces:
            around.setdefault(face, set()).add(edge.convexity == CONCAVE)
    return sorted(f for f, concave in around.items() if f >= 0 and concave == {True} and _faces_one_way(mesh, f))


def pit_of(
    scene: Scene,
    structure: Structure,
    shown: Shown,
    noise: float,
    poses: Array,
    face: int,
    reach_px: float,
    whole: bool = False,
) -> Pit:
    """The pit whose floor is a face of a solid.

    Args:
        scene: its triangulation; structure: its faces and edges.
        shown: views and their greys; noise: of these, grey levels; poses: (V, 3) image corrections.
        reach_px: by how much higher its floor may be asked for, in footprints; deeper it is by two radii at most.
        whole: whether it may be asked for all the way up.
    """
    mesh, cameras = scene.mesh, shown.views.cameras
    triangles = mesh.triangles[mesh.face == face]
    middles, cross = _corners(mesh, triangles)
    normal = cross.sum(axis=0) / np.linalg.norm(cross.sum(axis=0))
    radius = float(np.sqrt(np.linalg.norm(cross, axis=1).sum() / (2 * np.pi)))
    walls = {other for edge in structure.edges if face in edge.faces for other in edge.faces} - {face, -1}
    view, row, column = _pixels(shown, mesh, [face, *sorted(walls)])
    centers, directions = look(cameras, view, np.column_stack([column, row]).astype(np.float64) + 0.5, poses)
    triangle, distance = scene.hit(centers, directions)
    hit = np.where(triangle >= 0, mesh.face[triangle], -1)
    points = centers + np.where(triangle >= 0, distance, 0.0)[:, None] * directions
    height = (points - middles[np.argmax(middles @ normal)]) @ normal
    near = whole | (height < (reach_px + _BESIDE * _PLACE_PX) * cameras.footprint())
    kept = np.flatnonzero((hit == face) | (np.isin(hit, sorted(walls)) & near))
    below = Scene(_walls_below(mesh, triangles, max(2 * radius, reach_px * cameras.footprint()) * normal))
    on = hit[kept] == face
    onward, further = below.hit(points[kept] - _OFF * directions[kept], directions[kept])
    further = np.where(onward >= 0, further - _OFF, np.inf)
    facing = np.where(on[:, None], below.normals[onward], scene.normals[triangle[kept]])
    middles = middles - _OFF * normal
    return Pit(
        centers[kept], directions[kept],
        shown.luminance[view[kept], row[kept], column[kept]].astype(float),
        distance[kept] + np.where(on, further, 0.0),
        np.round(facing * _NORMAL_BINS).astype(np.int64),
        points[kept],
        FaceMesh(mesh.vertices, triangles, np.zeros(len(triangles), np.int64)), normal, radius,
        _WITHIN * float(scene.hit(middles, np.broadcast_to(-normal, middles.shape))[1].min()),
        cameras.footprint(), max(noise, _ROUNDING),
    )  # fmt: skip


def _pixels(shown: Shown, mesh: FaceMesh, faces: list[int]) -> tuple[Indices, Indices, Indices]:
    """(N,) views, rows and columns of all pixels of the object in boxes around some faces."""
    cameras, found = shown.views.cameras, []
    corners = mesh.vertices[np.unique(mesh.triangles[np.isin(mesh.face, faces)])]
    size = [cameras.width, cameras.height]
    for view in range(len(cameras)):
        pixels, _ = cameras.project(view, corners)
        low, high = (np.clip(np.nan_to_num(a), 0, size).astype(int) for a in (pixels.min(axis=0), pixels.max(axis=0)))
        rows, columns = np.nonzero(shown.views.alpha[view, low[1] : high[1], low[0] : high[0]] > OPAQUE)
        found.append(np.column_stack([np.full(len(rows), view), low[1] + rows, low[0] + columns]))
    view, row, column = np.concatenate(found).T
    return view, row, column


def _faces_one_way(mesh: FaceMesh, face: int) -> bool:
    _, cross = _corners(mesh, mesh.triangles[mesh.face == face])
    size = float(np.linalg.norm(cross, axis=1).sum())
    return bool(np.linalg.norm(cross.sum(axis=0)) > _ONE_WAY * size)


def _corners(mesh: FaceMesh, triangles: Indices) -> tuple[Array, Array]:
    """(T, 3) middles of triangles (T, 3), and (T, 3) normals as long as twice their areas."""
    a, b, c = (mesh.vertices[triangles[:, k]] for k in range(3))
    return (a + b + c) / 3, np.cross(b - a, c - a)


def _walls_below(mesh: FaceMesh, triangles: Indices, deeper: Array) -> FaceMesh:
    """The walls that go on from the border of a floor's triangles, by a vector that points up."""
    sides = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    _, first, count = np.unique(np.sort(sides, axis=1), axis=0, return_index=True, return_counts=True)
    start, end = sides[first[count == 1]].T
    size = len(mesh.vertices)
    walls = [np.column_stack([start, end, start + size]), np.column_stack([end, end + size, start + size])]
    every = np.concatenate(walls)
    return FaceMesh(np.concatenate([mesh.vertices, mesh.vertices - deeper]), every, np.zeros(len(every), np.int64))
