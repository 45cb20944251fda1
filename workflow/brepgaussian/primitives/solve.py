"""Least squares of all surfaces on their points together, with relations as exact equations.

Gauss-Newton with equality constraints. The normal matrix of the points is block diagonal (one block a
patch), so each step needs only the small system of the constraint rows,
delta = delta0 - S C^T (C S C^T)^+ (C delta0 + c), with S the inverse of the blocks and delta0 the free step.
The pseudo-inverse takes redundant rows as they come: three mutually perpendicular directions and all the
parallels among them need no bookkeeping.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.fit import PARAMETERS, abreast, distance_jacobian, moved, residuals
from brepgaussian.geometry.fit_choose import CUT
from brepgaussian.geometry.independence import observations, own_share, shared_errors
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.primitives.patches import Cloud, Noise, Patch, thinned
from brepgaussian.primitives.relations import Link

Array = NDArray[np.float64]

# Independent observations of a patch's place and direction: the slow part of the error spans the whole patch, so
# they are fewer than those that tell its shape (`geometry.fit_choose.EFFECTIVE`).
EFFECTIVE = 8
SAMPLE = 500  # points of a patch in the joint solve
ITERATIONS = 6
STEP = 1e-6  # of the central differences of relations
PRIOR_ANGLE, PRIOR_LENGTH = 0.3, 0.1  # weak prior, rad and unit frame: keeps unobserved parameters where they are
REDUNDANT = 1e-9  # relative eigenvalue below which a constraint row repeats others
SETTLED = 1e-10  # largest parameter change of the last iteration
MOST_STEP = 0.2  # rad or unit frame; a larger step is shortened


@dataclass(frozen=True)
class Evidence:
    """What the points of a patch say: positions, weights whose sum is the effective count over the variance.

    `count` is that number of independent observations.
    """

    xyz: Array
    weights: Array
    count: float


def gather(patch: Patch, cloud: Cloud, noise: Noise, cautious: bool = False) -> Evidence:
    """Thinned inliers of a patch with weights; they count for as many observations as are independent.

    If `cautious` all errors count as slow: what the points may have in common beyond their noise is not known yet.
    """
    some = thinned(patch.members, SAMPLE)
    distance, turn = residuals(patch.surface, cloud.xyz[some], cloud.normals[some])
    sigma = max(noise.distance, patch.rms)
    good = (distance < CUT * sigma) & (turn < max(4 * noise.turn, np.radians(30.0)))
    chosen = some[good] if good.sum() >= PARAMETERS[patch.surface.kind] else some
    count = float(min(len(chosen), EFFECTIVE)) if cautious else independent(patch, cloud, CUT * sigma)
    return Evidence(cloud.xyz[chosen], np.full(len(chosen), count / (len(chosen) * sigma**2)), count)


def independent(patch: Patch, cloud: Cloud, cut: float) -> float:
    """Number of independent observations of a patch's place and direction.

    Errors that neighbours have in common are slow: they count as `EFFECTIVE` observations however many points there
    are. The points of surfels have nothing but such errors, at least a fifth of the variance is common to neighbours.
    The less it is, the more is every point's own.
    """
    shared, points = shared_errors(patch.surface, cloud.xyz[patch.members], cut)
    return observations(points, own_share(shared, points), EFFECTIVE)


def normal_equations(surface: Surface, evidence: Evidence) -> tuple[Array, Array]:
    """(P, P) information matrix and (P,) gradient of half the weighted sum of squares."""
    distance, jacobian = distance_jacobian(surface, evidence.xyz)
    weighted = jacobian * evidence.weights[:, None]
    return weighted.T @ jacobian + np.diag(_prior(surface.kind)), weighted.T @ distance


def covariance(surface: Surface, evidence: Evidence) -> Array:
    """(P, P) covariance of the local parameters."""
    return np.asarray(np.linalg.inv(normal_equations(surface, evidence)[0]), float)


def derivative(link: Link, surfaces: list[Surface]) -> tuple[Array, dict[int, Array]]:
    """Residual (rows,) of a relation and its (rows, P) Jacobians by patch."""
    value = link.residual(surfaces[link.first], surfaces[link.second])
    result: dict[int, Array] = {}
    for patch in dict.fromkeys((link.first, link.second)):
        columns: list[Array] = []
        for column in range(PARAMETERS[surfaces[patch].kind]):
            delta = np.zeros(PARAMETERS[surfaces[patch].kind])
            delta[column] = STEP
            ends: list[Array] = []
            for sign in (1, -1):
                other = moved(surfaces[patch], sign * delta)
                pair = [other if k == patch else surfaces[k] for k in (link.first, link.second)]
                ends.append(link.residual(*pair))
            columns.append(np.asarray(ends[0] - ends[1], float) / (2 * STEP))
        result[patch] = np.column_stack(columns)
    return value, result


def significance(link: Link, surfaces: list[Surface], covariances: list[Array]) -> float:
    """Root mean square of a relation's residual in its own standard deviations."""
    value, jacobians = derivative(link, surfaces)
    matrix = np.zeros((len(value), len(value)))
    for patch, jacobian in jacobians.items():
        matrix += jacobian @ covariances[patch] @ jacobian.T
    square = float(value @ np.linalg.pinv(matrix, rcond=REDUNDANT) @ value)
    return float(np.sqrt(max(square, 0.0) / max(int(np.linalg.matrix_rank(matrix, REDUNDANT)), 1)))


