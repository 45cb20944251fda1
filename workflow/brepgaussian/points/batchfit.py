"""Fits of many small point sets at once: B sets of M points as arrays, for thousands of merge decisions.

One surface is a row of `geometry.surfaces.surface_to_row` (origin, axis, radius, minor, angle, flipped).
Fits minimise positions and normals together, (d / sigma_d)^2 + (angle / sigma_n)^2, since a short arc is
determined by its normals. Single, exact fits are `geometry.fit`'s business.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.surfaces import ROW_LENGTH
from brepgaussian.points.shading import Shading, predicted_gradients

Array = NDArray[np.float64]
PARAMETERS = {"plane": 3, "sphere": 4, "cylinder": 5, "cone": 6, "torus": 7}
MAX_RADIUS = 5.0  # unit frame: five times the object; flatter than that is a plane
_STEP = 1e-5  # numeric derivatives: lengths in the unit frame, angles in radians
_SMALL = 1e-9
KNEE = 4.0  # of a node's cost: a misfit of two standard deviations in each of two directions
SHADING_CAP = 6.0  # of the squared residual of a gradient: shadows and highlights are no proof
_HOPELESS = 40.0  # mean squared residual of a start, in units of the noise, that no refinement mends


@dataclass(frozen=True)
class Noise:
    """Standard deviations: distance (unit frame), normal (radians), gradient of the grey level (per unit length).

    `shading` predicts grey levels from normals; None leaves them out.
    """

    distance: float
    normal: float
    gradient: float = np.inf
    shading: Shading | None = None


@dataclass(frozen=True)
class Sets:
    """B sets of M nodes.

    Attributes:
        points, normals: (B, M, 3); gradients: (B, M, 3) of the grey level, NaN = unknown.
        weights: (B, M) non-negative.
    """

    points: Array
    normals: Array
    gradients: Array
    weights: Array

    def take(self, index: NDArray[np.int64]) -> "Sets":
        """Some of the sets."""
        return Sets(self.points[index], self.normals[index], self.gradients[index], self.weights[index])

    def weighted(self, weights: Array) -> "Sets":
        """The same with other weights."""
        return Sets(self.points, self.normals, self.gradients, weights)


def evaluate(kind: str, rows: Array, points: Array) -> tuple[Array, Array]:
    """Signed distances (B, M) and outward normals (B, M, 3) of points (B, M, 3) from surfaces (B, 10)."""
    origin, axis = rows[:, None, 0:3], rows[:, None, 3:6]
    sign = 1 - 2 * rows[:, None, 9]
    offset = points - origin
    if kind == "plane":
        normal = np.broadcast_to(axis, offset.shape)
        return sign * (offset * axis).sum(2), sign[..., None] * normal
    radius, minor, angle = rows[:, None, 6], rows[:, None, 7], rows[:, None, 8]
    if kind == "sphere":
        length = np.sqrt((offset**2).sum(2))
        return sign * (length - radius), sign[..., None] * offset / (length + _SMALL)[..., None]
    along = (offset * axis).sum(2)
    across = offset - along[..., None] * axis
    rho = np.sqrt((across**2).sum(2))
    radial = across / (rho + _SMALL)[..., None]
    if kind == "cylinder":
        return sign * (rho - radius), sign[..., None] * radial
    if kind == "cone":
        cosine, sine = np.cos(angle), np.sin(angle)
        distance = (rho - radius) * cosine - along * sine
        return sign * distance, sign[..., None] * (cosine[..., None] * radial - sine[..., None] * axis)
    out = rho - radius
    length = np.sqrt(out**2 + along**2)
    normal = (out[..., None] * radial + along[..., None] * axis) / (length + _SMALL)[..., None]
    return sign * (length - minor), sign[..., None] * normal


def soften(costs: Array) -> Array:
    """Costs that grow only with their logarithm beyond `KNEE`: errors have heavy tails, and yet order counts."""
    costs = np.nan_to_num(costs, nan=1e6, posinf=1e6)
    return np.where(costs < KNEE, costs, KNEE * (1 + np.log(np.maximum(costs, KNEE) / KNEE)))


def costs(kind: str, rows: Array, sets: Sets, noise: Noise) -> Array:
    """(B, M) half the squared residuals in units of the noise, softened."""
    distance, normal = evaluate(kind, rows, sets.points)
    turn = ((normal - sets.normals) ** 2).sum(2)
    value = 0.5 * ((distance / noise.distance) ** 2 + turn / noise.normal**2)
    value += 0.5 * shading_costs(kind, rows, sets, noise)
    return soften(value)


def shading_costs(kind: str, rows: Array, sets: Sets, noise: Noise) -> Array:
    """(B, M) squared residual of the grey level's gradient, at most `SHADING_CAP`, 0 where it is unknown."""
    if noise.shading is None or not np.isfinite(noise.gradient):
        return np.zeros(sets.points.shape[:2])
    off = shading_residuals(kind, rows, sets, noise) / noise.gradient**2
    return np.minimum(np.nan_to_num(off, nan=0.0), SHADING_CAP)


