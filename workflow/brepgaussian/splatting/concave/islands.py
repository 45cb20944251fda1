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
from brepgaussian.splatting.concave.agreement import mean_cost, rays_at_object
from brepgaussian.splatting.concave.draw import circle, fitted
from brepgaussian.splatting.concave.openings import Images, across
from brepgaussian.splatting.concave.prism import Prism, signed_outline
from brepgaussian.splatting.concave.rims import CONTRAST, FAINT, Rim, rim_of
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.sections import Rounded, Section
from brepgaussian.splatting.concave.volume import Volume

Array = NDArray[np.float64]
Cells = NDArray[np.bool_]

_AGREED = 0.8  # share of a cell's views that agree on a top,
_PEAK = 0.12  # and by how much less they do above and below,
_BESIDE_PLANES = (4, 5, 6)  # planes off
_LEAST_MEAN_PEAK = 0.2  # on average: true tops had .25-.45, what one grey makes of a floor mostly less
_BLUR_CELLS = 1.0
_FAINTEST = 1e-3
_SOLID = 0.6  # of what a top spans
_LEAST_HEIGHT_CELLS = 4.0  # of a boss, and from its top to the rim: floors are told to a cell or two
_LEAST_TOP_CELLS = 49  # of a top: as compact as they are
_STEP_CELLS = 0.75  # between the planes: farther than half of that from a top, views agree about it less
_BORDER_CELLS = 5  # from a wall: a boss that ends there stands against it, for views disagree about what is next to it
_BESIDE_CELLS = 4  # around a top, where its rim is sought
_THIN_CELLS = 1  # half the width of what joins a top to a wall about which views agree as well
_BROKEN_CELLS = 3  # half the width of a gap in a top around a hole, where few views see it
_COMPACT_CELLS = 3  # half the width of a top, holes in it filled
_RING_CELLS, _BAND_CELLS = 3, 2  # what is looked at around a top, and within its border
_LEVEL_CELLS = 1.0  # between tops that are meant to be of one height
_IN_WALL_CELLS = 4.0  # that the section of a boss which stands against a wall reaches into it
_FRINGE, _WIDE = 0.5, 0.8  # of the cells side by side, and the quantile of their numbers that is a boss's width
_STRIDE_PX = 2  # between the rays that judge a boss
_FINE_CELLS = (0.0, -0.5, 0.5, -1.0, 1.0)  # from a plane, to find a top's height
_TOLD, _LEAST_TOLD = 0.3, 0.1  # of a rim, for a section by itself, and for one that another boss has
_CLEARLY = 0.6  # of it, or steps of less contrast are asked, too
_SIZES = 1.03  # ratio of sections that are meant to be one
_OVERLAP = 0.2  # of a top, that may be another one's
_TURNS = 2  # in which tops are tried: one that is none may stand out more than the one that it overlaps with
_TRIED_CELLS = 2.0  # between the height of a top that views don't believe and that of one which is worth a try
_GAIN = 0.75  # share of the views' disagreement that a boss leaves at most where it is: with a hole in it .4-.7,
# false ones .85 and more
_LEAST_OFF = 0.5  # tolerances by which views disagree about what would be seen if there were none
_LEAST_RAYS = 20  # that tell something, for them to judge

logger = get_logger("stage1")


@dataclass(frozen=True)
class _Top:
    """Cells (R, C) of a plane at a `depth` below the rim; `contrast` of views' agreement there, above and below."""

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
    tops = sorted(_tops(images, cut, prism), key=lambda top: -top.contrast * np.sqrt(top.outline.sum()))
    kept: list[Prism] = []
    wrong: list[Prism] = []
    for _ in range(_TURNS):
        turn = [_island(prism, _levelled(images, cut, prism, top)) for top in _turn(prism, tops, kept, wrong)]
        if not turn:
            break
        islands = [*kept, *turn]
        kept = _believed(images, hull, prism, margin, cut, islands)
        wrong += [island for island in islands if not any(island is one for one in kept)]
    logger.info(
        "pocket of area %.4f: %d bosses in it, of heights %s, %d others not believed",
        prism.area, len(kept), [round(i.depth, 4) for i in kept], len(wrong),
    )  # fmt: skip
    if not kept:
        return prism
    standing = hull.without(replace(prism, islands=tuple(kept)), margin).scene()
    return replace(prism, islands=tuple(_drawn(images, standing, prism, kept)))


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


