"""Fits of many small point sets at once: B sets of M points as arrays, for thousands of merge decisions.

One surface is a row of `geometry.surfaces.surface_to_row` (origin, axis, radius, minor, angle, flipped).
Fits minimise positions and normals together, (d / sigma_d)^2 + (angle / sigma_n)^2, since a short arc is
determined by its normals. Single, exact fits are `geometry.fit`'s business.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.points.batch_rows import PARAMETERS, SMALL, evaluate, moved
from brepgaussian.points.batch_starts import cones, cylinders, planes, spheres, tori
from brepgaussian.points.shading import Shading, predicted_gradients

Array = NDArray[np.float64]
_STEP = 1e-5  # numeric derivatives: lengths in the unit frame, angles in radians
KNEE = 4.0  # of a node's cost: a misfit of two standard deviations in each of two directions
SHADING_CAP = 6.0  # of the squared residual of a gradient: shadows and highlights are no proof
_LINE_SHARE = 0.95  # of the spread across a cone's axis is along one line: half a cone .7, two arcs of 90 degrees .8
_EITHER_SIDE = 0.1  # of the points lie on either side of the axis
_TAIL, _NEAR_APEX = 0.05, 0.2  # quantiles of the distances from the axis: so near to it, points reach the apex
_CREASE = np.radians(67.5)  # half a cone's angle at most: planes that turn by 45 degrees at least meet in an edge
_WITHIN_NOISE = 6.0  # mean squared misfit of planes: twice that of a distance and two directions of a normal
_APART = 10.0  # unit frame: added to the radius of a cone that is none
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
    share = _shares(sets.weights)
    if kind == "plane":
        return planes(points, normals, share, noise.distance, noise.normal)
    starts = {"sphere": spheres, "cylinder": cylinders, "cone": cones, "torus": tori}[kind](points, normals, share)
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
    if kind == "cone":
        best[folded(best, sets, noise), 6] += _APART
    return best


def folded(rows: Array, sets: Sets, noise: Noise) -> NDArray[np.bool_]:
    """(B,) cones (B, 10) that are two strips of planes instead.

    A cone of half a right angle is both sides of a thin plate's corner, but for the square of their height: its points
    reach the apex along two opposite lines only, and two planes, which have as many parameters, tell them better.
    """
    points, normals = sets.points, sets.normals
    share = _shares(sets.weights)
    offset = points - rows[:, None, 0:3]
    across = offset - (offset * rows[:, None, 3:6]).sum(2)[..., None] * rows[:, None, 3:6]
    sizes, axes = np.linalg.eigh(np.einsum("bm,bmk,bml->bkl", share, across, across))
    line = sizes[:, 2] >= _LINE_SHARE * sizes.sum(axis=1)
    side = np.einsum("bmk,bk->bm", across, axes[:, :, 2]) > 0
    one = np.where(side, share, 0.0).sum(axis=1)
    both = (one >= _EITHER_SIDE) & (one <= 1 - _EITHER_SIDE)
    from_apex = np.where(share > 0, np.linalg.norm(across, axis=2), np.nan)
    least, most = np.nanquantile(from_apex, [_TAIL, 1 - _TAIL], axis=1)
    found = np.asarray(line & both & (least <= _NEAR_APEX * most) & (np.abs(rows[:, 8]) <= _CREASE))
    if found.any():
        points, normals, share, side = points[found], normals[found], share[found], side[found]
        cone = _misfit("cone", rows[found], points, normals, share, noise)
        flat = sum(_plane_misfit(points, normals, share * of, noise) for of in (side, ~side))
        found[found] = flat < np.minimum(cone, _WITHIN_NOISE)
    return found


def _shares(weights: Array) -> Array:
    """(B, M) weights of each set, as shares of their sum."""
    return np.asarray(weights / np.maximum(weights.sum(1, keepdims=True), SMALL))


def _plane_misfit(points: Array, normals: Array, weights: Array, noise: Noise) -> Array:
    rows = planes(points, normals, _shares(weights), noise.distance, noise.normal)
    return _misfit("plane", rows, points, normals, weights, noise)


def _misfit(kind: str, rows: Array, points: Array, normals: Array, weights: Array, noise: Noise) -> Array:
    """(B,) weighted sum of the squared residuals in units of the noise."""
    return (_residuals(kind, rows, points, normals, np.sqrt(weights), noise) ** 2).sum(1)


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
            stepped = _residuals(kind, moved(kind, rows, delta), points, normals, root, noise)
            jacobian[..., p] = (stepped - current) / _STEP
        transposed = jacobian.transpose(0, 2, 1)
        hessian = transposed @ jacobian
        gradient = (transposed @ current[..., None])[..., 0]
        diagonal = np.einsum("bii->bi", hessian) + 1e-6 * np.einsum("bii->b", hessian)[:, None] + SMALL
        hessian = hessian + damping[:, None, None] * diagonal[:, :, None] * np.eye(count)
        step = -np.linalg.solve(hessian, gradient[..., None])[..., 0]
        step = np.nan_to_num(np.clip(step, -0.5, 0.5))
        trial = moved(kind, rows, step)
        residual = _residuals(kind, trial, points, normals, root, noise)
        trial_value = (residual**2).sum(1)
        better = trial_value < value
        rows[better], current[better], value[better] = trial[better], residual[better], trial_value[better]
        damping = np.where(better, damping / 10, damping * 10)
    return rows, value