def shading_residuals(kind: str, rows: Array, sets: Sets, noise: Noise) -> Array:
    """(B, M) squared difference between the grey level's gradient and the primitive's, NaN = unknown."""
    slope = sets.gradients
    if kind != "plane" and noise.shading is not None:
        slope = slope - predicted_gradients(
            noise.shading, lambda x: evaluate(kind, rows, x)[1], sets.points, sets.normals
        )
    return (slope**2).sum(2)


def fit(kind: str, sets: Sets, noise: Noise, iterations: int = 4) -> Array:
    """Fit one kind to B sets.

    Args:
        kind: one of `geometry.surfaces.KINDS`.
        sets: B sets; the weights of none may all be zero.
        noise: standard deviations.
        iterations: of Levenberg and Marquardt.

    Returns:
        (B, 10) rows; a set that determines nothing gets some surface with a large residual.
    """
    points, normals = sets.points, sets.normals
    share = sets.weights / np.maximum(sets.weights.sum(1, keepdims=True), _SMALL)
    if kind == "plane":
        return _plane(points, normals, share, noise)
    starts = {"sphere": _spheres, "cylinder": _cylinders, "cone": _cones, "torus": _tori}[kind](points, normals, share)
    best: Array | None = None
    lowest = np.zeros(0)
    for rows in starts:
        refined, value = _refine(kind, rows, points, normals, share, noise, iterations)
        if best is None:
            best, lowest = refined, value
        else:
            better = value < lowest
            best[better], lowest[better] = refined[better], value[better]
    assert best is not None
    return best


def _rows(count: int, origin: Array, axis: Array) -> Array:
    rows = np.zeros((count, ROW_LENGTH))
    rows[:, 0:3], rows[:, 3:6] = origin, axis
    return rows


def _plane(points: Array, normals: Array, share: Array, noise: Noise) -> Array:
    middle = np.einsum("bm,bmk->bk", share, points)
    centred = points - middle[:, None]
    spread = np.einsum("bm,bmi,bmj->bij", share, centred, centred) / noise.distance**2
    turned = np.einsum("bm,bmi,bmj->bij", share, normals, normals) / noise.normal**2
    axis = np.linalg.eigh(spread - turned)[1][:, :, 0]
    mean = np.einsum("bm,bmk->bk", share, normals)
    axis *= np.where((axis * mean).sum(1) < 0, -1.0, 1.0)[:, None]
    return _rows(len(points), middle, axis)


def _spheres(points: Array, normals: Array, share: Array) -> list[Array]:
    middle, mean = np.einsum("bm,bmk->bk", share, points), np.einsum("bm,bmk->bk", share, normals)
    p, n = points - middle[:, None], normals - mean[:, None]
    reach = np.einsum("bm,bmk,bmk->b", share, p, n) / np.maximum(np.einsum("bm,bmk,bmk->b", share, n, n), 1e-6)
    rows = _rows(len(points), middle - reach[:, None] * mean, np.array([0.0, 0.0, 1.0]))
    return [_sized(rows, reach)]


def _sized(rows: Array, reach: Array) -> Array:
    rows[:, 6] = np.clip(np.abs(reach), 1e-4, MAX_RADIUS)
    rows[:, 9] = reach < 0
    return rows


def _cylinders(points: Array, normals: Array, share: Array) -> list[Array]:
    axis = np.linalg.eigh(np.einsum("bm,bmi,bmj->bij", share, normals, normals))[1][:, :, 0]
    return [_cylinder_about(axis, points, normals, share)]


