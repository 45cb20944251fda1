"""What may be the tops of bosses in a pocket: places on planes between its floor and its rim about which views agree.

They agree about a narrow top at its own height and less above and below; in the middle of a wide one they do so on
many planes, but the floor behind it is hidden.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.morphology import convex_hull_image

from brepgaussian.splatting.concave.openings import SURFACE_SHARE, Images, across
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.scene import Scene

Array = NDArray[np.float64]
Cells = NDArray[np.bool_]

_HIDING_CELLS = 2  # half the width of what hides the floor, at least
_AGREED = (0.9, SURFACE_SHARE, 0.7)  # share of a cell's views that agree on a wide top
_AT_PEAK = 0.8  # the same of a narrow one,
_PEAK = 0.12  # by how much less they do above and below,
_BESIDE_PLANES = (4, 5, 6)  # planes off,
_LEAST_MEAN_PEAK = 0.2  # and on average: true tops had .25-.45, what one grey makes of a floor mostly less
_BLUR_CELLS = 1.0  # agreement of single cells is noisy
_FAINTEST = 1e-3  # weight of what lies within the pocket, where it is divided by
_SOLID = 0.6  # of what a top spans: less is no boss with a hole but one of another form
LEAST_HEIGHT_CELLS = 4.0  # of a boss, and from its top to the rim: floors are told to a cell or two
_LEAST_CELLS, _LEAST_WIDE_CELLS = 49, 169  # of a narrow top, and of a wide one
_STEP_CELLS = 0.75  # between the planes: farther than half of that from a top, views agree about it less
_THIN_CELLS = 1  # half the width of what joins a top to a wall about which views agree as well
_BROKEN_CELLS = 3  # half the width of a gap in a top around a hole, where few views see it
COMPACT_CELLS, _NARROW_CELLS = 4, 3  # half the width of a wide top and of a narrow one, holes in it filled
_BLURRED_CELLS = 3  # along a pocket's walls views disagree about its floor
_WIDER_CELLS = 12  # a top is wider than what hides the floor, where both have one grey
_GAP_CELLS, RING_CELLS, BAND_CELLS = 1, 3, 2  # blur beside a top, what is looked at around it, and within
_FREE_SHARE = 0.25  # of the ring is no wall of the pocket: in a corner it is a half
_RING_SHARE, _WIDE_RING_SHARE = 0.55, 0.7  # of the ring around narrow and wide tops is not what it seems to be: around
# true ones .6-.85, mostly less than .5 elsewhere; on a plane too low the ring of a wide one is on its walls
_HIDDEN_SHARE = 0.5  # of a wide top hides the floor


@dataclass(frozen=True)
class Top:
    """Cells (R, C) of a plane at a `depth` below the rim; `contrast` of agreement within their border and beyond."""

    outline: Cells
    depth: float
    contrast: float


def tops(images: Images, cut: Scene, prism: Prism) -> tuple[list[Top], list[Top]]:
    """What may be the narrow, and the wide tops of bosses, on all planes between floor and rim."""
    hidden = _hidden(images, cut, prism)
    if not hidden.any():
        return [], []
    pitch, within = prism.lattice.pitch, prism.outline
    depths = np.arange(LEAST_HEIGHT_CELLS * pitch, prism.depth - LEAST_HEIGHT_CELLS * pitch, _STEP_CELLS * pitch)
    stacks = (across(images, cut, prism.lowered(float(depth)), within) for depth in depths)
    agreement = np.stack([stack.agreement for stack in stacks]).astype(np.float32)  # (D, R, C)
    near = within & ndimage.binary_dilation(hidden, iterations=_WIDER_CELLS)
    clear = ndimage.binary_erosion(within, iterations=_BLURRED_CELLS)
    weight = np.maximum(ndimage.gaussian_filter(within.astype(float), _BLUR_CELLS), _FAINTEST)
    narrow: list[Top] = []
    wide: list[Top] = []
    for k, depth in enumerate(depths):
        beside = [j for off in _BESIDE_PLANES for j in (k - off, k + off) if 0 <= j < len(depths)]
        peak = agreement[k] - agreement[beside].mean(axis=0) if beside else np.zeros_like(agreement[k])
        peaks = _peaks(agreement[k], peak, within, weight)
        over_hidden = _over_hidden(agreement[k], near, hidden, clear)
        for found, outlines, least in ((narrow, peaks, _RING_SHARE), (wide, over_hidden, _WIDE_RING_SHARE)):
            candidates = (_top(agreement[k], within, o, float(depth), least) for o in outlines)
            found += [top for top in candidates if top is not None]
    return narrow, wide


def _hidden(images: Images, cut: Scene, prism: Prism) -> Cells:
    """(R, C) cells of a pocket's floor that views show something else at, or do not show: bosses may stand there."""
    lattice = prism.lowered(prism.depth)
    inner = ndimage.binary_erosion(prism.outline, iterations=_BLURRED_CELLS)
    hidden = inner & (across(images, cut, lattice, prism.outline).agreement < SURFACE_SHARE)
    return np.asarray(ndimage.binary_opening(hidden, iterations=_HIDING_CELLS))


