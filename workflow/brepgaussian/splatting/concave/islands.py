"""Bosses that stand on a pocket's floor and end below its rim.

No silhouette shows them, and rays through the pocket's rim tell of its floor, so they are cut away with the pocket. On
planes between floor and rim, views agree about a boss's top, at its own height only, and about nothing around it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.morphology import convex_hull_image

from brepgaussian.log import get_logger
from brepgaussian.splatting.concave.agreement import Rays, mean_cost, rays_at_object
from brepgaussian.splatting.concave.draw import circle, fitted
from brepgaussian.splatting.concave.openings import SURFACE_SHARE, Images, across
from brepgaussian.splatting.concave.prism import Prism, signed_outline
from brepgaussian.splatting.concave.rims import CONTRAST, FAINT, Rim, rim_of
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.sections import Rounded, Section
from brepgaussian.splatting.concave.volume import Volume

Array = NDArray[np.float64]
Cells = NDArray[np.bool_]

_HIDING_CELLS = 2  # half the width of what hides the floor, at least
_AGREED = (0.9, SURFACE_SHARE, 0.7)  # share of a cell's views that agree on a wide top
_AT_PEAK = 0.8  # the same of a narrow one,
_PEAK = 0.12  # by how much less they do above and below,
_BESIDE_PLANES = (4, 5, 6)  # planes off,
_LEAST_MEAN_PEAK = 0.2  # and on average: true tops had .25-.45, what one grey makes of a floor mostly less
_BLUR_CELLS = 1.0
_FAINTEST = 1e-3
_SOLID = 0.6  # of what a top spans
_LEAST_HEIGHT_CELLS = 4.0  # of a boss, and from its top to the rim: floors are told to a cell or two
_LEAST_CELLS, _LEAST_WIDE_CELLS = 49, 169  # of a narrow top, and of a wide one
_STEP_CELLS = 0.75  # between the planes: farther than half of that from a top, views agree about it less
_BORDER_CELLS = 5  # from a wall: a boss that ends there stands against it, for views disagree about what is next to it
_BESIDE_CELLS = 4  # around a top, where its rim is sought
_THIN_CELLS = 1  # half the width of what joins a top to a wall about which views agree as well
_BROKEN_CELLS = 3  # half the width of a gap in a top around a hole, where few views see it
_COMPACT_CELLS, _NARROW_CELLS = 4, 3  # half the width of a wide top and of a narrow one, holes in it filled
_BLURRED_CELLS = 3  # along a pocket's walls views disagree about its floor
_WIDER_CELLS = 12  # a top is wider than what hides the floor, where both have one grey
_GAP_CELLS, _RING_CELLS, _BAND_CELLS = 1, 3, 2  # blur beside a top, what is looked at around it, and within
_FREE_SHARE = 0.25  # of the ring is no wall of the pocket: in a corner it is a half
_RING_SHARE = 0.55  # of the ring is not what it seems to be: .6-.85 around true tops, mostly less than .5 elsewhere
_HIDDEN_SHARE = 0.5  # of a wide top hides the floor
_LEVEL_CELLS = 1.0  # between tops that are meant to be of one height
_IN_WALL_CELLS = 4.0  # that the section of a boss which stands against a wall reaches into it
_FRINGE, _WIDE = 0.5, 0.8  # of the cells side by side, and the quantile of their numbers that is a boss's width
_STRIDE_PX = 2  # between the rays that judge a boss
_FINE_CELLS = (0.0, -0.5, 0.5, -1.0, 1.0)  # from a plane, to find a top's height
_TOLD, _LEAST_TOLD = 0.3, 0.1  # of a rim, for a section by itself, and for one that another boss has
_CLEARLY = 0.6  # of it, or steps of less contrast are asked, too
_SIZES = 1.03  # ratio of sections that are meant to be one
_OVERLAP = 0.2  # of a top, that may be another one's
_LOOKS = 3  # at those of one turn, without what turned out to be none
_TURNS = 3  # in which tops are tried: one that is none may stand out more than the one that it overlaps with
_TRIED_CELLS = 2.0  # between the height of a top that views don't believe and that of one which is worth a try
_GAIN = 0.75  # share of the views' disagreement that a boss leaves at most where it is: with a hole in it .4-.7,
# false ones .85 and more
_LEAST_OFF = 0.5  # tolerances by which views disagree about what would be seen if there were none
_LEAST_RAYS = 20  # that tell something, for them to judge

logger = get_logger("stage1")


@dataclass(frozen=True)
class _Top:
    """Cells (R, C) of a plane at a `depth` below the rim; `contrast` of agreement within their border and beyond."""

    outline: Cells
    depth: float
    contrast: float


def with_islands(images: Images, hull: Volume, prism: Prism, margin: float) -> Prism:
    """A pocket with the bosses that stand in it, if there are any.

    Args:
        images: of all views.
        hull: before the pocket is cut.
        prism: the pocket, straight, with a flat floor; anything else stays as it is.
        margin: by which it is cut longer.
    """
    pitch = prism.lattice.pitch
    flat = not (prism.through or prism.endless or prism.domed or prism.draft or any(prism.tilt))
    if not flat or prism.depth < 2 * _LEAST_HEIGHT_CELLS * pitch:
        return prism
    cut = hull.without(prism, margin).scene()
    found: list[_Seen] = []
    narrow, wide = _tops(images, cut, prism)
    if not (narrow or wide):
        return prism
    rays = rays_at_object(images, _STRIDE_PX)
    narrow.sort(key=lambda top: -top.contrast * top.outline.sum())  # a part of one is none
    wide.sort(key=lambda top: -top.contrast)  # what is more than one is none
    for tops in (narrow, wide):
        found += _found(images, rays, hull, prism, margin, cut, tops)
    best: list[Prism] = []
    for one in sorted(found, key=lambda one: one.left):
        if not any((one.island.outline & b.outline).sum() > _OVERLAP * one.island.outline.sum() for b in best):
            best.append(one.island)
    kept = [one.island for one in _believed(rays, hull, prism, margin, cut, best)]
    logger.info(
        "pocket of area %.4f: %d bosses in it, of heights %s", prism.area, len(kept), [round(i.depth, 4) for i in kept]
    )
    if not kept:
        return prism
    standing = hull.without(replace(prism, islands=tuple(kept)), margin).scene()
    return replace(prism, islands=tuple(_drawn(images, standing, prism, kept)))


def _found(
    images: Images, rays: Rays, hull: Volume, prism: Prism, margin: float, cut: Scene, tops: Sequence[_Top]
) -> list["_Seen"]:
    """The bosses with some of the tops, best first, that views believe."""
    kept: list[_Seen] = []
    wrong: list[Prism] = []
    for _ in range(_TURNS):
        known = [one.island for one in kept]
        turn = [_island(prism, _levelled(images, cut, prism, top)) for top in _turn(prism, tops, known, wrong)]
        if not turn:
            break
        islands = [*known, *turn]
        kept = _believed(rays, hull, prism, margin, cut, islands)
        wrong += [island for island in islands if not any(island is one.island for one in kept)]
    return kept


def _turn(prism: Prism, tops: Sequence[_Top], kept: Sequence[Prism], wrong: Sequence[Prism]) -> list[_Top]:
    """Tops, best first, that overlap with none of them, with no boss that is known, and are not tried yet."""
    chosen: list[_Top] = []
    taken = np.any([np.zeros_like(prism.outline), *(island.outline for island in kept)], axis=0)
    for top in tops:
        height, most = prism.depth - top.depth, _OVERLAP * top.outline.sum()
        alike = [i for i in wrong if abs(i.depth - height) <= _TRIED_CELLS * prism.lattice.pitch]
        if (top.outline & taken).sum() <= most and all((top.outline & i.outline).sum() <= most for i in alike):
            chosen.append(top)
            taken |= top.outline
    return chosen


@dataclass(frozen=True)
class _Seen:
    """A boss, the share that it leaves of the views' disagreement, and whether they believe it."""

    island: Prism
    left: float
    believed: bool