def _cylinder_about(axis: Array, points: Array, normals: Array, share: Array) -> Array:
    along = np.einsum("bmk,bk->bm", points, axis)
    across = points - along[..., None] * axis[:, None]
    radial = normals - np.einsum("bmk,bk->bm", normals, axis)[..., None] * axis[:, None]
    radial /= np.sqrt((radial**2).sum(2) + _SMALL)[..., None]
    middle, mean = np.einsum("bm,bmk->bk", share, across), np.einsum("bm,bmk->bk", share, radial)
    p, n = across - middle[:, None], radial - mean[:, None]
    reach = np.einsum("bm,bmk,bmk->b", share, p, n) / np.maximum(np.einsum("bm,bmk,bmk->b", share, n, n), 1e-6)
    level = np.einsum("bm,bm->b", share, along)
    rows = _rows(len(points), middle - reach[:, None] * mean + level[:, None] * axis, axis)
    return _sized(rows, reach)


def _revolution_axes(points: Array, normals: Array, share: Array) -> list[tuple[Array, Array]]:
    """Axes that the normal lines meet (Pottmann and Randrup, 1998): (direction, point) twice."""
    middle = np.einsum("bm,bmk->bk", share, points)
    p = points - middle[:, None]
    extent = np.sqrt(np.einsum("bm,bmk,bmk->b", share, p, p)) + _SMALL
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


def _cones(points: Array, normals: Array, share: Array) -> list[Array]:
    mean = np.einsum("bm,bmk->bk", share, normals)
    n = normals - mean[:, None]
    axis = np.linalg.eigh(np.einsum("bm,bmi,bmj->bij", share, n, n))[1][:, :, 0]
    return [_cone_about(axis, points, normals, share)]


def _cone_about(axis: Array, points: Array, normals: Array, share: Array) -> Array:
    """p = c + (r + k t) u across the axis, with u the normal's direction across it: linear in c, r, k."""
    axis = axis.copy()
    middle = np.einsum("bm,bmk->bk", share, points)
    x, y = _frame(axis)
    offset = points - middle[:, None]
    along = np.einsum("bmk,bk->bm", offset, axis)
    nx, ny = np.einsum("bmk,bk->bm", normals, x), np.einsum("bmk,bk->bm", normals, y)
    length = np.sqrt(nx**2 + ny**2 + _SMALL)
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
    slope = -tilt / np.maximum(across, _SMALL) * outward
    axis *= np.where(slope < 0, -1.0, 1.0)[:, None]
    rows = _rows(len(points), middle + cx[:, None] * x + cy[:, None] * y, axis)
    rows[:, 6] = np.clip(np.abs(radius), 1e-4, MAX_RADIUS)
    rows[:, 8] = np.clip(np.arctan(np.abs(slope)), 0.02, 1.55)
    rows[:, 9] = flipped
    return rows


def _tori(points: Array, normals: Array, share: Array) -> list[Array]:
    rows = []
    for axis, through in _revolution_axes(points, normals, share):
        offset = points - through[:, None]
        along = np.einsum("bmk,bk->bm", offset, axis)
        across = offset - along[..., None] * axis[:, None]
        rho = np.sqrt((across**2).sum(2))
        radial = across / (rho + _SMALL)[..., None]
        profile = np.stack([rho, along], 2)
        slope = np.stack([(normals * radial).sum(2), np.einsum("bmk,bk->bm", normals, axis)], 2)
        middle, mean = np.einsum("bm,bmk->bk", share, profile), np.einsum("bm,bmk->bk", share, slope)
        p, n = profile - middle[:, None], slope - mean[:, None]
        reach = np.einsum("bm,bmk,bmk->b", share, p, n) / np.maximum(np.einsum("bm,bmk,bmk->b", share, n, n), 1e-6)
        centre = middle - reach[:, None] * mean
        found = _rows(len(points), through + centre[:, 1, None] * axis, axis)
        found[:, 6] = np.clip(centre[:, 0], 1e-4, MAX_RADIUS)
        found[:, 7] = np.clip(np.abs(reach), 1e-4, MAX_RADIUS)
        found[:, 9] = reach < 0
        rows.append(found)
    return rows


