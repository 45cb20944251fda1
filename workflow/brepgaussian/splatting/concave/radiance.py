"""Whether views agree on a surface: radiance is fixed on it, so one place has one grey from wherever it is seen.

Light that other walls throw back is part of the radiance: it is as fixed as the rest, and its gradients are the
texture that a bare part has.
"""

from ctypes import byref, c_double, c_int64

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.concave.rays import Rays
from brepgaussian.splatting.library import load, pointer

Array = NDArray[np.float64]

PLACE_CELLS = 3.0  # side of a place; smaller ones hold too few rays, larger ones more than a gradient
_CAP = 2.0  # tolerances; greater differences (another surface is in the way) count no more than this
_REWEIGHTINGS = 2
_LEAST_RAYS = {1: 3, 4: 8}  # of a place, before it says anything, by the number of its coefficients
_RIDGE = np.array([1e-3, 0.3, 0.3, 0.3])  # in rays; a place in which few rays lie is even
LEAST_PASSING = 20  # rays, before a hole goes through


def disagreement(
    rays: Rays,
    exit_depth: Array,
    depth: float,
    tolerance: float,
    through: bool = False,
    side: float = PLACE_CELLS,
    even: bool = False,
) -> tuple[Array, NDArray[np.bool_]]:
    """How much views differ on the surfaces that they would see were there an opening of some depth.

    Args:
        rays: through the opening.
        exit_depth: (N,) where each meets the wall, negative on the face around the opening.
        depth: of the floor, cells.
        tolerance: grey levels that one place may differ by.
        through: whether it leads on, to background or to another opening; some rays have to show that.
        side: of a place, cells.
        even: whether a place has one grey, no gradient; a rim that is off by a cell is told better so.

    Returns:
        (N,) difference of a ray from its place's grey (capped), in tolerances, and (N,) whether its place tells any.
        A ray through which background is seen although something is in its way, or the other way round, differs
        as much as a ray can.
    """
    count = len(rays)
    against, told, surface = np.empty(count), np.empty(count, bool), np.empty(count, np.int64)
    place, local, passing = np.empty((count, 4), np.int64), np.empty((count, 3)), c_int64()
    rows = [np.ascontiguousarray(a) for a in (rays.start, rays.sideways, rays.grey, rays.entry)]
    below = [np.ascontiguousarray(a) for a in (rays.crossings, rays.inside, exit_depth)]
    found = load().bg_meet(
        c_int64(count), *map(pointer, rows), c_int64(rays.crossings.shape[1]), *map(pointer, below),
        c_double(depth), int(through), c_double(side), c_double(_CAP),
        *map(pointer, (against, told, surface, place, local)), byref(passing),
    )  # fmt: skip
    if through and passing.value < LEAST_PASSING:
        return np.full(count, _CAP), np.ones(count, bool)
    index = surface[:found]
    local = local[:found, : 0 if even else 3]
    against[index], told[index] = differences(place[:found], local, rays.grey[index], tolerance)
    return against, told


def differences(
    place: NDArray[np.int64], local: Array, grey: Array, tolerance: float, cap: float = _CAP
) -> tuple[Array, NDArray[np.bool_]]:
    """How far rays are from a linear fit to all rays of their place, fitted robustly.

    Args:
        place: (N, K) integer coordinates of each ray's place.
        local: (N, L) where in it, in its sides, about -0.5 to 0.5; L is 3, or 0 for places of one grey.
        grey: (N,) grey levels.
        tolerance: grey levels that one place may differ by.
        cap: tolerances; greater differences (another surface is in the way) count no more than this.

    Returns:
        (N,) capped difference in tolerances, and (N,) whether the place has enough rays to say anything.
    """
    place, local, grey = (np.ascontiguousarray(a, t) for a, t in ((place, np.int64), (local, float), (grey, float)))
    terms = 1 + local.shape[1]
    difference, enough = np.empty(len(grey)), np.empty(len(grey), bool)
    load().bg_differences(
        c_int64(len(grey)), place.shape[1], pointer(place), terms, pointer(local), pointer(grey),
        c_double(tolerance), c_double(cap), c_int64(_LEAST_RAYS[terms]), pointer(_RIDGE), _REWEIGHTINGS,
        pointer(difference), pointer(enough),
    )  # fmt: skip
    return difference, enough
