"""Corners that were cut out of a lid before the pocket under it was found: what they leave beside it is filled again.

On a lid that views refute by far nearly any room under it explains them better. Once the pocket is open, they tell
what of that room is none of it.
"""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.agreement import better, disagreements
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.volume import Volume

_LEAST_VOXELS = 30  # of a room: less is the roughness of its walls
_MOST_TRIED = 6  # rooms, largest first
_GAIN = 0.9  # of the disagreement is left at most by a room that stays open
_REACH_VOXELS = 1.0  # rays that a room changes by less don't judge it
_LEAST_RAYS = 5  # that do, to keep it open

logger = log.get_logger("stage1")


def refilled(images: Images, before: Volume, cornered: Volume, now: Volume, prisms: Sequence[Prism]) -> Volume:
    """A hull without the rooms in it that only corners had cut out, where views agree no better on them.

    Args:
        images: of all views.
        before, cornered: the hull before and after corners were cut out.
        now: after concavities were opened.
        prisms: the concavities.
    """
    if cornered is before:
        return now
    whole = before
    for prism in prisms:
        whole = whole.without(prism, before.margin(prism))
    closed = np.where(cornered.field < before.field, np.maximum(now.field, whole.field), now.field)
    labels, _ = ndimage.label((closed > 0) & (now.field <= 0))
    sizes = np.bincount(labels.ravel())[1:]
    largest = [k for k in np.argsort(-sizes, kind="stable")[:_MOST_TRIED] if sizes[k] >= _LEAST_VOXELS]
    if not largest:
        return now
    scene = now.scene()
    for k in largest:
        room = ndimage.binary_dilation(labels == k + 1)
        filled = now.with_field(np.where(room, closed, now.field))
        outer = filled.scene()
        said = disagreements(images, outer, scene, _REACH_VOXELS * now.spacing)
        open_ = better(said, _GAIN, _LEAST_RAYS, untold=False)
        logger.info(
            "room of %d voxels that a corner has left: views disagree by %.2f for %.2f if it is filled, %d rays%s",
            sizes[k], said[1], said[0], said[2], "" if open_ else ": filled",
        )  # fmt: skip
        if not open_:
            now, scene = filled, outer
    return now