def _top(agreement: Array, within: Cells, outline: Cells, depth: float, least: float) -> Top | None:
    """A region (R, C) as a top, if about at least that share of what is around it views agree (R, C) less."""
    around = _ring(outline)
    ring = around & within  # a boss may stand against a wall, or in a corner
    if ring.sum() < _FREE_SHARE * around.sum() or (agreement[ring] < SURFACE_SHARE).mean() < least:
        return None
    band = outline & ~ndimage.binary_erosion(outline, iterations=BAND_CELLS)  # there may be a hole within
    return Top(outline, depth, float(agreement[band].mean() - agreement[ring].mean()))


def _ring(outline: Cells) -> Cells:
    """(R, C) what lies around an outline, clear of its blur."""
    blurred = ndimage.binary_dilation(outline, iterations=_GAP_CELLS)
    return np.asarray(ndimage.binary_dilation(blurred, iterations=RING_CELLS) & ~blurred)


def _over_hidden(agreement: Array, near: Cells, hidden: Cells, clear: Cells) -> Iterator[Cells]:
    """Regions about which views agree (R, C), `near` `hidden` floor and over it, `clear` of the walls: wide tops.

    In the middle of a wide one views agree on planes above and below it, too.
    """
    for least in _AGREED:
        agreed = ndimage.binary_opening((agreement >= least) & near, iterations=_THIN_CELLS)
        for broken in (0, _BROKEN_CELLS):
            whole = ndimage.binary_closing(agreed, iterations=broken) if broken else agreed
            for outline in _compact(whole, COMPACT_CELLS):
                if outline.sum() < _LEAST_WIDE_CELLS:
                    continue
                if clear[outline].any() and hidden[outline & clear].mean() >= _HIDDEN_SHARE:
                    yield outline


def _peaks(agreement: Array, peak: Array, within: Cells, weight: Array) -> Iterator[Cells]:
    """Regions (R, C) of a pocket about which views agree, and by a `peak` less so above and below: narrow tops.

    Weight: (R, C) of what lies within the pocket, in a blur.
    """
    smooth, clear = (ndimage.gaussian_filter(np.where(within, a, 0.0), _BLUR_CELLS) / weight for a in (agreement, peak))
    agreed = ndimage.binary_opening(within & (smooth >= _AT_PEAK) & (clear >= _PEAK), iterations=_THIN_CELLS)
    for region in _compact(ndimage.binary_closing(agreed, iterations=_BROKEN_CELLS), _NARROW_CELLS):
        convex = convex_hull_image(region) & within
        gap = ndimage.binary_opening(convex & ~region, iterations=_NARROW_CELLS)  # of a screw hole in a corner
        outline = convex if gap.any() and region.sum() >= _SOLID * convex.sum() else region
        if peak[outline].mean() >= _LEAST_MEAN_PEAK and outline.sum() >= _LEAST_CELLS:
            yield outline


def _compact(cells: Cells, half_width: int) -> Iterator[Cells]:
    """Its regions (R, C), holes in them filled, without what is narrower than twice `half_width`."""
    labels, count = ndimage.label(ndimage.binary_opening(ndimage.binary_fill_holes(cells), iterations=half_width))
    yield from (labels == k for k in range(1, count + 1))