def _believed(
    rays: Rays, hull: Volume, prism: Prism, margin: float, cut: Scene, islands: Sequence[Prism]
) -> list[_Seen]:
    """The bosses that views believe, those of one height looked at again without what stood before them."""

    def seen(some: Sequence[Prism]) -> list[_Seen]:
        return _seen(rays, hull.without(replace(prism, islands=tuple(some)), margin).scene(), cut, some)

    left, said = list(islands), []
    for _ in range(_LOOKS if islands else 0):
        said = seen(left)
        possible = [one.island for one in said if one.left < 1]  # what is none stands before what is one
        if len(possible) == len(left):
            break
        left = possible
    kept = [one for one in said if one.believed]
    pitch = prism.lattice.pitch
    level = [i for i in islands if any(abs(i.depth - k.island.depth) <= _LEVEL_CELLS * pitch for k in kept)]
    return [one for one in seen(level) if one.believed] if len(level) > len(kept) else kept


def _hidden(images: Images, cut: Scene, prism: Prism) -> Cells:
    """(R, C) cells of a pocket's floor that views show something else at, or do not show: bosses may stand there."""
    lattice = prism.lowered(prism.depth)
    inner = ndimage.binary_erosion(prism.outline, iterations=_BLURRED_CELLS)
    hidden = inner & (across(images, cut, lattice, prism.outline).agreement < SURFACE_SHARE)
    return np.asarray(ndimage.binary_opening(hidden, iterations=_HIDING_CELLS))


