"""The 3D edge cloud: sub-pixel edges of the images, triangulated over all views that see them.

Each edge of an image starts a point on the opened hull. The point then moves to where the nearest edges of all
views that see it agree; it stays if enough of them do, and if they look at it from different sides. The contour of a
smooth surface is an edge of every image but lies elsewhere in each: it finds no agreement.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.evidence.edgels import Edgels, find_edgels

Array = NDArray[np.float64]

_LEAST_SLOPE = 0.8  # grey levels per px: a step of two levels; rounding makes slopes of .4
_SIGMAS = 4.0  # of the noise of a slope
_SLOPE_NOISE = 0.2  # of a derivative of Gaussian of 1 px, of the image's noise
_STARTS = 24_000
_BESIDE_PX = 2.5  # to both sides of an edge; its surfaces are there, on the edge itself a silhouette is missed
_REACHES_PX = (4.0, 3.0, 2.0, 1.0, 1.0)  # how far edges may be, round by round
_INLIER_PX = 0.6
_LEAST_VIEWS = 4
_LEAST_SHARE = 0.75  # of the views that see it; an edge may be faint in some
_LEAST_SPREAD = 0.02  # second to largest eigenvalue: views from one side do not tell depth
_STAY = 1e-3  # weight that keeps a point where it is along the edge
_HIDDEN = 0.012  # unit frame; an edge is seen past the hull's own roughness by this much
APART = 0.0015  # unit frame; closer points are one
_ALIKE = 0.6  # cosine between an image edge's normal and the projected edge's
_LOOKING = 2  # views that see an edge of the geometry, which no image has to show
_KNOWN = 0.004  # unit frame; edges of the images nearer than this are better


@dataclass(frozen=True)
class EdgeCloud:
    """Points on sharp edges.

    Attributes:
        points: (K, 3) float32; directions: (K, 3) float32 unit tangents.
        views: (K,) int16 number of views that confirm each.
    """

    points: NDArray[np.float32]
    directions: NDArray[np.float32]
    views: NDArray[np.int16]

    def completed(self, cameras: Cameras, scene: Scene, points: Array, directions: Array) -> "EdgeCloud":
        """With edges of the geometry, points (N, 3) and tangents (N, 3), where it has none and two views or more look.

        Args:
            cameras: of all views.
            scene: the opened hull, which hides edges.
            points: on the edges; directions: unit.
        """
        from scipy.spatial import cKDTree

        count = visible(cameras, points, scene).sum(axis=0)
        kept = count >= _LOOKING
        if len(self.points):
            kept &= cKDTree(self.points).query(points)[0] > _KNOWN
        return EdgeCloud(
            np.concatenate([self.points, points[kept].astype(np.float32)]),
            np.concatenate([self.directions, directions[kept].astype(np.float32)]),
            np.concatenate([self.views, count[kept].astype(np.int16)]),
        )


def edge_cloud(views: Views, scene: Scene, noise: float, seed: int = 0) -> EdgeCloud:
    """Triangulate the edges of all images.

    Args:
        views: images and cameras.
        scene: the opened hull, to start from and to tell which views see a point.
        noise: standard deviation of the images' noise, grey levels.
        seed: of the choice among the images' edges.
    """
    least = max(_LEAST_SLOPE, _SIGMAS * _SLOPE_NOISE * noise)
    luminance = views.luminance
    edgels = [find_edgels(luminance[view], alpha, least) for view, alpha in enumerate(views.alpha)]
    points = _starts(views.cameras, edgels, scene, seed)
    if not len(points):
        return EdgeCloud(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32), np.zeros(0, np.int16))
    seen = visible(views.cameras, points, scene)
    tangent = None
    for reach in _REACHES_PX:
        points, tangent, _ = _adjust(views.cameras, edgels, points, seen, reach, tangent)
    _, direction, (count, share, spread) = _adjust(views.cameras, edgels, points, seen, _INLIER_PX, tangent)
    good = np.flatnonzero((count >= _LEAST_VIEWS) & (share >= _LEAST_SHARE) & (spread >= _LEAST_SPREAD))
    kept = good[_thin(points[good], count[good])]
    return EdgeCloud(points[kept].astype(np.float32), direction[kept].astype(np.float32), count[kept].astype(np.int16))


def _starts(cameras: Cameras, edgels: list[Edgels], scene: Scene, seed: int) -> Array:
    """(N, 3) points on the hull beside edges of the images."""
    total = sum(len(e.points) for e in edgels)
    rng = np.random.default_rng(seed)
    found = []
    for view, edges in enumerate(edgels):
        chosen = rng.random(len(edges.points)) < _STARTS / max(2 * total, 1)
        points, normals = edges.points[chosen], edges.normals[chosen]
        center, on_edge = cameras.rays(view, points)
        for side in (-_BESIDE_PX, _BESIDE_PX):
            _, ray = cameras.rays(view, points + side * normals)
            distance, _ = scene.hits(np.broadcast_to(center, ray.shape), ray)
            met = np.isfinite(distance)
            found.append(center + distance[met, None] * on_edge[met])
    return np.concatenate(found)


def visible(cameras: Cameras, points: Array, scene: Scene) -> NDArray[np.bool_]:
    """(V, N) whether each view sees points near the hull's surface."""
    seen = np.zeros((len(cameras), len(points)), bool)
    for view, center in enumerate(cameras.centers):
        ray = points - center
        length = np.linalg.norm(ray, axis=1)
        distance, _ = scene.hits(np.broadcast_to(center, ray.shape), ray / length[:, None])
        seen[view] = distance > length - _HIDDEN
    return seen


