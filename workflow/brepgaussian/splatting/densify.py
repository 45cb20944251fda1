"""Densification and pruning: split surfels that the images pull at hardest, drop those that show nothing."""

import numpy as np

from brepgaussian.splatting.library import Cloud, Floats
from brepgaussian.splatting.parameters import Parameters

PRUNE_OPACITY = 0.05  # fainter surfels are dropped (3DGS: 0.005; opaque parts need no faint ones)
SPLIT_SHRINK = 1.6  # a split surfel's halves are this much smaller (3DGS)
_SPLIT_OFFSET = 0.7  # of the larger standard deviation, to either side along its axis


class Statistics:
    """What training tells about each surfel between two densifications."""

    def __init__(self, count: int) -> None:
        self.pull = np.zeros(count)  # summed length of the gradient of the projected centre
        self.views = np.zeros(count)  # how many views saw it
        self.weight = np.zeros(count)  # summed compositing weight

    def add(self, screen: Floats, weights: Floats) -> None:
        """Take in one view's screen gradients (N, 2) and summed weights (N,)."""
        self.pull += np.linalg.norm(screen, axis=1)
        self.views += weights > 0
        self.weight += weights


def densify(parameters: Parameters, statistics: Statistics, share: float, smallest: float, limit: int) -> Parameters:
    """Split the `share` of surfels with the largest mean pull and prune unseen and faint ones.

    Args:
        parameters: surfels in training.
        statistics: gathered since the last call.
        share: of the surfels to split, at most.
        smallest: surfels whose larger standard deviation is below this are not split, unit frame.
        limit: no more surfels than this.
    """
    mean = statistics.pull / np.maximum(statistics.views, 1)
    large = parameters.cloud.scales.max(axis=1) > smallest
    keep = (parameters.cloud.opacities > PRUNE_OPACITY) & (statistics.weight > 0)
    if not keep.any():
        return parameters
    wanted = min(int(share * len(parameters)), max(limit - int(keep.sum()), 0))
    split = np.zeros(len(parameters), bool)
    split[np.argsort(-np.where(large & keep, mean, -1.0), kind="stable")[:wanted]] = True
    split &= large & keep
    halves = [_half(parameters, np.flatnonzero(split), side) for side in (-1, 1)]
    return join([parameters.select(keep & ~split), *halves])


def _half(parameters: Parameters, rows: np.ndarray, side: int) -> Parameters:
    """One half of split surfels: moved along the longer axis, that axis shortened."""
    part = parameters.select(rows)
    axes = part.surfels().axes if len(rows) else np.zeros((0, 3, 3), np.float32)
    longer = part.cloud.scales.argmax(axis=1)
    index = np.arange(len(rows))
    offset = _SPLIT_OFFSET * part.cloud.scales[index, longer, None] * axes[index, :, longer]
    scales = part.cloud.scales.copy()
    scales[index, longer] /= SPLIT_SHRINK
    part.replace("centers", part.cloud.centers + side * offset)
    part.replace("scales", scales)
    for moments in (part.first, part.second):  # new surfels start without history
        for values in moments.values():
            values[:] = 0
    return part


def join(parts: list[Parameters]) -> Parameters:
    """One cloud of several, in order."""

    def together(arrays: list[Floats]) -> Floats:
        return np.ascontiguousarray(np.concatenate(arrays))

    cloud = Cloud(*(together(list(group)) for group in zip(*(p.cloud.arrays() for p in parts), strict=True)))
    names = list(parts[0].raw)
    values = {
        kind: {n: together([getattr(p, kind)[n] for p in parts]) for n in names} for kind in ("raw", "first", "second")
    }
    return Parameters(cloud, **values, step=parts[0].step)


def reset_opacities(parameters: Parameters, highest: float) -> None:
    """Lower opacities to at most `highest`, so that surfels that nothing needs fade (3DGS)."""
    parameters.replace("opacities", np.minimum(parameters.cloud.opacities, np.float32(highest)))
    for moments in (parameters.first, parameters.second):
        moments["opacities"][:] = 0
