"""Narrow round holes: a few pixels wide, they are told by their rims, and by finer cells than others.

Blur takes so much of them that rays contradict their walls, too: what is contradicted so often elsewhere is a dent. But
that all views show a circle on the face, and within it nothing that lies on the face, leaves a hole alone.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.splatting.concave.depth import measure
from brepgaussian.splatting.concave.draw import circle
from brepgaussian.splatting.concave.openings import Images, Stack, rectify
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.rims import rim_of
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.sections import Rounded, Section

_NARROW = 16.0  # cells; wider holes are told as they are
_FINER, _AROUND_CELLS = 2, 6  # cells to one, and the face around that is looked at
_STEEP = 0.5  # tolerances per cell
_COMPACT = 0.6  # of the circle about a region's middle that holds it
_TOLD = 0.5  # of the rim, for it to be a circle: in a corner few views see more
MOST_AGAINST = 0.22  # of the rays contradict one at most: blind holes 15 px wide had .11 to .2
_LEAST_CELLS = 7.0  # deep; what is shallow is told as it is, too


def is_narrow(outline: NDArray[np.bool_]) -> bool:
    """Whether the cells (R, C) of an opening are so few that blur takes much of it."""
    return int(np.count_nonzero(outline)) < _NARROW**2


def ringed(stack: Stack, least_area: float, tolerance: float) -> list[NDArray[np.bool_]]:
    """(R, C) outlines of narrow compact regions that a step in the views' common grey surrounds, whatever lies within.

    Args:
        stack: what the views show on a face.
        least_area: of an outline.
        tolerance: grey levels by which views of one place may differ.
    """
    steep = ndimage.binary_fill_holes((stack.slope > _STEEP * tolerance) & stack.domain)
    labels, count = ndimage.label(ndimage.binary_opening(steep))
    found = []
    for k in range(1, count + 1):
        outline = ndimage.binary_erosion(labels == k)  # the step is blurred to both sides
        area = np.count_nonzero(outline)
        if not least_area <= area * stack.lattice.pitch**2 or not is_narrow(outline):
            continue
        cells = np.argwhere(outline)
        reach = np.linalg.norm(cells - cells.mean(axis=0), axis=1).max()
        if area >= _COMPACT * np.pi * reach**2:
            found.append(outline)
    return found


def drilled(images: Images, scene: Scene, stack: Stack, outline: NDArray[np.bool_]) -> tuple[Prism, float] | None:
    """A hole under a narrow opening with a round rim, with what it explains, as `measure` gives them; None if none.

    Args:
        images: of all views.
        scene: the hull.
        stack: what the views show on the opening's plane.
        outline: (R, C) cells of the opening.
    """
    count = np.count_nonzero(outline)
    if not is_narrow(outline) or stack.relief[outline].any():
        return None
    taken, centers = images.as_taken, images.views.cameras.centers
    rough = circle([*np.argwhere(outline).mean(axis=0), float(np.sqrt(count / np.pi))])
    rim = rim_of(rough, stack, centers, images.tolerance, _TOLD)
    if rim is None or rim.told < _TOLD or not _is_round(rim.section):
        return None
    lattice, reach = stack.lattice, rim.section.shape.reach + _AROUND_CELLS
    middle = np.array(rim.section.center)
    low, high = np.floor(middle - reach).astype(int), np.ceil(middle + reach).astype(int)
    fine, places = lattice.finer(low, high, _FINER)
    inside = rim.section.signed_distance(places) < 0
    found = measure(rectify(taken, scene, fine), inside, centers, scene, taken.tolerance, MOST_AGAINST)
    if found is None or found[0].depth < _LEAST_CELLS * lattice.pitch:
        return None
    cells = rim.section.signed_distance(np.moveaxis(np.indices(outline.shape), 0, -1).astype(float)) < 0
    return replace(found[0], lattice=lattice, outline=cells, section=rim.section), found[1] / _FINER**2


def _is_round(section: Section) -> bool:
    shape = section.shape
    return isinstance(shape, Rounded) and min(shape.half) <= shape.radius
