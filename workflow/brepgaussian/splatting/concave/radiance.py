"""Whether views agree on a surface: radiance is fixed on it, so one place has one grey from wherever it is seen.

Light that other walls throw back is part of the radiance: it is as fixed as the rest, and its gradients are the
texture that a bare part has.
"""

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.concave.rays import Rays

Array = NDArray[np.float64]

PLACE_CELLS = 3.0  # side of a place; smaller ones hold too few rays, larger ones more than a gradient
_CAP = 2.0  # tolerances; greater differences (another surface is in the way) count no more than this
_REWEIGHTINGS = 2
_LEAST_RAYS = {1: 3, 4: 8}  # of a place, before it says anything, by the number of its coefficients
_RIDGE = (1e-3, 0.3, 0.3, 0.3)  # in rays; a place in which few rays lie is even
LEAST_PASSING = 20  # rays, before a hole goes through
_LID, _WALL, _FLOOR, _BEHIND = 0, 1, 2, 3


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
    kind = np.where(exit_depth < 0, _LID, np.where(exit_depth < depth, _WALL, _FLOOR))
    sunk = rays.met(np.clip(exit_depth, 0, depth), (kind == _FLOOR) & through)
    sunk[kind == _LID] = rays.entry[kind == _LID]
    kind[(sunk > np.minimum(exit_depth, depth)) & (kind != _LID)] = _BEHIND
    empty, background = np.isinf(sunk), rays.grey < 0
    against = np.where(empty & background, 0.0, _CAP)
    if through and ((kind != _LID) & (sunk > depth) & (empty == background)).sum() < LEAST_PASSING:
        return np.full(len(rays), _CAP), np.ones(len(rays), bool)
    told = empty | background
    surface = ~told
    where = np.column_stack([rays.start + np.where(empty, 0, sunk)[:, None] * rays.sideways, sunk, kind])[surface]
    place = np.floor(where / [side, side, side, 1]).astype(np.int64)
    local = where[:, :3] / side - place[:, :3] - 0.5
    against[surface], told[surface] = differences(place, local[:, : 0 if even else 3], rays.grey[surface], tolerance)
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
    code = np.zeros(len(place), np.int64)
    for column in place.T:
        column = column - column.min(initial=0)
        code = code * (int(column.max(initial=0)) + 1) + column
    order = np.argsort(code, kind="stable")
    starts = np.flatnonzero(np.diff(code[order], prepend=-1))
    count = np.diff(np.append(starts, len(code)))
    enough = np.zeros(len(grey), bool)
    size = 1 + local.shape[1]
    enough[order] = np.repeat(count >= _LEAST_RAYS[size], count)
    difference = np.full(len(grey), cap)
    kept = order[enough[order]]
    count = count[count >= _LEAST_RAYS[size]]
    if not len(count):
        return difference, enough
    starts = np.cumsum(count) - count
    terms = np.column_stack([np.ones(len(kept)), local[kept]])
    rows, columns = np.triu_indices(size)
    moments = np.column_stack([terms[:, rows] * terms[:, columns], terms * grey[kept, None]])  # (M, 14)
    weight = np.ones(len(kept))
    for _ in range(_REWEIGHTINGS + 1):
        sums = np.add.reduceat(moments * weight[:, None], starts)
        matrix = np.empty((len(count), size, size))
        matrix[:, rows, columns] = matrix[:, columns, rows] = sums[:, : len(rows)]
        fit = np.linalg.solve(matrix + np.diag(_RIDGE[:size]), sums[:, len(rows) :, None])[..., 0]
        off = (grey[kept] - np.einsum("ij,ij->i", terms, np.repeat(fit, count, axis=0))) / tolerance
        weight = 1 / (1 + (off / cap) ** 2)
    difference[kept] = np.minimum(np.abs(off), cap)
    return difference, enough
