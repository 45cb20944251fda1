"""A prior for machined parts: neighbouring surfels of one colour lie on one smooth surface, inside the hull.

A visual hull is an outer bound: it touches the part along contours and bulges away between them, like a tent.
So each surfel is moved onto a quadric that is fitted to the heights and normals of its neighbours, near and far,
where heights below count more than heights above (an expectile): bulges sink, contours stay. A quadric follows
the curvature of cylinders, cones and spheres, so that it does not shrink them. Neighbours of another colour or
direction do not count: radiance is fixed on the surface, a step in it is an edge.
"""

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.library import Floats

Array = NDArray[np.float64]

_PER_RING = 8  # neighbours at each distance
_RINGS = (3.0, 6.0)  # distances beyond the nearest ones, in spacings
_REWEIGHTINGS = 3  # of the asymmetric fit
_MIN_SUPPORT = 8.0  # summed neighbour weight below which a surfel stays where it is
_RIDGE = 1e-4  # keeps lone neighbourhoods solvable
_LIMIT = 1.0  # largest move in one sweep, in spacings


def settle(
    centers: Floats,
    normals: Floats,
    colors: Floats,
    *,
    sweeps: int,
    below: float,
    color_scale: float,
    angle_scale_deg: float,
) -> tuple[Floats, Floats]:
    """Move surfels onto the smooth surfaces that their neighbours agree on.

    Args:
        centers: (N, 3) positions, unit frame.
        normals: (N, 3) outward unit normals.
        colors: (N, C) colours in 0..1.
        sweeps: how often all surfels move at once.
        below: weight of a neighbour below the fit; one above it has 1 - below (0.5: least squares).
        color_scale: colour difference at which a neighbour's weight falls to 1/e.
        angle_scale_deg: angle between normals at which it does.

    Returns:
        New (N, 3) centers and (N, 3) normals.
    """
    points, directions = centers.astype(np.float64), normals.astype(np.float64)
    angle_scale = np.radians(angle_scale_deg)
    for _ in range(sweeps):
        near, spacing = _neighbours(points, directions)
        reach = _RINGS[-1] * spacing
        u, v = tangents(directions)
        frame = np.stack([u, v, directions], axis=2)  # (N, 3, 3) columns u, v, n
        local = (points[near] - points[:, None]) @ frame / reach  # (N, K, 3)
        other = directions[near] @ frame  # neighbours' normals in the frame
        angle = np.arccos(np.clip(other[..., 2], -1, 1))
        step = np.abs(colors[near] - colors[:, None]).max(axis=2)
        weights = np.exp(-((step / color_scale) ** 2) - (angle / angle_scale) ** 2)
        fit = _fit(local, other, weights, below)
        fit[weights.sum(axis=1) < _MIN_SUPPORT] = 0
        move = np.clip(fit[:, :1] * reach, -_LIMIT * spacing, _LIMIT * spacing)
        points = points + move * directions
        directions = directions - fit[:, 1:2] * u - fit[:, 2:3] * v
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return points.astype(np.float32), directions.astype(np.float32)


def _fit(local: Array, other: Array, weights: Array, below: float) -> Array:
    """(N, 3) height and slopes at the origin of the quadric through neighbours' heights and slopes."""
    x, y, z = np.moveaxis(local, 2, 0)
    one, zero = np.ones_like(x), np.zeros_like(x)
    heights = np.stack([one, x, y, x * x / 2, x * y, y * y / 2], axis=2)  # (N, K, 6)
    steep = np.maximum(other[..., 2], 0.2)  # neighbours turned further have no weight anyway
    rows = np.concatenate(
        [np.stack([zero, one, zero, x, y, zero], axis=2), np.stack([zero, zero, one, zero, x, y], axis=2)], axis=1
    )
    slopes = np.concatenate([-other[..., 0] / steep, -other[..., 1] / steep], axis=1)  # (N, 2K)
    weighted = np.concatenate([weights, weights], axis=1)[..., None] * rows
    slope_matrix = np.matmul(weighted.transpose(0, 2, 1), rows)
    slope_side = np.matmul(weighted.transpose(0, 2, 1), slopes[..., None])
    slope_matrix[:, np.arange(6), np.arange(6)] += _RIDGE
    result = np.zeros((len(x), 6))
    for _ in range(_REWEIGHTINGS):
        residual = z - np.matmul(heights, result[..., None])[..., 0]
        weighted = (2 * weights * np.where(residual < 0, below, 1 - below))[..., None] * heights
        matrix = slope_matrix + np.matmul(weighted.transpose(0, 2, 1), heights)
        side = slope_side + np.matmul(weighted.transpose(0, 2, 1), z[..., None])
        result = np.linalg.solve(matrix, side)[..., 0]
    return result[:, :3]


def _neighbours(points: Array, normals: Array) -> tuple[NDArray[np.intp], float]:
    """(N, K) indices: itself, the nearest ones, and rings of farther ones; and the spacing of the surfels."""
    from scipy.spatial import cKDTree

    tree = cKDTree(points)
    distance, nearest = tree.query(points, min(_PER_RING + 1, len(points)))
    spacing = float(np.median(distance[:, 1]))
    u, v = tangents(normals)
    found = [nearest]
    for ring, radius in enumerate(_RINGS):
        angles = 2 * np.pi * (np.arange(_PER_RING) + ring / len(_RINGS)) / _PER_RING
        offsets = np.cos(angles)[:, None, None] * u + np.sin(angles)[:, None, None] * v
        places = points + radius * spacing * offsets  # (ring, N, 3)
        found.append(tree.query(places.reshape(-1, 3))[1].reshape(_PER_RING, -1).T)
    return np.concatenate(found, axis=1), spacing


def tangents(normals: Array) -> tuple[Array, Array]:
    """(N, 3), (N, 3) unit vectors that complete normals to right-handed frames."""
    axis = np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    u = np.cross(normals, axis)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u, np.cross(normals, u)
