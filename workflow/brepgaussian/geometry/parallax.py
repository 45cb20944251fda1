"""Parallax: how much too high or too low a surface lies, told by what views show of it where its radiance changes.

A place has one radiance wherever it is seen from. If the surface is off by some depth, a slanting view shows a place
beside the one that it should; where the radiance has a gradient, greys then follow the slant of the views. One depth
for each place explains them by least squares:  grey = a + g . (x + depth * slant),  with a and the gradient g on the
surface and slant = direction along the surface / direction into it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.rows import distinct

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

PLACE_PX = 5.0  # side of a place, in footprints of a pixel

_LEAST_RAYS = 12
_FLAT = 0.98  # cosine between a ray's normal and the place's: what bends more is no place of one depth
_SURE_PX = 0.4  # standard error of a depth that tells anything
SIGMAS = 4.0  # and by which it differs from none,
_OFF_PX = 0.5  # and by this more: radiance is not linear
_ROUNDING = 0.2  # of the tolerance: greys are not known better
_REWEIGHTINGS, _ROUNDS = 3, 3
_DAMPING = 1e-6


@dataclass(frozen=True)
class Looks:
    """Rays at a solid.

    Attributes:
        face: (N,) that each hits; points: (N, 3) where, normals: (N, 3) outward unit.
        directions: (N, 3) unit; grey: (N,) levels that the images show.
    """

    face: Indices
    points: Array
    normals: Array
    directions: Array
    grey: Array

    def places(self, side: float) -> Indices:
        """(N, 4) cubes of a side that the points lie in, and their faces."""
        return np.column_stack([np.floor(self.points / side).astype(np.int64), self.face])


@dataclass(frozen=True)
class Depths:
    """How far places lie off.

    Attributes:
        places: (P, 4) cubes and faces; centres: (P, 3), unit frame; normals: (P, 3) outward unit.
        depth: (P,) px by which the surface should lie deeper; sigma: (P,) its standard error.
        told: (P,) whether the radiance tells it.
    """

    places: Indices
    centres: Array
    normals: Array
    depth: Array
    sigma: Array
    told: NDArray[np.bool_]

    @property
    def off(self) -> NDArray[np.bool_]:
        """(P,) places that surely lie elsewhere."""
        return self.told & (np.abs(self.depth) > SIGMAS * self.sigma + _OFF_PX)


def depths(seen: Looks, footprint: float, tolerance: float, side_px: float = PLACE_PX) -> Depths:
    """The depth of every place.

    Args:
        seen: rays at a surface.
        footprint: of a pixel, unit frame.
        tolerance: grey levels that one place may differ by.
        side_px: of a place, in footprints.
    """
    if not len(seen.face):
        none, nothing = np.zeros((0, 3)), np.zeros(0)
        return Depths(np.zeros((0, 4), np.int64), none, none, nothing, nothing, nothing > 0)
    rows = seen.places(side_px * footprint)
    places, where, count = distinct(rows)
    order = np.argsort(where, kind="stable")
    where = where[order]
    fit = _Places(where, np.concatenate([[0], np.cumsum(count)[:-1]]), seen.grey[order], tolerance)
    points, normals, directions = (rows[order] for rows in (seen.points, seen.normals, seen.directions))
    normal = fit.sums(normals)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    facing = np.einsum("ni,ni->n", normals, normal[where])
    first = np.cross(normal, np.where(np.abs(normal[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    axes = np.stack([first, np.cross(normal, first)], axis=1)[where]  # (N, 2, 3)
    centres = fit.sums(points) / count[:, None]
    at = np.einsum("nai,ni->na", axes, points - centres[where]) / footprint
    slant = np.einsum("nai,ni->na", axes, directions) / -np.einsum("ni,ni->n", normals, directions)[:, None]
    plane = np.column_stack([np.ones(len(at)), at])
    weights, solution = fit.robust(plane, np.ones(len(at)))
    for _ in range(_ROUNDS):  # the gradient is better known, the better the depth is
        shift = np.einsum("na,na->n", slant, solution[where, 1:3])
        shift -= (fit.sums(weights * shift) / fit.sums(weights))[where]
        design = np.column_stack([plane, shift])
        weights, solution = fit.robust(design, weights)
    sigma = fit.error(design, weights, solution)
    told = (count >= _LEAST_RAYS) & (np.minimum.reduceat(facing, fit.starts) > _FLAT) & (sigma < _SURE_PX)
    return Depths(places, centres, normal, solution[:, 3], sigma, told)


@dataclass(frozen=True)
class _Places:
    """Rays in the order of their places: `where` (N,), the first ray of each `starts` (P,), and greys (N,)."""

    where: Indices
    starts: Indices
    grey: Array
    tolerance: float

    def sums(self, values: Array) -> Array:
        """Over the rays of each place, (N, ...) to (P, ...)."""
        return np.asarray(np.add.reduceat(values, self.starts, axis=0))

    def robust(self, design: Array, weights: Array) -> tuple[Array, Array]:
        """Weights (N,) and coefficients (P, K) of greys as a linear function of a design (N, K), by place."""
        solution: Array = np.zeros((len(self.starts), design.shape[1]))
        for _ in range(_REWEIGHTINGS):
            normal, right = self._normal(design, weights), self.sums((weights * self.grey)[:, None] * design)
            solution = np.asarray(np.linalg.solve(normal, right[:, :, None])[:, :, 0], np.float64)
            weights = 1 / (1 + (self._rest(design, solution) / self.tolerance) ** 2)
        return weights, solution

    def error(self, design: Array, weights: Array, solution: Array) -> Array:
        """(P,) standard error of the last coefficient."""
        variance = self.sums(weights * self._rest(design, solution) ** 2) / self.sums(weights)
        spread = np.maximum(np.sqrt(variance), _ROUNDING * self.tolerance)
        return np.asarray(spread * np.sqrt(np.linalg.inv(self._normal(design, weights))[:, -1, -1]))

    def _rest(self, design: Array, solution: Array) -> Array:
        return np.asarray(self.grey - np.einsum("nk,nk->n", design, solution[self.where]))

    def _normal(self, design: Array, weights: Array) -> Array:
        """(P, K, K) normal matrices."""
        size = design.shape[1]
        normal = np.empty((len(self.starts), size, size))
        for i in range(size):
            for j in range(i, size):
                normal[:, i, j] = normal[:, j, i] = self.sums(weights * design[:, i] * design[:, j])
        normal[:, range(size), range(size)] += _DAMPING
        return normal
