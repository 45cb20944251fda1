"""Holes that end where they leave the first wall: a port into a pocket need not go on through the wall behind it.

What shows through a port may have come in by the pocket. Only the wall behind tells whether it is open too.
"""

from dataclasses import replace

import numpy as np

from brepgaussian import log
from brepgaussian.splatting.concave.agreement import better, disagreements
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.rays import crossings_of
from brepgaussian.splatting.concave.volume import Volume

_THROUGH = 0.9  # of the opening has left the first wall where a hole through it ends
_LEAST_BEHIND = 0.1  # of the opening has another wall behind, or none
_ROOM_VOXELS = 3.0  # between two walls, and thickness of the second
_GAIN = 0.8  # the hole in the wall behind leaves at most this share of the disagreement

logger = log.get_logger("stage1")


def shortened(images: Images, hull: Volume, prism: Prism, margin: float) -> Prism:
    """A hole through all walls of a hull, or through the first one if the images speak no better for more.

    Args:
        images: of all views.
        hull: with all other concavities of its level carved.
        prism: a concavity; what does not go through stays as it is.
        margin: by which it is cut longer.
    """
    end, pierced = _first_end(hull, prism) if prism.through else (None, False)
    if end is None:
        return prism
    short = replace(prism, depth=end)
    first, both = hull.without(short, margin), hull.without(prism, margin)
    old, new, count = said = disagreements(images, first.scene(), both.scene(), 2 * hull.spacing)
    on = better(said, 1.0 if pierced else _GAIN, 1, untold=pierced)  # what silhouettes show needs no more than that
    logger.info(
        "hole through the first wall only (%.4f): views disagree by %.2f, by %.2f if it goes on, %d rays%s%s",
        end, old, new, count, ", open in a part of the hull" if pierced else "", ": it does" if on else "",
    )  # fmt: skip
    return prism if on else short


def _first_end(hull: Volume, prism: Prism) -> tuple[float | None, bool]:
    """Depth at which a hole has left the first wall, if there is room and another wall behind it; None = neither.

    And whether the hull is open behind as well, if only in a part of the outline: silhouettes show that.
    """
    lattice, room = prism.lattice, _ROOM_VOXELS * hull.spacing
    cells = lattice.centers()[prism.outline]
    ray = -lattice.normal + prism.tilt[0] * lattice.first + prism.tilt[1] * lattice.second
    crossings, inside = crossings_of(hull.scene(), cells, np.broadcast_to(ray, cells.shape), lattice.pitch)
    # where silhouettes have opened the first wall, rays are out of it from the start
    ordered = np.pad(crossings * lattice.pitch, ((0, 0), (1, 3)), constant_values=((0, 0), (0.0, np.inf)))
    out, again, back = np.take_along_axis(ordered, np.arange(3) + inside[:, None], axis=1).T
    with np.errstate(invalid="ignore"):
        behind = np.isfinite(back) & (again - out > room) & (np.minimum(back, prism.depth) - again > room)
    if behind.mean() < _LEAST_BEHIND:
        return None, False
    pierced = np.isinf(again).mean() >= _LEAST_BEHIND
    ends = out[behind & inside]
    end = float(np.quantile(ends, _THROUGH)) if len(ends) else float(again[behind].min()) / 2
    return end + lattice.pitch, bool(pierced)