def _frame(axis: Array) -> tuple[Array, Array]:
    """Two directions (B, 3) that make a right-handed frame with unit axes (B, 3) (Duff et al., JCGT 2017)."""
    sign = np.where(axis[:, 2] >= 0, 1.0, -1.0)
    a = -1.0 / (sign + axis[:, 2])
    b = axis[:, 0] * axis[:, 1] * a
    x = np.stack([1 + sign * axis[:, 0] ** 2 * a, sign * b, -sign * axis[:, 0]], 1)
    return x, np.stack([b, sign + axis[:, 1] ** 2 * a, -axis[:, 1]], 1)


def _moved(kind: str, rows: Array, delta: Array) -> Array:
    """Rows after small steps (B, P): shifts, tilts of the axis, radii, angle."""
    moved = rows.copy()
    x, y = _frame(rows[:, 3:6])
    if kind == "sphere":
        moved[:, 0:3] += delta[:, 0:3]
        moved[:, 6] += delta[:, 3]
    else:
        moved[:, 0:3] += delta[:, 0, None] * x + delta[:, 1, None] * y
        axis = rows[:, 3:6] + delta[:, 2, None] * x + delta[:, 3, None] * y
        moved[:, 3:6] = axis / np.linalg.norm(axis, axis=1, keepdims=True)
        moved[:, 6] += delta[:, 4]
        if kind == "cone":
            moved[:, 8] = np.clip(moved[:, 8] + delta[:, 5], 0.01, 1.56)
        if kind == "torus":
            moved[:, 0:3] += delta[:, 5, None] * rows[:, 3:6]
            moved[:, 7] = np.clip(moved[:, 7] + delta[:, 6], 1e-4, MAX_RADIUS)
    moved[:, 6] = np.clip(moved[:, 6], 1e-4, MAX_RADIUS)
    return moved


def _residuals(kind: str, rows: Array, points: Array, normals: Array, root: Array, noise: Noise) -> Array:
    distance, normal = evaluate(kind, rows, points)
    parts = np.concatenate([distance[..., None] / noise.distance, (normal - normals) / noise.normal], axis=2)
    return (parts * root[..., None]).reshape(len(rows), -1)


def _refine(
    kind: str, rows: Array, points: Array, normals: Array, share: Array, noise: Noise, iterations: int
) -> tuple[Array, Array]:
    """Levenberg-Marquardt with numeric derivatives; origins are put abreast of the points first."""
    if kind in ("cylinder", "cone"):
        middle = np.einsum("bm,bmk->bk", share, points)
        along = ((middle - rows[:, 0:3]) * rows[:, 3:6]).sum(1)
        if kind == "cylinder":
            rows[:, 0:3] += along[:, None] * rows[:, 3:6]
    root = np.sqrt(share)
    current = _residuals(kind, rows, points, normals, root, noise)
    value = (current**2).sum(1)
    hopeful = np.flatnonzero(value < _HOPELESS)
    if len(hopeful) < len(rows):
        if len(hopeful):
            some = (rows[hopeful], points[hopeful], normals[hopeful], share[hopeful])
            rows[hopeful], value[hopeful] = _refine(kind, *some, noise, iterations)
        return rows, value
    damping = np.full(len(rows), 1e-3)
    count = PARAMETERS[kind]
    for _ in range(iterations):
        jacobian = np.empty((*current.shape, count))
        for p in range(count):
            delta = np.zeros((len(rows), count))
            delta[:, p] = _STEP
            stepped = _residuals(kind, _moved(kind, rows, delta), points, normals, root, noise)
            jacobian[..., p] = (stepped - current) / _STEP
        transposed = jacobian.transpose(0, 2, 1)
        hessian = transposed @ jacobian
        gradient = (transposed @ current[..., None])[..., 0]
        diagonal = np.einsum("bii->bi", hessian) + 1e-6 * np.einsum("bii->b", hessian)[:, None] + _SMALL
        hessian = hessian + damping[:, None, None] * diagonal[:, :, None] * np.eye(count)
        step = -np.linalg.solve(hessian, gradient[..., None])[..., 0]
        step = np.nan_to_num(np.clip(step, -0.5, 0.5))
        trial = _moved(kind, rows, step)
        residual = _residuals(kind, trial, points, normals, root, noise)
        trial_value = (residual**2).sum(1)
        better = trial_value < value
        rows[better], current[better], value[better] = trial[better], residual[better], trial_value[better]
        damping = np.where(better, damping / 10, damping * 10)
    return rows, value
