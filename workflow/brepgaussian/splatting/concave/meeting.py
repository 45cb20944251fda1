"""Holes that end just short of another one: a set-screw hole, a vent, a channel that crosses a bore.

Down a narrow hole few views see where it leads, and a bore behind its end has the grey of its own walls. So rays tell
the least depth that explains them, and no floor. Nobody leaves a membrane between two holes; so where no ray tells a
floor and the other hole is less than its own width away, it meets that.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian import log
from brepgaussian.splatting.concave.ends import core_of, is_straight
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.rays import crossings_below
from brepgaussian.splatting.concave.scene import Scene

Array = NDArray[np.float64]

_AT_FLOOR_CELLS = 2.0  # between a hull's floor and the depth that it was cut to
_WITHIN_CELLS = 1.0  # of the other hole's wall: where a line leaves the solid it is in that one
_THINNEST_WALL = 1.0  # widths of a hole: what is left between it and another one is thicker
_MOSTLY = 0.5  # of its cells lie over the other hole, which may be narrower

logger = log.get_logger("stage1")


def met(scene: Scene, prism: Prism, others: Sequence[Prism]) -> Prism:
    """A straight hole of which no floor is told, or the same up to another hole that it nearly reaches.

    Args:
        scene: the hull with all concavities carved.
        prism: one of them; others: the rest.
    """
    if not prism.endless or prism.through or not is_straight(prism):
        return prism
    pitch = prism.lattice.pitch
    width = 2 * np.sqrt(prism.area / np.pi) / pitch
    reached = _reached(scene, prism, core_of(prism), others, width)
    if not len(reached) or np.isfinite(reached).mean() < _MOSTLY:
        return prism
    ends = _reached(scene, prism, prism.outline, others, width)
    depth = float(ends[np.isfinite(ends)].max()) * pitch
    logger.info("hole of area %.4f without a floor: %.4f deep to where it meets another, not %.4f",
                prism.area, depth, prism.depth)  # fmt: skip
    return replace(prism, depth=max(depth, prism.depth), through=True, endless=False)


def _reached(scene: Scene, prism: Prism, cells: NDArray[np.bool_], others: Sequence[Prism], most: float) -> Array:
    """(N,) depth, in cells, at which lines down from cells (R, C) come into another hole, infinite where they don't.

    At `most` so many cells of solid lie between that and the hole's end.
    """
    starts, pitch = prism.lattice.centers()[cells], prism.lattice.pitch
    crossings, _ = crossings_below(scene, starts, prism.lattice)
    floor = prism.depth / pitch
    beyond = np.sort(np.where(crossings > floor - _AT_FLOOR_CELLS, crossings, np.inf), axis=1)
    first, second = np.pad(beyond, ((0, 0), (0, 2)), constant_values=np.inf)[:, :2].T
    # a line that does not meet the floor is in the open there already
    end = np.where(first <= floor + _AT_FLOOR_CELLS, second, floor)
    end = np.where(end - floor <= most, end, np.inf)
    found = np.flatnonzero(np.isfinite(end))
    places = starts[found] - ((end[found] + _WITHIN_CELLS) * pitch)[:, None] * prism.lattice.normal
    within = np.zeros(len(found), bool)
    for other in others:
        within |= other.signed_distance(places, 0.0) < _WITHIN_CELLS * pitch
    end[found[~within]] = np.inf
    return end
