"""Floors that seem to lie deeper as a whole.

An opening that takes up all of a floor is no other concavity: it is the depth of the first one, measured once more by
the few rays that reach it, of which those along its border show walls as well. All rays through the mouth decide.
"""

from dataclasses import replace

import numpy as np
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.depth import looked_into
from brepgaussian.splatting.concave.openings import Images, across
from brepgaussian.splatting.concave.prism import Prism, carried
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.shapes import SURE, Opening, Shape

_WHOLE = 0.9  # of a floor's cells are open; a narrower hole leaves a shoulder
_BELT_CELLS = 5  # around the mouth
_OFF_CELLS = 0.5  # over the mouth its views are asked
_RAYS = 60_000
_CLEAR_CELLS = -0.5  # by which the mouth is drawn too wide, at most

logger = log.get_logger("stage1")


def is_whole(floor: Prism, prism: Prism) -> bool:
    """Whether a concavity in a floor takes up all of it."""
    below = carried(floor.lattice, floor.outline, prism.lattice)
    return bool((prism.outline & below).sum() >= _WHOLE * below.sum())


def surely_deeper(images: Images, scene: Scene, floor: Prism, prism: Prism) -> bool:
    """Whether rays through a concavity's mouth surely disagree less on a floor that lies deeper.

    Args:
        images: of all views.
        scene: the hull, the concavity carved.
        floor: the concavity.
        prism: what its floor seems to be open to.
    """
    lattice = floor.lattice
    around = ndimage.binary_dilation(floor.outline, iterations=_BELT_CELLS)
    stack = across(images, scene, lattice, np.asarray(around), _OFF_CELLS)
    looked = looked_into(stack, floor.outline, images.views.cameras.centers, scene)
    if looked is None:
        return False
    rays, ends, breaks = looked
    deep = (floor.depth + prism.depth) / lattice.pitch
    opening = Opening(rays, _RAYS, floor.outline, (max(ends[-1], deep),), images.tolerance, breaks)
    opening.keep_clear(_CLEAR_CELLS)
    sink, step = floor.sink / lattice.pitch, floor.step / lattice.pitch
    flat = Shape(floor.depth / lattice.pitch, draft=floor.draft, tilt=floor.tilt, sink=sink, step=step)
    deeper = replace(flat, depth=deep, through=prism.through)
    told = opening.advantage(opening.costs(flat), opening.costs(deeper))
    logger.info(
        "floor of area %.4f, %.4f deep, deeper by %.4f: by %.1f standard errors%s",
        prism.area, floor.depth, prism.depth, told, "" if told > SURE else ", not believed",
    )  # fmt: skip
    return told > SURE
