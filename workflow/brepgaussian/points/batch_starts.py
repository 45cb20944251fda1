"""Closed-form starts for fits of many point sets: points, normals (B, M, 3), shares (B, M) that add up to 1."""

import numpy as np
from numpy.typing import NDArray

from brepgaussian.points.batch_rows import MAX_RADIUS, SMALL, frame, new_rows

Array = NDArray[np.float64]


def planes(points: Array, normals: Array, share: Array, distance: float, normal: float) -> Array:
    """The best planes (B, 10) by positions and normals, whose standard deviations are given: exact."""
    middle = np.einsum("bm,bmk->bk", share, points)
    centred = points - middle[:, None]
    spread = np.einsum("bm,bmi,bmj->bij", share, centred, centred) / distance**2
    turned = np.einsum("bm,bmi,bmj->bij", share, normals, normals) / normal**2
    axis = np.linalg.eigh(spread - turned)[1][:, :, 0]
    mean = np.einsum("bm,bmk->bk", share, normals)
    axis *= np.where((axis * mean).sum(1) < 0, -1.0, 1.0)[:, None]
    return new_rows(len(points), middle, axis)


def spheres(points: Array, normals: Array, share: Array) -> list[Array]:
    """One start for each set."""
    middle, mean = np.einsum("bm,bmk->bk", share, points), np.einsum("bm,bmk->bk", share, normals)
    p, n = points - middle[:, None], normals - mean[:, None]
    reach = np.einsum("bm,bmk,bmk->b", share, p, n) / np.maximum(np.einsum("bm,bmk,bmk->b", share, n, n), 1e-6)
    rows = new_rows(len(points), middle - reach[:, None] * mean, np.array([0.0, 0.0, 1.0]))
    return [_sized(rows, reach)]


def _sized(rows: Array, reach: Array) -> Array:
    rows[:, 6] = np.clip(np.abs(reach), 1e-4, MAX_RADIUS)
    rows[:, 9] = reach < 0
    return rows


def cylinders(points: Array, normals: Array, share: Array) -> list[Array]:
    """One start for each set."""
    axis = np.linalg.eigh(np.einsum("bm,bmi,bmj->bij", share, normals, normals))[1][:, :, 0]
    return [_cylinder_about(axis, points, normals, share)]


def _cylinder_about(axis: Array, points: Array, normals: Array, share: Array) -> Array:
    along = np.einsum("bmk,bk->bm", points, axis)
    across = points - along[..., None] * axis[:, None]
    radial = normals - np.einsum("bmk,bk->bm", normals, axis)[..., None] * axis[:, None]
    radial /= np.sqrt((radial**2).sum(2) + SMALL)[..., None]
    middle, mean = np.einsum("bm,bmk->bk", share, across), np.einsum("bm,bmk->bk", share, radial)
    p, n = across - middle[:, None], radial - mean[:, None]
    reach = np.einsum("bm,bmk,bmk->b", share, p, n) / np.maximum(np.einsum("bm,bmk,bmk->b", share, n, n), 1e-6)
    level = np.einsum("bm,bm->b", share, along)
    rows = new_rows(len(points), middle - reach[:, None] * mean + level[:, None] * axis, axis)
    return _sized(rows, reach)


def _revolution_axes(points: Array, normals: Array, share: Array) -> list[tuple[Array, Array]]:
    """Axes that the normal lines meet (Pottmann and Randrup, 1998): (direction, point) twice."""
    middle = np.einsum("bm,bmk->bk", share, points)
    p = points - middle[:, None]
    extent = np.sqrt(np.einsum("bm,bmk,bmk->b", share, p, p)) + SMALL
    p = p / extent[:, None, None]
    moment = np.cross(p, normals)
    aa = np.einsum("bm,bmi,bmj->bij", share, moment, moment)
    am = np.einsum("bm,bmi,bmj->bij", share, moment, normals)
    mm = np.einsum("bm,bmi,bmj->bij", share, normals, normals) + 1e-4 * np.eye(3)
    solve = np.linalg.solve(mm, am.transpose(0, 2, 1))  # m = -solve @ a
    directions = np.linalg.eigh(aa - am @ solve)[1]
    axes = []
    for column in (0, 1):
        axis = directions[:, :, column]
        foot = np.cross(axis, -np.einsum("bij,bj->bi", solve, axis))
        axes.append((axis, middle + extent[:, None] * foot))
    return axes


