"""Floors that may as well lie deeper: of deep narrow holes views show the upper part of the walls only.

Silhouettes and edges do not tell where such a hole ends, nor how, and what they accept may be wrong below. So a floor
is told if views agree better about the places that they see on it than about those that they would see were it gone:
by some standard errors, however much deeper its walls go on.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.brep.refine.looks import looks
from brepgaussian.brep.refine.mesh import FaceMesh
from brepgaussian.brep.refine.observe import whole_images
from brepgaussian.brep.refine.visibility import Scene
from brepgaussian.brep.structure import CONCAVE, Structure
from brepgaussian.geometry.rows import distinct
from brepgaussian.splatting.concave.agreement import advantage
from brepgaussian.splatting.concave.radiance import differences
from brepgaussian.splatting.parallax import Looks

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_STRIDE_PX = 1  # between pixels that are asked: few show a floor that is hard to see
_PLACE_PX = 6.0  # side of a place, in footprints of a pixel; within it radiance changes linearly
_CAP = 3.0  # tolerances; greater differences count no more
_COEFFICIENTS = 4  # of a place: a grey and its gradient
_DEEPER = (0.5, 1.0, 2.0)  # radii of a circle as large as the floor
_ONE_WAY = 0.4  # of a face's area is left of the sum of its normals: 1 of a plane, .5 of half a sphere, 0 all around
_WITHIN = 0.9  # of the way to the next face behind
_SIGMAS = 3.0  # by which views agree better on the floor
_OFF = 1e-4  # unit frame; above the floor, where rays go on from
_WALL, _FLOOR = 0, 1  # places below


def untold_floors(scene: Scene, structure: Structure, views: Views) -> list[int]:
    """Faces of a solid that are floors, and of which the images do not tell that they are where they are.

    Args:
        scene: its triangulation.
        structure: its faces and edges.
        views: images and cameras.
    """
    floors = [face for face in _floors(structure) if _faces_one_way(scene.mesh, face)]
    if not floors:
        return []
    shown = whole_images(views)
    seen = looks(scene, structure, shown, np.zeros((len(views.cameras), 3)), _STRIDE_PX)
    side = _PLACE_PX * views.cameras.footprint()
    return [face for face in floors if not _is_told(_of(seen, face), scene, face, side, shown.tolerance)]


def _floors(structure: Structure) -> list[int]:
    """Faces all of whose edges are concave, one of them at least."""
    around: dict[int, set[bool]] = {}
    for edge in structure.edges:
        for face in edge.faces:
            around.setdefault(face, set()).add(edge.convexity == CONCAVE)
    return sorted(face for face, concave in around.items() if face >= 0 and concave == {True})


def _faces_one_way(mesh: FaceMesh, face: int) -> bool:
    """Whether a face looks into one direction: a neck between two shoulders has concave edges only, too."""
    _, cross = _corners(mesh, mesh.triangles[mesh.face == face])
    size = float(np.linalg.norm(cross, axis=1).sum())
    return bool(np.linalg.norm(cross.sum(axis=0)) > _ONE_WAY * size)


def _corners(mesh: FaceMesh, triangles: Indices) -> tuple[Array, Array]:
    """(T, 3) middles of triangles (T, 3), and (T, 3) normals as long as twice their areas."""
    a, b, c = (mesh.vertices[triangles[:, k]] for k in range(3))
    return (a + b + c) / 3, np.cross(b - a, c - a)


def _of(seen: Looks, face: int) -> Looks:
    mine = seen.face == face
    return Looks(seen.face[mine], seen.points[mine], seen.normals[mine], seen.directions[mine], seen.grey[mine])


def _is_told(seen: Looks, scene: Scene, face: int, side: float, tolerance: float) -> bool:
    """Whether views agree better about a floor by which rays are `seen` than if it lay deeper."""
    if not len(seen.face):
        return False
    now = _costs(seen.points, np.full(len(seen.face), _FLOOR), seen.grey, side, tolerance)
    below = (_costs(where, kind, seen.grey, side, tolerance) for where, kind in _deeper(seen, scene, face))
    return all(advantage(seen.points, side, costs, now) >= _SIGMAS for costs in below)


def _costs(points: Array, kind: Indices, grey: Array, side: float, tolerance: float) -> tuple[Array, NDArray[np.bool_]]:
    """(N,) difference of each ray from its place, in tolerances, and (N,) whether that tells any."""
    cells = np.floor(points / side).astype(np.int64)
    places = np.column_stack([cells, kind])
    cost, told = differences(places, points / side - cells - 0.5, grey, tolerance, _CAP)
    _, where, rays = distinct(places)
    count = rays[where]
    # a fit through few rays leaves less of their noise: where more places are seen, views would seem to agree better
    return cost * np.sqrt(count / np.maximum(count - _COEFFICIENTS, 1)), told


def _deeper(seen: Looks, scene: Scene, face: int) -> Iterator[tuple[Array, Indices]]:
    """(N, 3) what rays would meet if a floor lay deeper, and (N,) which kind of place; for several depths."""
    mesh = scene.mesh
    triangles = mesh.triangles[mesh.face == face]
    middles, cross = _corners(mesh, triangles)
    normal = cross.sum(axis=0) / np.linalg.norm(cross.sum(axis=0))
    radius = np.sqrt(np.linalg.norm(cross, axis=1).sum() / (2 * np.pi))
    middles = middles - _OFF * normal
    room = _WITHIN * float(scene.hit(middles, np.broadcast_to(-normal, middles.shape))[1].min())
    for depth in sorted({min(share * radius, room) for share in _DEEPER}):
        pit, walls = _pit(mesh, triangles, depth * normal)
        triangle, distance = Scene(pit).hit(seen.points - _OFF * seen.directions, seen.directions)
        met = triangle >= 0
        where = seen.points + np.where(met, distance - _OFF, 0.0)[:, None] * seen.directions
        yield where, np.where(met & (triangle >= walls), _FLOOR, _WALL)


def _pit(mesh: FaceMesh, triangles: Indices, deeper: Array) -> tuple[FaceMesh, int]:
    """A floor moved down with the walls that go on to it, and the number of triangles of these, which come first."""
    sides = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    ordered = np.sort(sides, axis=1)
    _, first, count = np.unique(ordered, axis=0, return_index=True, return_counts=True)
    start, end = sides[first[count == 1]].T
    size = len(mesh.vertices)
    walls = np.concatenate(
        [np.column_stack([start, end, start + size]), np.column_stack([end, end + size, start + size])]
    )
    every = np.concatenate([walls, triangles + size])
    return FaceMesh(
        np.concatenate([mesh.vertices, mesh.vertices - deeper]), every, np.zeros(len(every), np.int64)
    ), len(walls)
