"""The two mouths of a round hole, each seen in part: a chamfer as bright as its face refutes no lid."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from brepgaussian import log
from brepgaussian.geometry.circles import circle_next_to
from brepgaussian.splatting.concave.draw import border_of
from brepgaussian.splatting.concave.prism import Lattice, Prism, carried

Array = NDArray[np.float64]
Outline = NDArray[np.bool_]
Measure = Callable[[Lattice, Outline], tuple[Prism, float] | None]

logger = log.get_logger("stage1")

_OPPOSITE = 0.999  # cosine of 2.5 degrees
_OVERLAP = 0.7  # of the smaller outline lies under the other one
_LOPSIDED = 1.05  # area of both together over the larger one's
_TRIALS = 200  # circles through three places of a border
_NEAR_CELLS = 1.0  # from the circle, to lie on it
_ROUND_SHARE = 0.6  # of the border on the circle


def completed(found: list[tuple[Prism, float]], measure: Measure) -> list[tuple[Prism, float]]:
    """The same concavities, but the mouths of a round hole through the part have the outline that both show together.

    Args:
        found: concavities and what each explains.
        measure: of an outline on a lattice, to look again.
    """
    result = list(found)
    for i in range(len(found)):
        for j in range(i + 1, len(found)):
            pair = result[i][0], result[j][0]
            disc = _common_disc(*pair)
            if disc is None:
                continue
            again = [measure(prism.lattice, carried(pair[0].lattice, disc, prism.lattice)) for prism in pair]
            through = [new for new in again if new is not None and new[0].through]
            if len(through) == 2 and sum(gain for _, gain in through) > result[i][1] + result[j][1]:
                logger.info("two mouths of a round hole: areas %.4f and %.4f", *(prism.area for prism, _ in through))
                result[i], result[j] = through
    return result


def _common_disc(first: Prism, second: Prism) -> Outline | None:
    """The disc, on the first's lattice, that both mouths show in part; None if they are no such mouths."""
    if not (first.through and second.through) or any(first.tilt) or any(second.tilt):
        return None
    if first.lattice.normal @ second.lattice.normal > -_OPPOSITE:
        return None
    other = carried(second.lattice, second.outline, first.lattice)
    both, areas = first.outline | other, (first.outline.sum(), other.sum())
    if (first.outline & other).sum() < _OVERLAP * min(areas) or both.sum() < _LOPSIDED * max(areas):
        return None
    return _disc(both)


def _disc(outline: Outline) -> Outline | None:
    """The disc of which an outline shows most of the rim, or None."""
    border = border_of(outline)
    rng = np.random.default_rng(0)
    best = np.zeros(len(border), bool)
    for _ in range(_TRIALS):
        middle, radius = circle_next_to(border[rng.choice(len(border), 3, replace=False)])
        near = np.abs(np.linalg.norm(border - middle, axis=1) - radius) < _NEAR_CELLS
        best = near if near.sum() > best.sum() else best
    if best.sum() < _ROUND_SHARE * len(border):
        return None
    middle, radius = circle_next_to(border[best])
    rows, columns = np.indices(outline.shape)
    return np.asarray(np.hypot(rows - middle[0], columns - middle[1]) <= radius)