def cones(points: Array, normals: Array, share: Array) -> list[Array]:
    """One start for each set."""
    mean = np.einsum("bm,bmk->bk", share, normals)
    n = normals - mean[:, None]
    axis = np.linalg.eigh(np.einsum("bm,bmi,bmj->bij", share, n, n))[1][:, :, 0]
    return [_cone_about(axis, points, normals, share)]


def _cone_about(axis: Array, points: Array, normals: Array, share: Array) -> Array:
    """p = c + (r + k t) u across the axis, with u the normal's direction across it: linear in c, r, k."""
    axis = axis.copy()
    middle = np.einsum("bm,bmk->bk", share, points)
    x, y = frame(axis)
    offset = points - middle[:, None]
    along = np.einsum("bmk,bk->bm", offset, axis)
    nx, ny = np.einsum("bmk,bk->bm", normals, x), np.einsum("bmk,bk->bm", normals, y)
    length = np.sqrt(nx**2 + ny**2 + SMALL)
    ux, uy = nx / length, ny / length
    px, py = np.einsum("bmk,bk->bm", offset, x), np.einsum("bmk,bk->bm", offset, y)
    ones, zeros = np.ones_like(ux), np.zeros_like(ux)
    matrix = np.concatenate(
        [np.stack([ones, zeros, ux, along * ux], 2), np.stack([zeros, ones, uy, along * uy], 2)], axis=1
    )
    weight = np.concatenate([share, share], axis=1)
    normal = np.einsum("bm,bmi,bmj->bij", weight, matrix, matrix)
    normal += (1e-7 * np.trace(normal, axis1=1, axis2=2))[:, None, None] * np.eye(4)
    right = np.einsum("bm,bmi,bm->bi", weight, matrix, np.concatenate([px, py], axis=1))
    cx, cy, radius, slope = np.linalg.solve(normal, right[..., None])[..., 0].T
    flipped = radius < 0
    # the normals tell the half angle better than a narrow band's positions do
    tilt = np.einsum("bm,bm->b", share, np.einsum("bmk,bk->bm", normals, axis))
    across = np.einsum("bm,bm->b", share, length)
    outward = np.where(flipped, -1.0, 1.0)
    slope = -tilt / np.maximum(across, SMALL) * outward
    axis *= np.where(slope < 0, -1.0, 1.0)[:, None]
    rows = new_rows(len(points), middle + cx[:, None] * x + cy[:, None] * y, axis)
    rows[:, 6] = np.clip(np.abs(radius), 1e-4, MAX_RADIUS)
    rows[:, 8] = np.clip(np.arctan(np.abs(slope)), 0.02, 1.55)
    rows[:, 9] = flipped
    return rows


def tori(points: Array, normals: Array, share: Array) -> list[Array]:
    """Two starts for each set: of two axes that its normals meet."""
    rows = []
    for axis, through in _revolution_axes(points, normals, share):
        offset = points - through[:, None]
        along = np.einsum("bmk,bk->bm", offset, axis)
        across = offset - along[..., None] * axis[:, None]
        rho = np.sqrt((across**2).sum(2))
        radial = across / (rho + SMALL)[..., None]
        profile = np.stack([rho, along], 2)
        slope = np.stack([(normals * radial).sum(2), np.einsum("bmk,bk->bm", normals, axis)], 2)
        middle, mean = np.einsum("bm,bmk->bk", share, profile), np.einsum("bm,bmk->bk", share, slope)
        p, n = profile - middle[:, None], slope - mean[:, None]
        reach = np.einsum("bm,bmk,bmk->b", share, p, n) / np.maximum(np.einsum("bm,bmk,bmk->b", share, n, n), 1e-6)
        centre = middle - reach[:, None] * mean
        found = new_rows(len(points), through + centre[:, 1, None] * axis, axis)
        found[:, 6] = np.clip(centre[:, 0], 1e-4, MAX_RADIUS)
        found[:, 7] = np.clip(np.abs(reach), 1e-4, MAX_RADIUS)
        found[:, 9] = reach < 0
        rows.append(found)
    return rows
