"""Whether views agree on a surface: radiance is fixed on it, so one place has one grey from wherever it is seen.

Light that other walls throw back is part of the radiance: it is as fixed as the rest, and its gradients are the
texture that a bare part has.
"""

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.concave.rays import Rays

Array = NDArray[np.float64]

_BIN_CELLS = 3.0  # side of a place; smaller ones hold too few rays, larger ones too much gradient
_CAP = 2.0  # tolerances; greater differences (another surface is in the way) count no more than this
_REWEIGHTINGS = 2
_LEAST_RAYS = 3  # of a place, before it says anything
_LEAST_BACKGROUND = 20  # rays, before a hole goes through
_LID, _WALL, _FLOOR = 0, 1, 2


def disagreement(
    rays: Rays, exit_depth: Array, depth: float, tolerance: float, through: bool = False
) -> tuple[float, float]:
    """How much views differ on walls and floor of an opening, were it of some depth.

    Args:
        rays: through the opening.
        exit_depth: (N,) where each meets the wall, negative on the face around the opening.
        depth: of the floor, cells.
        tolerance: grey levels that one place may differ by.
        through: whether there is no floor but background.

    Returns:
        The mean difference of a ray from its place's grey (capped), in tolerances; and the share of rays that
        differ by more than the tolerance.
    """
    kind = np.where(exit_depth < 0, _LID, np.where(exit_depth < depth, _WALL, _FLOOR))
    sunk = np.clip(exit_depth, 0, depth)
    where = np.column_stack([rays.start + sunk[:, None] * rays.sideways, sunk])
    against = _CAP * np.ones(len(rays))
    background = rays.grey < 0
    if through:
        if (background & (kind == _FLOOR)).sum() < _LEAST_BACKGROUND:
            return _CAP, 1.0
        against[background & (kind == _FLOOR)] = 0
        surface = ~background & (kind != _FLOOR)
    else:
        surface = ~background
    told = ~surface
    difference, enough = _differences(np.column_stack([where[surface], kind[surface]]), rays.grey[surface], tolerance)
    against[surface] = difference
    told[surface] = enough
    if not told.any():
        return _CAP, 1.0
    return float(against[told].mean()), float((against[told] > 1).mean())


def _differences(keys: Array, grey: Array, tolerance: float) -> tuple[Array, NDArray[np.bool_]]:
    """(N,) capped difference of each ray from its place, in tolerances, and whether the place says anything."""
    index = np.floor(keys[:, :3] / _BIN_CELLS).astype(np.int64)
    index -= index.min(axis=0) if len(index) else 0
    code = keys[:, 3].astype(np.int64)
    for axis in range(3):
        code = code * (int(index[:, axis].max(initial=0)) + 1) + index[:, axis]
    count = np.bincount(code)
    place = (np.cumsum(count > 0) - 1)[code]
    count = count[count > 0]
    mean = np.bincount(place, grey) / count
    for _ in range(_REWEIGHTINGS):
        weight = 1 / (1 + ((grey - mean[place]) / (_CAP * tolerance)) ** 2)
        mean = np.bincount(place, grey * weight) / np.bincount(place, weight)
    # a ray draws its place's mean towards itself
    unbiased = np.sqrt(count / np.maximum(count - 1, 1))
    difference = np.minimum(np.abs(grey - mean[place]) / tolerance * unbiased[place], _CAP)
    return difference, count[place] >= _LEAST_RAYS
