"""Parallax: how much too high or too low a surface lies, told by what views show of it where its radiance changes.

A place has one radiance wherever it is seen from. If the surface is off by some depth, a slanting view shows a place
beside the one that it should; where the radiance has a gradient, greys then follow the slant of the views. One depth
for each place explains them by least squares:  grey = a + g . (x + depth * slant),  with a and the gradient g on the
surface and slant = direction along the surface / direction into it.
"""

from ctypes import c_double, c_int64
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.rows import distinct
from brepgaussian.splatting.library import load, pointer

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
    starts = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
    rays = [np.ascontiguousarray(a[order], float) for a in (seen.points, seen.normals, seen.directions, seen.grey)]
    centres, normals = np.empty((len(count), 3)), np.empty((len(count), 3))
    depth, sigma, facing = (np.empty(len(count)) for _ in range(3))
    load().bg_depths(
        c_int64(len(count)), pointer(starts), *map(pointer, rays), c_double(footprint), c_double(tolerance),
        c_double(_ROUNDING), c_double(_DAMPING), _REWEIGHTINGS, _ROUNDS,
        *map(pointer, (centres, normals, depth, sigma, facing)),
    )  # fmt: skip
    told = (count >= _LEAST_RAYS) & (facing > _FLAT) & (sigma < _SURE_PX)
    return Depths(places, centres, normals, depth, sigma, told)