def _adjust(
    cameras: Cameras,
    edgels: list[Edgels],
    points: Array,
    seen: NDArray[np.bool_],
    reach: float,
    tangent: Array | None,
) -> tuple[Array, Array, tuple[NDArray[np.int64], Array, Array]]:
    """One step of least squares towards the nearest edges.

    Returns:
        The moved points (N, 3); tangents (N, 3); and the views whose edge is within reach, their share of those
        that see the point, and the spread of their directions, each (N,).
    """
    matrix, side = np.zeros((len(points), 3, 3)), np.zeros((len(points), 3))
    count, looked = np.zeros(len(points), np.int64), np.zeros(len(points), np.int64)
    for view, edges in enumerate(edgels):
        index = np.flatnonzero(seen[view])
        looked[index] += 1
        if not len(edges.points) or not len(index):
            continue
        pixels, depth = cameras.project(view, points[index])
        nearest = edges.lookup(pixels)
        normal = edges.normals[nearest]
        offset = np.einsum("ni,ni->n", edges.points[nearest] - pixels, normal)
        away = np.linalg.norm(edges.points[nearest] - pixels, axis=1)
        jacobian = _jacobian(cameras, view, points[index], depth)  # (n, 2, 3)
        row = np.einsum("ni,nij->nj", normal, jacobian)
        near = (np.abs(offset) < reach) & (away < reach + 1)
        if tangent is not None:
            shown = np.einsum("nij,nj->ni", jacobian, tangent[index])
            along = np.abs(np.einsum("ni,ni->n", shown, normal)) / np.maximum(np.linalg.norm(shown, axis=1), 1e-9)
            near &= along < np.sqrt(1 - _ALIKE**2)
        weight = np.where(near, (1 - (offset / reach) ** 2) ** 2, 0.0)
        matrix[index] += weight[:, None, None] * row[:, :, None] * row[:, None, :]
        side[index] += (weight * offset)[:, None] * row
        count[index] += near
    values, vectors = np.linalg.eigh(matrix)
    largest = np.maximum(values[:, 2], 1e-9)
    matrix += _STAY * largest[:, None, None] * np.eye(3)
    moved = points + np.linalg.solve(matrix, side[..., None])[..., 0]
    return moved, vectors[:, :, 0], (count, count / np.maximum(looked, 1), values[:, 1] / largest)


def _jacobian(cameras: Cameras, view: int, points: Array, depth: Array) -> Array:
    """(N, 2, 3) change of the pixel with the point."""
    rotation, translation = cameras.cam_from_unit[view, :3, :3], cameras.cam_from_unit[view, :3, 3]
    local = points @ rotation.T + translation
    fx, fy = cameras.intrinsics[view, :2]
    x = fx * (rotation[0] - (local[:, 0] / depth)[:, None] * rotation[2]) / depth[:, None]
    y = fy * (rotation[1] - (local[:, 1] / depth)[:, None] * rotation[2]) / depth[:, None]
    return np.stack([x, y], axis=1)


def _thin(points: Array, count: NDArray[np.int64]) -> NDArray[np.int64]:
    """Indices of points, one a cell, that which most views confirm."""
    order = np.argsort(-count, kind="stable")
    return np.sort(order[one_a_cell(points[order], APART)])


def one_a_cell(points: Array, cell: float) -> NDArray[np.int64]:
    """Indices of the first of the points (N, 3) in each cell of a grid, in their order."""
    _, first = np.unique(np.floor(points / cell).astype(np.int64), axis=0, return_index=True)
    return np.sort(first)
