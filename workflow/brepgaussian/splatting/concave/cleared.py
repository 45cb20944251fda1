"""The room of a corner cut out of a hull: as far as views agree better, and past ends that are none."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from brepgaussian import log
from brepgaussian.splatting.concave.agreement import better, disagreements
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.planes import Plane
from brepgaussian.splatting.concave.rooms import Corner
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume

PARALLEL = 0.996  # cosine of 5 degrees: a piece of a face in the hull may lean so from the face, or from its other side
_GAIN_LONGER = 0.6  # of the disagreement is left at most by a corner without an end: true .37, false 4 times as much
_MARGIN_VOXELS = 2.0  # above its lid a corner is cut out,
_FINS_VOXELS = (np.inf, 8.0)  # and then, as far as the views allow
_REACH_VOXELS = 2.0  # rays on which a corner changes less than this don't judge what it cuts
_LEAST_RAYS = 20  # that do

logger = log.get_logger("stage1")


def cleared(
    images: Images, hull: Volume, scene: Scene, corner: Corner, gain: float
) -> tuple[Corner, Volume, Scene] | None:
    """A corner, the hull without its room, and the hull's surface; None if views agree little better then.

    Args:
        images: of all views.
        hull: with the room still filled.
        scene: its surface.
        corner: under a lid of the hull.
        gain: share of the views' disagreement that may be left.
    """
    opened = corner.cut_out(hull, _MARGIN_VOXELS * hull.spacing)
    after = opened.scene()
    if not _agreeable(images, scene, after, hull.spacing, gain):
        return None
    corner, opened, after = _without_ends(images, opened, after, corner)
    return corner, *_without_fins(images, opened, after, corner, gain)


def on_known(corner: Corner, planes: Sequence[Plane], reach: float) -> Corner:
    """A corner whose floors lie on faces that views have confirmed, where they are so near: these are known better."""
    normals, offsets = corner.normals.copy(), corner.offsets.copy()
    for k in range(corner.floors):
        alike = [p for p in planes if p.normal @ normals[k] > PARALLEL and abs(p.offset - offsets[k]) < reach]
        if alike:
            nearest = min(alike, key=lambda p: abs(p.offset - corner.offsets[k]))
            normals[k], offsets[k] = nearest.normal, nearest.offset
    return replace(corner, normals=normals, offsets=offsets)


def _without_ends(images: Images, opened: Volume, scene: Scene, corner: Corner) -> tuple[Corner, Volume, Scene]:
    """A corner, the hull, and its surface, without ends at which there is no rib: the lid ends there, not the room."""
    for k in range(corner.floors, len(corner.offsets)):
        offsets = np.where(np.arange(len(corner.offsets)) == k, -np.inf, corner.offsets)
        longer = replace(corner, offsets=offsets)
        further = longer.cut_out(opened, _MARGIN_VOXELS * opened.spacing)
        if (further.field < opened.field).any():
            after = further.scene()
            if _agreeable(images, scene, after, opened.spacing, _GAIN_LONGER):
                corner, opened, scene = longer, further, after
    return corner, opened, scene


def _without_fins(images: Images, opened: Volume, scene: Scene, corner: Corner, gain: float) -> tuple[Volume, Scene]:
    """A hull, and its surface, without what it has left over a corner's floors: above the lid there are more facets."""
    for margin in _FINS_VOXELS:
        bare = corner.cut_out(opened, margin * opened.spacing)
        if (bare.field < opened.field).any():
            after = bare.scene()
            if _agreeable(images, scene, after, opened.spacing, gain):
                return bare, after
    return opened, scene


def _agreeable(images: Images, before: Scene, after: Scene, spacing: float, gain: float) -> bool:
    """Whether views agree better on all that a corner changes: it may reach beyond its lid, into other faces."""
    said = disagreements(images, before, after, _REACH_VOXELS * spacing)
    good = better(said, gain, _LEAST_RAYS, untold=False)
    logger.info(
        "corner cut out: views disagree by %.2f for %.2f of the hull, %d rays%s",
        said[1], said[0], said[2], "" if good else ": not believed",
    )  # fmt: skip
    return good