def solve(surfaces: list[Surface], evidence: list[Evidence], links: list[Link]) -> tuple[list[Surface], Array]:
    """Fit all surfaces to their points such that all relations hold.

    Args:
        surfaces: starts, one a patch.
        evidence: points of each patch.
        links: relations, possibly redundant.

    Returns:
        The surfaces, and per relation the largest residual that is left (contradictory relations keep one).
    """
    tied = sorted({i for link in links for i in (link.first, link.second)})
    start = dict(zip(tied, np.cumsum([0, *(PARAMETERS[surfaces[i].kind] for i in tied)])[:-1], strict=True))
    current = [abreast(s, e.xyz) if i in start else s for i, (s, e) in enumerate(zip(surfaces, evidence, strict=True))]
    for _ in range(ITERATIONS if links else 0):
        delta = _step(current, evidence, links, tied, start)
        for i in tied:
            current[i] = moved(current[i], delta[start[i] : start[i] + PARAMETERS[current[i].kind]])
        if np.abs(delta).max() < SETTLED:
            break
    left = [float(np.abs(link.residual(current[link.first], current[link.second])).max()) for link in links]
    return current, np.array(left)


def _step(
    current: list[Surface], evidence: list[Evidence], links: list[Link], tied: list[int], start: dict[int, int]
) -> Array:
    size = sum(PARAMETERS[current[i].kind] for i in tied)
    inverse, free = np.zeros((size, size)), np.zeros(size)
    for i in tied:
        information, gradient = normal_equations(current[i], evidence[i])
        place = slice(start[i], start[i] + len(gradient))
        inverse[place, place] = np.linalg.inv(information)
        free[place] = -inverse[place, place] @ gradient
    values, rows = [], []
    for link in links:
        value, jacobians = derivative(link, current)
        row = np.zeros((len(value), size))
        for patch, jacobian in jacobians.items():
            row[:, start[patch] : start[patch] + jacobian.shape[1]] = jacobian
        values.append(value)
        rows.append(row)
    matrix, value = np.concatenate(rows), np.concatenate(values)
    spread = matrix @ inverse
    delta = free - spread.T @ _pseudo_solve(spread @ matrix.T, matrix @ free + value)
    longest = float(np.abs(delta).max())
    return delta if longest <= MOST_STEP else delta * (MOST_STEP / longest)


def _pseudo_solve(matrix: Array, right: Array) -> Array:
    diagonal = np.diag(matrix)
    scale = 1 / np.sqrt(np.maximum(diagonal, max(REDUNDANT * float(diagonal.max()), 1e-300)))
    values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
    keep = values > REDUNDANT * max(float(values[-1]), 1e-300)
    return np.asarray(scale * (vectors[:, keep] @ ((vectors[:, keep].T @ (scale * right)) / values[keep])))


def _prior(kind: str) -> Array:
    angle, length = 1 / PRIOR_ANGLE**2, 1 / PRIOR_LENGTH**2
    order = {
        "plane": (angle, angle, length),
        "sphere": (length,) * 4,
        "cylinder": (length, length, angle, angle, length),
        "cone": (length, length, angle, angle, length, angle),
        "torus": (length, length, length, angle, angle, length, length),
    }
    return np.array(order[kind])