def _tops(images: Images, cut: Scene, prism: Prism) -> tuple[list[_Top], list[_Top]]:
    """What may be the narrow, and the wide tops of bosses, on all planes between floor and rim."""
    pitch = prism.lattice.pitch
    depths = np.arange(_LEAST_HEIGHT_CELLS * pitch, prism.depth - _LEAST_HEIGHT_CELLS * pitch, _STEP_CELLS * pitch)
    stacks = (across(images, cut, prism.lowered(float(depth)), prism.outline) for depth in depths)
    agreement = np.stack([stack.agreement for stack in stacks]).astype(np.float32)  # (D, R, C)
    hidden = _hidden(images, cut, prism)
    narrow: list[_Top] = []
    wide: list[_Top] = []
    for k, depth in enumerate(depths):
        beside = [j for off in _BESIDE_PLANES for j in (k - off, k + off) if 0 <= j < len(depths)]
        peaks = _peaks(agreement[k], agreement[k] - agreement[beside].mean(axis=0), prism.outline) if beside else ()
        for found, outlines in ((narrow, peaks), (wide, _over_hidden(agreement[k], hidden, prism.outline))):
            found += [top for o in outlines if (top := _top(agreement[k], prism.outline, o, float(depth))) is not None]
    return narrow, wide


def _top(agreement: Array, within: Cells, outline: Cells, depth: float) -> _Top | None:
    """A region (R, C) as a top, if about most of what is around it views agree (R, C) less."""
    around = _ring(outline)
    ring = around & within  # a boss may stand against a wall, or in a corner
    if ring.sum() < _FREE_SHARE * around.sum() or (agreement[ring] < SURFACE_SHARE).mean() < _RING_SHARE:
        return None
    band = outline & ~ndimage.binary_erosion(outline, iterations=_BAND_CELLS)  # there may be a hole within
    return _Top(outline, depth, float(agreement[band].mean() - agreement[ring].mean()))


def _ring(outline: Cells) -> Cells:
    """(R, C) what lies around an outline, clear of its blur."""
    blurred = ndimage.binary_dilation(outline, iterations=_GAP_CELLS)
    return np.asarray(ndimage.binary_dilation(blurred, iterations=_RING_CELLS) & ~blurred)


