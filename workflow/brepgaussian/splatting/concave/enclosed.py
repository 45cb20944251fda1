"""Openings about which views need not disagree: a step in their common grey encloses them."""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.splatting.concave.openings import BORDER_CELLS, OPENING_CELLS, Stack, agreed

_ISLAND_SHARE = 0.5  # of a boss's top is face; in the rest a hole may be
_RIM_SLOPE = 0.3  # tolerances per cell: a step of two grey levels, blurred by a cell, is steeper
_RIM_CELLS = 2  # half the width of a blurred rim,
_MOST_RIM_CELLS = 3  # and cells more where it is blurred by more
_SAME_SHARE = 0.75  # of two outlines together, that both have, if they are of one opening


def enclosed(stack: Stack, least_area: float, tolerance: float) -> list[NDArray[np.bool_]]:
    """(R, C) outlines of regions that a step in the views' common grey encloses, whether or not views disagree.

    An opening's rim lies on the plane, so that all views show it in one place; edges behind it smear out. A bore
    under a bright floor may look the same from everywhere, but for its rim.
    """
    seen = np.isfinite(stack.grey).any(axis=0)
    flat = (stack.slope < _RIM_SLOPE * tolerance) & seen & stack.domain
    labels, count = ndimage.label(ndimage.binary_erosion(flat))
    border = ndimage.binary_dilation(~stack.domain | ~seen, iterations=int(BORDER_CELLS) + 1)
    border[[0, -1]] = border[:, [0, -1]] = True
    found = []
    for k in range(1, count + 1):
        region = ndimage.binary_opening(labels == k, iterations=OPENING_CELLS - 1)
        outline = ndimage.binary_fill_holes(ndimage.binary_dilation(region, iterations=_RIM_CELLS))
        area = outline.sum() * stack.lattice.pitch**2
        if area >= least_area and not (outline & border).any():
            found.append(outline)
    return found


def to_rims(
    stack: Stack, regions: Sequence[NDArray[np.bool_]], known: Sequence[NDArray[np.bool_]]
) -> list[NDArray[np.bool_]]:
    """`enclosed` regions (R, C) that no outline (R, C) is known for, widened to where the grey changes most.

    On a floor that walls light, a rim is blurred by more than a few cells.
    """
    found = []
    for region in regions:
        wide = [ndimage.binary_dilation(region, iterations=k) for k in range(_MOST_RIM_CELLS + 1)]
        rings = [outer & ~inner for inner, outer in itertools.pairwise(wide)]
        best = wide[1 + int(np.argmax([stack.slope[ring].mean() if ring.any() else 0.0 for ring in rings]))]
        if not any((best & other).sum() > _SAME_SHARE * (best | other).sum() for other in known):
            found.append(best)
    return found


def beside_islands(
    stack: Stack, floor: NDArray[np.bool_], regions: Sequence[NDArray[np.bool_]]
) -> list[NDArray[np.bool_]]:
    """(R, C) outlines of a floor (R, C) without what stands in it: bosses that end below the pocket's rim.

    Bosses are those of the `enclosed` regions (R, C) about which views agree.

    Rays that pass a boss's top tell no deeper floor, so the pocket was opened down to it. There the boss is enclosed
    by a step in grey, and views agree about it; about what lies beside it they may agree as well, if it has one grey.
    """
    floor = floor & stack.domain
    found = [region for region in regions if float(agreed(stack, region).mean()) >= _ISLAND_SHARE]
    islands = [one for one in found if not any(one is not other and (one & ~other).sum() == 0 for other in found)]
    together = [np.any(islands, axis=0)] if len(islands) > 1 else []
    return [floor & ~island for island in [*together, *islands]]
