"""Notches: what two opposite faces have in common that belongs to neither, and is open to their side, is cut through.

Of a slot between fins silhouettes show the upper part; on its floor and in its corners a hull keeps what no camera
looks along. Both end faces show its section to a pixel, whatever lies between them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.morphology import convex_hull_image

from brepgaussian.geometry.pixels import inner_distance
from brepgaussian.log import get_logger
from brepgaussian.splatting.concave.agreement import changes, mean_cost
from brepgaussian.splatting.concave.contours import Chords, chords_in, lost_share
from brepgaussian.splatting.concave.draw import fitted
from brepgaussian.splatting.concave.openings import OPENING_CELLS, SURFACE_SHARE, Images, Stack, opened, rectify
from brepgaussian.splatting.concave.planes import PARALLEL, Plane, lattice_over, planar_regions
from brepgaussian.splatting.concave.prism import Prism, carried
from brepgaussian.splatting.concave.rims import rim_of
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.sweep import LEAST_AREA, MOST_LOST
from brepgaussian.splatting.concave.volume import Volume

Array = NDArray[np.float64]
Cells = NDArray[np.bool_]

_LEAST_WIDTH_CELLS = 2 * OPENING_CELLS + 1
_COMMON = 0.85  # of what either face shows of a notch, the other one shows: edges are told to a cell or so
_BLUR_CELLS = 2  # along its edges views seem to disagree about a face: cells of a notch are 1.5 to 3 too many
_CONFIRMED = 0.5  # of a lid's cells views agree about, for it to be a face
_AT_SIDE_CELLS = 3.0  # from where a face's convex hull ends: there a notch is open, and has no rim
_TOLD = 0.5  # of its rim views show, for it to say more than the cells
_LEAST_VOXELS = 100  # of what is left of a notch, to be worth a try
_REACH_VOXELS = 0.5  # rays that a cut changes by less don't judge it
_LEAST_RAYS = 60  # that judge it by the last figure,
_FEWEST_RAYS = 5  # and by whether they agree much worse; fewer don't, as hardly any view looks into a narrow one
_UNSEEN_VOXELS = 2000  # but they look into a large one that is open: 27000 and 57000 were none (cross_knob, scratch)
_SLABS = 12  # of a notch along its length; what stands in it is as long as one at least
_WORSE = 1.5  # times what rays disagree by, behind what stands in a slab: 2 to 7; in empty ones 1.2 at most
_GAIN = 1.0  # a cut leaves at most this share of their disagreement: that both ends are open speaks for it

logger = get_logger("stage1")


def open_notches(images: Images, hull: Volume, planes: Sequence[Plane]) -> tuple[Volume, list[Prism]]:
    """The hull without what is left of its notches, and these.

    Args:
        images: of all views.
        hull: with its channels cut.
        planes: of the faces that views have confirmed.
    """
    mesh = hull.mesh()
    regions = [r.on(planes, *mesh, 2 * hull.spacing) for r in planar_regions(*mesh, 2 * hull.spacing, planes)]
    regions = [r for r in regions if r.area(*mesh) >= LEAST_AREA]
    apart = [(a, b, float(a.offset + b.offset)) for a, b in combinations(regions, 2) if a.normal @ b.normal < -PARALLEL]
    faced = [(a, b, length) for a, b, length in apart if length >= 2 * hull.spacing]
    if not faced:
        return hull, []
    scene, footprint = Scene(*mesh), images.views.cameras.footprint()
    seen: dict[int, _Shown] = {}
    for region in (region for first, second, _ in faced for region in (first, second)):
        if id(region) not in seen:
            seen[id(region)] = _shown(rectify(images, scene, lattice_over(region, mesh, footprint)))
    chords: Chords | None = None
    done: list[Prism] = []
    for first, second, length in faced:
        for prism in _between(images, seen[id(first)], seen[id(second)], length):
            if any(_same(prism, other) for other in done):
                continue
            chords = chords_in(scene, *images.contour_rays) if chords is None else chords
            cut = _cut(images, hull, scene, prism, chords)
            if cut is not None:
                hull, scene = cut
                done.append(prism)
    return hull, done


@dataclass(frozen=True)
class _Shown:
    """A face as views show it: (R, C) cells about which they agree, their convex hull, and the notches in it."""

    stack: Stack
    face: Cells
    whole: Cells
    notches: list[Cells]


def _shown(stack: Stack) -> _Shown:
    """What views show on the lid of a hull: no notches if they do not agree about most of it."""
    agreed = stack.domain & (stack.agreement >= SURFACE_SHARE)
    face = np.asarray(ndimage.binary_opening(ndimage.binary_closing(agreed)))
    sure = agreed.sum() >= _CONFIRMED * stack.domain.sum() and face.any()
    whole = convex_hull_image(face) if sure else np.zeros_like(face)
    return _Shown(stack, face, whole, list(_notches(face, whole)))


def _between(images: Images, first: _Shown, second: _Shown, length: float) -> Iterator[Prism]:
    """The notches that both of two opposite faces show, from the first one on."""
    lattice = first.stack.lattice
    for notch in first.notches:
        there = carried(lattice, notch, second.stack.lattice)
        for candidate in second.notches:
            if (there & candidate).sum() >= _COMMON * max(there.sum(), candidate.sum()):
                yield _drawn(images, first, Prism(lattice, notch, length, True, 0.0))


def _notches(face: Cells, whole: Cells) -> Iterator[Cells]:
    """Regions (R, C) that a face leaves of its convex hull, open to its side."""
    labels, count = ndimage.label(opened(whole & ~face))
    beside = ndimage.binary_dilation(~np.pad(whole, 1), iterations=2)[1:-1, 1:-1]
    for k in range(1, count + 1):
        notch = labels == k
        if notch.sum() >= _LEAST_WIDTH_CELLS**2 and (notch & beside).any():
            yield notch


def _drawn(images: Images, shown: _Shown, notch: Prism) -> Prism:
    """A notch with the section that its cells are a drawing of, as exact as the views show its rim."""

    clear = notch.outline & ~ndimage.binary_dilation(shown.face, iterations=_BLUR_CELLS)
    told = replace(notch, outline=clear if clear.any() else notch.outline)  # by its cells
    section = fitted(notch.outline, opened)
    if section is None:
        return told
    within = inner_distance(shown.whole)

    def at_side(places: Array) -> Cells:
        return np.asarray(ndimage.map_coordinates(within, places.T, order=1, mode="nearest") < _AT_SIDE_CELLS)

    centers = images.views.cameras.centers
    rim = rim_of(section, shown.stack, centers, images.tolerance, _TOLD, at_side)
    if rim is None or rim.told < _TOLD or not rim.section.at_rim:
        return told
    return replace(notch, section=rim.section)


def _same(prism: Prism, other: Prism) -> bool:
    """Whether two notches are one, told by other faces."""
    if abs(prism.lattice.normal @ other.lattice.normal) < PARALLEL:
        return False
    there = carried(prism.lattice, prism.outline, other.lattice)
    return bool((there & other.outline).sum() >= _COMMON * min(there.sum(), other.outline.sum()))


def _cut(images: Images, hull: Volume, scene: Scene, prism: Prism, chords: Chords) -> tuple[Volume, Scene] | None:
    """The hull without it, and its surface; None if little goes, silhouettes lose rays, or views agree less."""
    margin = hull.margin(prism)
    left = hull.without(prism, margin)
    gone = hull.lost_in(left)
    if gone < _LEAST_VOXELS:
        return None
    sure = _surely(prism)
    lost = lost_share(chords, chords.within(sure, margin))
    behind = left.scene()
    at, before, after, missing = changes(images, scene, behind, _REACH_VOXELS * hull.spacing)
    if sure is not prism:
        missing = changes(images, scene, hull.without(sure, margin).scene(), _REACH_VOXELS * hull.spacing)[-1]
    old, new, told = mean_cost(before), mean_cost(after), before[1] & after[1]
    most = _GAIN if told.sum() >= _LEAST_RAYS else _WORSE
    believed = new <= most * old if told.sum() >= _FEWEST_RAYS else gone <= _UNSEEN_VOXELS
    good = lost <= MOST_LOST and missing <= MOST_LOST and believed
    good = good and not _stands(prism, at[told], before[0][told], after[0][told])
    logger.info(
        "notch of area %.4f, normal %s, %s, %d voxels: %.1f %% of the rays lost, views disagree by %.2f for %.2f, "
        "%d rays%s", prism.area, np.round(prism.lattice.normal, 2).tolist(), prism.section and prism.section.shape,
        gone, 100 * lost, new, old, told.sum(), "" if good else ": not believed",
    )  # fmt: skip
    return (left, behind) if good else None


def _surely(prism: Prism) -> Prism:
    """A notch without the cells along its edge if cells are all that is known of it: of rays that graze what stands
    there, half a cell too many leaves nothing.
    """
    if prism.section is not None:
        return prism
    return replace(prism, outline=ndimage.binary_erosion(prism.outline, iterations=_BLUR_CELLS))


def _stands(prism: Prism, at: Array, before: Array, after: Array) -> bool:
    """Whether something stands in a notch somewhere along it, which neither of its ends shows.

    Args:
        prism: the notch.
        at: (N, 3) of rays on what would go; before, after: (N,) by how much views disagree on it, and behind it.
    """
    slab = np.clip(-prism.lattice.coordinates(at)[1] / prism.depth * _SLABS, 0, _SLABS - 1).astype(int)
    rays = np.bincount(slab, minlength=_SLABS)
    old, new = (np.bincount(slab, costs, _SLABS) for costs in (before, after))
    return bool(((rays >= _LEAST_RAYS // 2) & (new > _WORSE * old)).any())