def _over_hidden(agreement: Array, hidden: Cells, within: Cells) -> Iterator[Cells]:
    """Regions about which views agree (R, C), over hidden floor: wide tops.

    In the middle of a wide one views agree on planes above and below it, too.
    """
    clear = ndimage.binary_erosion(within, iterations=_BLURRED_CELLS)
    near = within & ndimage.binary_dilation(hidden, iterations=_WIDER_CELLS)
    for least in _AGREED:
        agreed = ndimage.binary_opening((agreement >= least) & near, iterations=_THIN_CELLS)
        for broken in (0, _BROKEN_CELLS):
            whole = ndimage.binary_closing(agreed, iterations=broken) if broken else agreed
            for outline in _compact(whole, _COMPACT_CELLS):
                if outline.sum() < _LEAST_WIDE_CELLS:
                    continue
                if clear[outline].any() and hidden[outline & clear].mean() >= _HIDDEN_SHARE:
                    yield outline


def _peaks(agreement: Array, peak: Array, within: Cells) -> Iterator[Cells]:
    """Regions (R, C) of a pocket about which views agree, and by a `peak` less so above and below: narrow tops."""
    weight = np.maximum(ndimage.gaussian_filter(within.astype(float), _BLUR_CELLS), _FAINTEST)
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


def _levelled(images: Images, cut: Scene, prism: Prism, top: _Top) -> _Top:
    """The same top at the height, to a part of a cell, at which views agree about most of it."""
    depths = top.depth + np.array(_FINE_CELLS) * prism.lattice.pitch
    agreed = [across(images, cut, prism.lowered(float(d)), top.outline).agreement[top.outline].mean() for d in depths]
    return replace(top, depth=float(depths[int(np.argmax(agreed))]))


def _island(prism: Prism, top: _Top) -> Prism:
    return Prism(prism.lowered(top.depth), top.outline, prism.depth - top.depth, False, 0.0)


def _seen(rays: Rays, standing: Scene, cut: Scene, islands: Sequence[Prism]) -> list[_Seen]:
    """Whether views agree about the rays that meet bosses better than on what is behind."""
    rays = rays.hitting(standing, lambda points: np.ones(len(points), bool))
    result = []
    for island in islands:
        mine = rays.chosen(np.flatnonzero(_on(island, rays.at)))
        there, behind = mine.costs(standing), mine.costs(cut)
        new, old, told = mean_cost(there), mean_cost(behind), int(np.count_nonzero(there[1] & behind[1]))
        believed = told >= _LEAST_RAYS and old >= _LEAST_OFF and new <= _GAIN * old
        logger.info(
            "boss of area %.4f, %.4f high: views disagree by %.2f for %.2f, %d rays%s",
            island.area, island.depth, new, old, told, "" if believed else ": not believed",
        )  # fmt: skip
        result.append(_Seen(island, new / old if old else np.inf, believed))
    return result


def _on(island: Prism, points: Array) -> NDArray[np.bool_]:
    """(N,) which points (N, 3) lie on a boss's top or walls."""
    cells, height = island.lattice.coordinates(points)
    near = 2 * island.lattice.pitch
    return np.asarray((island.lateral(cells) < near) & (height < near) & (height > -island.depth + near))


def _drawn(images: Images, standing: Scene, prism: Prism, islands: Sequence[Prism]) -> list[Prism]:
    """Bosses with the sections that their outlines are drawings of, and at the heights that their rims tell.

    In a pocket few views show all of a rim. A section that a part of it tells is one that another boss has, too. Those
    of nearly one height are of one.
    """
    rims = [_rim(images, standing, prism, island) for island in islands]
    told = [(rim, i) for rim, i in zip(rims, islands, strict=True) if rim is not None and rim.told >= _TOLD]
    result = []
    for island, rim in zip(islands, rims, strict=True):
        pitch = island.lattice.pitch
        sure = rim is not None and (rim.told >= _TOLD or any(_alike(rim.section, t.section) for t, _ in told))
        section = rim.section if rim is not None and sure else None
        own = island.depth + (rim.height * pitch if rim is not None and rim.told >= _TOLD else 0.0)
        heights = [other.depth + t.height * pitch for t, other in told]
        level = [h for h in heights if abs(h - own) <= _LEVEL_CELLS * pitch]
        depth = float(np.median(level)) if level else own
        logger.info("boss of area %.4f: %s, %.4f high", island.area, section and section.shape, depth)
        result.append(replace(island, lattice=island.lowered(island.depth - depth), depth=depth, section=section))
    return result


