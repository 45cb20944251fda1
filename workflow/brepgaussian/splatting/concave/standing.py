"""Recesses around what stands out of them: a hub that rises past the rim hides its foot; hulls fill the corner."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.splatting.concave.contours import chords_in, lost_share
from brepgaussian.splatting.concave.openings import Images, Stack, is_framed
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.scene import Scene

Outline = NDArray[np.bool_]

_STEP_CELLS = 1.0  # between the heights at which the hull over a face is looked at
_SECTIONS = (0.35, 0.65, 0.95)  # of what stands: near its top a hull is not widened by the corner that it fills
_TOUCH_CELLS = 3  # between what stands and where views disagree
_OPENING_CELLS = 3  # a recess narrower than twice this is not told from blur
_HIGHEST = 0.5  # unit frame, that a hub stands out of its rim
_BLUR_CELLS = 2  # beside an outline: a cell of its own, and a pixel of the contours that bound what stands
_MOST_LOST = 0.01  # share of the rays through what fills the corner that it may leave with nothing


def around_hubs(stack: Stack, scene: Scene, images: Images, least_area: float) -> list[tuple[Outline, float]]:
    """Outlines (R, C) of recesses without what stands in them, and how high the hull stands over each.

    What stands there is as wide as the hull some way up, so several outlines of one recess are to try.

    Args:
        stack: what the views show on the rim's plane.
        scene: the hull.
        images: whose silhouettes have to stay filled.
        least_area: of a recess.
    """
    standing = ndimage.binary_fill_holes(stack.domain) & ~stack.domain
    open_cells = stack.refuted
    labels, count = ndimage.label(standing)
    beside = ndimage.binary_dilation(open_cells, iterations=_TOUCH_CELLS)
    hubs = [labels == k for k in range(1, count + 1) if (beside & (labels == k)).any()]
    if not hubs:
        return []
    whole = ndimage.binary_fill_holes(open_cells | np.any(hubs, axis=0))
    recesses, count = ndimage.label(ndimage.binary_opening(whole, iterations=_OPENING_CELLS))
    found: list[tuple[Outline, float]] = []
    for k in range(1, count + 1):
        recess = recesses == k
        inside = [hub for hub in hubs if (hub & recess).any()]
        if not inside or not is_framed(stack, recess):
            continue
        foot = np.any(inside, axis=0)
        top = _top(stack, scene, foot)
        for share in _SECTIONS:
            outline = recess & ~_section(stack, scene, recess | foot, share * top)  # the foot is narrower than the hub
            if (outline & stack.domain).sum() * stack.lattice.pitch**2 >= least_area:
                found.append((outline, top))
    return _filling(found, stack, scene, images)


def standing_free(outlines: list[Outline], stack: Stack, scene: Scene, images: Images) -> list[Outline]:
    """Outlines (R, C) in which nothing stands out of the plane that silhouettes show: under it nothing is open."""
    standing = ndimage.binary_fill_holes(stack.domain) & ~stack.domain
    tops = [_top(stack, scene, outline & standing) if (outline & standing).any() else 0.0 for outline in outlines]
    tall = [(outline, top) for outline, top in zip(outlines, tops, strict=True) if top > 0]
    filling = [outline for outline, _ in _filling(tall, stack, scene, images)]
    return [o for o, top in zip(outlines, tops, strict=True) if top == 0 or any(o is other for other in filling)]


def _filling(
    found: list[tuple[Outline, float]], stack: Stack, scene: Scene, images: Images
) -> list[tuple[Outline, float]]:
    """Those over which nothing stands that silhouettes show; not what is as narrow as blur."""
    cores = [ndimage.binary_erosion(outline, iterations=_BLUR_CELLS) for outline, _ in found]
    sure = [(core, *pair) for core, pair in zip(cores, found, strict=True) if core.any()]
    if not sure:
        return []
    chords = chords_in(scene, *images.contour_rays)
    over = [chords.within(Prism(stack.lattice, core, 0.0, False, 0.0), top) for core, _, top in sure]
    return [
        (outline, top)
        for (_, outline, top), removed in zip(sure, over, strict=True)
        if lost_share(chords, removed) <= _MOST_LOST
    ]


def _top(stack: Stack, scene: Scene, foot: Outline) -> float:
    """How high the hull stands over cells of the plane."""
    step = _STEP_CELLS * stack.lattice.pitch
    top = 0.0
    while top + step < _HIGHEST and _section(stack, scene, foot, top + step).any():
        top += step
    return top


def _section(stack: Stack, scene: Scene, within: Outline, height: float) -> Outline:
    """(R, C) cells over which the hull is solid at some height."""
    solid = np.zeros(within.shape, bool)
    cells = stack.lattice.centers()[within] + height * stack.lattice.normal
    solid[within] = scene.inside(cells)
    return solid