def _believed(
    images: Images, hull: Volume, prism: Prism, margin: float, cut: Scene, islands: Sequence[Prism]
) -> list[Prism]:
    """The bosses that views believe, those of one height looked at again without what stood before them."""

    def standing(some: Sequence[Prism]) -> Scene:
        return hull.without(replace(prism, islands=tuple(some)), margin).scene()

    kept = _seen(images, standing(islands), cut, islands)
    pitch = prism.lattice.pitch
    level = [i for i in islands if any(abs(i.depth - k.depth) <= _LEVEL_CELLS * pitch for k in kept)]
    return _seen(images, standing(level), cut, level) if len(level) > len(kept) else kept


def _tops(images: Images, cut: Scene, prism: Prism) -> Iterator[_Top]:
    """What may be the top of a boss, on all planes between floor and rim: views agree about it there only."""
    pitch = prism.lattice.pitch
    depths = np.arange(_LEAST_HEIGHT_CELLS * pitch, prism.depth - _LEAST_HEIGHT_CELLS * pitch, _STEP_CELLS * pitch)
    stacks = (across(images, cut, prism.lowered(float(depth)), prism.outline) for depth in depths)
    agreement = np.stack([stack.agreement for stack in stacks]).astype(np.float32)  # (D, R, C)
    for k, depth in enumerate(depths):
        beside = [j for off in _BESIDE_PLANES for j in (k - off, k + off) if 0 <= j < len(depths)]
        if not beside:
            continue
        peak = agreement[k] - agreement[beside].mean(axis=0)
        for outline in _compact(agreement[k], peak, prism.outline):
            contrast = float(peak[outline].mean())
            if contrast >= _LEAST_MEAN_PEAK and outline.sum() >= _LEAST_TOP_CELLS:
                yield _Top(outline, float(depth), contrast)


def _compact(agreement: Array, peak: Array, within: Cells) -> Iterator[Cells]:
    """Compact regions (R, C) of a pocket about which views agree (R, C), and less so above and below, without holes."""
    weight = np.maximum(ndimage.gaussian_filter(within.astype(float), _BLUR_CELLS), _FAINTEST)
    smooth, clear = (ndimage.gaussian_filter(np.where(within, a, 0.0), _BLUR_CELLS) / weight for a in (agreement, peak))
    agreed = ndimage.binary_opening(within & (smooth >= _AGREED) & (clear >= _PEAK), iterations=_THIN_CELLS)
    whole = ndimage.binary_fill_holes(ndimage.binary_closing(agreed, iterations=_BROKEN_CELLS))
    labels, count = ndimage.label(ndimage.binary_opening(whole, iterations=_COMPACT_CELLS))
    for k in range(1, count + 1):
        region = labels == k
        convex = convex_hull_image(region) & within
        gap = ndimage.binary_opening(convex & ~region, iterations=_COMPACT_CELLS)  # of a screw hole in a corner
        yield convex if gap.any() and region.sum() >= _SOLID * convex.sum() else region


def _levelled(images: Images, cut: Scene, prism: Prism, top: _Top) -> _Top:
    """The same top at the height, to a part of a cell, at which views agree about most of it."""
    depths = top.depth + np.array(_FINE_CELLS) * prism.lattice.pitch
    agreed = [across(images, cut, prism.lowered(float(d)), top.outline).agreement[top.outline].mean() for d in depths]
    return replace(top, depth=float(depths[int(np.argmax(agreed))]))


def _island(prism: Prism, top: _Top) -> Prism:
    return Prism(prism.lowered(top.depth), top.outline, prism.depth - top.depth, False, 0.0)


def _seen(images: Images, standing: Scene, cut: Scene, islands: Sequence[Prism]) -> list[Prism]:
    """The bosses on which views agree about the rays that meet them, better than on what is behind."""
    rays, kept = rays_at_object(images, _STRIDE_PX), []
    for island in islands:
        mine = rays.hitting(standing, lambda points, island=island: _on(island, points))  # type: ignore[misc]
        there, behind = mine.costs(standing), mine.costs(cut)
        new, old, told = mean_cost(there), mean_cost(behind), int(np.count_nonzero(there[1] & behind[1]))
        believed = told >= _LEAST_RAYS and old >= _LEAST_OFF and new <= _GAIN * old
        logger.info(
            "boss of area %.4f, %.4f high: views disagree by %.2f for %.2f, %d rays%s",
            island.area, island.depth, new, old, told, "" if believed else ": not believed",
        )  # fmt: skip
        if believed:
            kept.append(island)
    return kept


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