def _rim(images: Images, standing: Scene, prism: Prism, island: Prism) -> Rim | None:
    """The rim of a boss's top that is told best."""
    around = ndimage.binary_dilation(island.outline, iterations=_BESIDE_CELLS + _RING_CELLS)
    stack = across(images, standing, island.lattice, around)
    centers = images.views.cameras.centers
    walled = _against_walls(prism, island)

    def told(contrast: float) -> Rim | None:
        """The one that is told best by steps of some contrast."""
        rims = [rim_of(r, stack, centers, images.tolerance, _LEAST_TOLD, contrast=contrast) for r in _rough(island)]
        if walled is not None:
            covered = lambda at: prism.lateral(at) > 0  # noqa: E731
            rims.append(rim_of(walled, stack, centers, images.tolerance, _LEAST_TOLD, covered, contrast))
        return max((r for r in rims if r is not None and r.section.at_rim), key=lambda r: r.told, default=None)

    clear = told(CONTRAST)
    if clear is not None and clear.told >= _CLEARLY:
        return clear
    return max((r for r in (clear, told(FAINT)) if r is not None), key=lambda r: r.told, default=None)


def _alike(one: Section, other: Section) -> bool:
    """Whether two sections are of one form and size."""
    if type(one.shape) is not type(other.shape):
        return False
    ratio = one.shape.reach / other.shape.reach
    return 1 / _SIZES <= ratio <= _SIZES


def _rough(island: Prism) -> Iterator[Section]:
    """What a boss's outline may be a drawing of: also a circle, though views see less on one side of it."""

    def opened(cells: Cells) -> Cells:
        return np.asarray(ndimage.binary_opening(cells, iterations=_COMPACT_CELLS))

    section = fitted(island.outline, opened)
    if section is not None:
        yield section
    middle = np.argwhere(island.outline).mean(axis=0)
    yield circle([float(middle[0]), float(middle[1]), float(np.sqrt(island.outline.sum() / np.pi))])
    inside = ndimage.distance_transform_edt(np.pad(island.outline, 1))[1:-1, 1:-1]
    row, column = np.unravel_index(int(np.argmax(inside)), inside.shape)
    yield circle([float(row), float(column), float(inside[row, column])])


def _against_walls(prism: Prism, island: Prism) -> Section | None:
    """The rectangle along a pocket's walls around a boss that stands against one, reaching into it, or None."""
    away = -signed_outline(prism.outline)  # of cells, from the pocket's walls
    cells = np.argwhere(island.outline)
    if not (away[island.outline] < _BORDER_CELLS).any():
        return None
    angle = 0.0 if prism.section is None else prism.section.angle
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    at = cells @ axes.T  # (N, 2) along the walls
    low, high = np.array([_ends(at[:, axis]) for axis in (0, 1)]).T
    touches = False
    for axis in (0, 1):
        for end, outward in ((low, -1), (high, 1)):
            beside = cells[np.abs(at[:, axis] - end[axis]) < _BAND_CELLS]
            if np.median(away[tuple(beside.T)]) < _BORDER_CELLS:
                end[axis] += _IN_WALL_CELLS * outward
                touches = True
    middle, half = (low + high) / 2 @ axes, (high - low) / 2
    shape = Rounded((float(half[0]), float(half[1])), 0.0)
    return Section((float(middle[0]), float(middle[1])), angle, shape) if touches else None


def _ends(along: Array) -> tuple[float, float]:
    """Where cells end to both sides along an axis: a fringe of few of them counts as none."""
    _, inverse, sizes = np.unique(np.round(along), return_inverse=True, return_counts=True)
    wide = sizes >= _FRINGE * np.quantile(sizes, _WIDE)
    kept = along[wide[inverse]]
    return float(kept.min()) - 0.5, float(kept.max()) + 0.5
