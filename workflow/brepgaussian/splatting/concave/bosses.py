"""The sections of bosses: what the cells of their tops are drawings of, and where views show the rims of these.

In a pocket few views show all of a rim, cells of a top are blurred, and the rim of a hole, or a shadow, may be shown as
well; so bosses of one height are asked together.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.geometry.pixels import inner_distance
from brepgaussian.log import get_logger
from brepgaussian.splatting.concave.draw import circle, fitted
from brepgaussian.splatting.concave.openings import Images, across
from brepgaussian.splatting.concave.prism import Prism, signed_outline
from brepgaussian.splatting.concave.rims import CONTRAST, FAINT, Rim, rim_of
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.sections import Rounded, Section
from brepgaussian.splatting.concave.tops import BAND_CELLS, COMPACT_CELLS, RING_CELLS

Array = NDArray[np.float64]
Cells = NDArray[np.bool_]

LEVEL_CELLS = 1.0  # between tops that are meant to be of one height
_BORDER_PLACES = 200  # of a section
_BORDER_CELLS = 5  # from a wall: a boss that ends there stands against it, for views disagree about what is next to it
_BESIDE_CELLS = 4  # around a top, where its rim is sought
_IN_WALL_CELLS = 4.0  # that the section of a boss which stands against a wall reaches into it
_WIDER_CELLS = (0.0, -3.0, 3.0)  # by which a top may be wider than its cells, or narrower
_NARROWEST_CELLS = 3.0  # what is narrower is no rectangle that cells could tell
_FAR_CELLS = 8.0  # from the end of a top's cells, at most, to where the views show the steepest step
_ENDS, _ALONG_SIDE = 0.15, 40  # of a side at either end, which tell of other sides; places that are asked between
_FRINGE, _WIDE = 0.5, 0.8  # of the cells side by side, and the quantile of their numbers that is a boss's width
_TOLD, _LEAST_TOLD = 0.3, 0.1  # of a rim, for a section by itself, and for one that another boss has
_CLEARLY = 0.6  # of it, or steps of less contrast are asked, too
_AS_WELL = 0.8  # of the share of its rim that a boss tells best, it tells of one that others have
_SIZES = 1.03  # ratio of sections that are meant to be one,
_SIDES_CELLS = 1.0  # or by how much the sides of rectangles differ, which reach into walls
_SAME = 0.7  # of two outlines of one section is common to both

logger = get_logger("stage1")


def sectioned(images: Images, standing: Scene, prism: Prism, islands: Sequence[Prism]) -> list[Prism]:
    """Bosses with the sections that their outlines are drawings of, and at the heights that their rims tell.

    A section that a part of its rim tells is one that another boss has, too. Those of nearly one height are of one.

    Args:
        images: of all views.
        standing: the hull, with the bosses in the pocket.
        prism: the pocket.
        islands: the bosses.
    """
    rims = _of_a_kind([_rims(images, standing, prism, island) for island in islands], islands)
    told = [(rim, i) for rim, i in zip(rims, islands, strict=True) if rim is not None and rim.told >= _TOLD]
    result = []
    for island, rim in zip(islands, rims, strict=True):
        pitch = island.lattice.pitch
        sure = rim is not None and (rim.told >= _TOLD or any(_alike(rim.section, t.section) for t, _ in told))
        section = rim.section if rim is not None and sure else None
        own = island.depth + (rim.height * pitch if rim is not None and rim.told >= _TOLD else 0.0)
        heights = [(other.depth + t.height * pitch, t.section) for t, other in told]
        level = [one for one in heights if abs(one[0] - own) <= LEVEL_CELLS * pitch]
        depth = float(np.median([height for height, _ in level])) if level else own
        if section is None:
            section = _like(island, [other for _, other in level])
        logger.info("boss of area %.4f: %s, %.4f high", island.area, section and section.shape, depth)
        result.append(replace(island, lattice=island.lowered(island.depth - depth), depth=depth, section=section))
    return result


def _rims(images: Images, standing: Scene, prism: Prism, island: Prism) -> list[Rim]:
    """What may be the rim of a boss's top."""
    around = ndimage.binary_dilation(island.outline, iterations=_BESIDE_CELLS + RING_CELLS)
    stack = across(images, standing, island.lattice, around)
    centers = images.views.cameras.centers
    round_ones, walled = [*_rough(island)], [*_rectangles(prism, island, stack.slope)]

    def told(contrast: float) -> list[Rim]:
        """Those that are told by steps of some contrast."""

        def rim(section: Section, covered: Callable[[Array], Cells] | None = None) -> Rim | None:
            return rim_of(section, stack, centers, images.tolerance, _LEAST_TOLD, covered, contrast)

        found = [*map(rim, round_ones), *(rim(section, lambda at: prism.lateral(at) > 0) for section in walled)]
        return [r for r in found if r is not None and r.section.at_rim]

    clear = told(CONTRAST)
    return clear if any(r.told >= _CLEARLY for r in clear) else [*clear, *told(FAINT)]


def _of_a_kind(rims: Sequence[Sequence[Rim]], islands: Sequence[Prism]) -> list[Rim | None]:
    """For each boss the rim that it tells best, or about as well if others of its height tell one like that, too."""
    best = [max(some, key=lambda r: r.told, default=None) for some in rims]
    for k, own in enumerate(best):
        if own is None:
            continue
        level = [
            some
            for some, island in zip(rims, islands, strict=True)
            if abs(island.depth - islands[k].depth) <= LEVEL_CELLS * islands[k].lattice.pitch
        ]
        about = [rim for rim in rims[k] if rim.told >= _AS_WELL * own.told]
        best[k] = max(about, key=partial(_support, bosses=level))
    return best


def _support(rim: Rim, bosses: Sequence[Sequence[Rim]]) -> tuple[int, float]:
    """How many bosses tell a rim like this, and by which shares of it altogether."""
    told = [_as_well(rim, some) for some in bosses]
    return int(np.count_nonzero(told)), sum(told)


def _as_well(rim: Rim, others: Sequence[Rim]) -> float:
    """The share of a rim like this that another boss tells; 0 where it tells another one clearly better."""
    most = max((other.told for other in others), default=0.0)
    alike = max((other.told for other in others if _alike(rim.section, other.section)), default=0.0)
    return alike if alike >= _AS_WELL * most else 0.0


def _like(island: Prism, others: Sequence[Section]) -> Section | None:
    """The section of another boss of its height where it stands, if its outline is about that."""
    places = np.moveaxis(np.indices(island.outline.shape), 0, -1).astype(float)
    row, column = np.argwhere(island.outline).mean(axis=0)
    for other in others:
        section = replace(other, center=(float(row), float(column)), at_rim=False)
        inside = section.signed_distance(places) < 0
        if (inside & island.outline).sum() >= _SAME * (inside | island.outline).sum():
            return section
    return None


def _alike(one: Section, other: Section) -> bool:
    """Whether two sections are of one form and size."""
    if type(one.shape) is not type(other.shape):
        return False
    if isinstance(one.shape, Rounded) and isinstance(other.shape, Rounded):
        sides = np.array([[*one.shape.half, one.shape.radius], [*other.shape.half, other.shape.radius]])
        return bool(np.abs(np.diff(sides, axis=0)).max() <= _SIDES_CELLS)
    ratio = one.shape.reach / other.shape.reach
    return 1 / _SIZES <= ratio <= _SIZES


def _rough(island: Prism) -> Iterator[Section]:
    """What a boss's outline may be a drawing of: also a circle, though views see less on one side of it."""

    def opened(cells: Cells) -> Cells:
        return np.asarray(ndimage.binary_opening(cells, iterations=COMPACT_CELLS))

    section = fitted(island.outline, opened)
    if section is not None:
        yield section
    middle = np.argwhere(island.outline).mean(axis=0)
    yield circle([float(middle[0]), float(middle[1]), float(np.sqrt(island.outline.sum() / np.pi))])
    inside = inner_distance(island.outline)
    row, column = np.unravel_index(int(np.argmax(inside)), inside.shape)
    yield circle([float(row), float(column), float(inside[row, column])])


def _rectangles(prism: Prism, island: Prism, slope: Array) -> Iterator[Section]:
    """Rectangles along a pocket's walls that a boss's outline may be, reaching into walls which it stands against.

    What a top's cells leave of it is up to a few cells off, farther than a rim is looked for beside them; beside a
    floor of one grey, of which views say the same at any height, they go on until its shadow ends. So its sides are
    also sought where the common grey of the views, of `slope` (R, C) for each cell, is steepest.
    """
    away = -signed_outline(prism.outline)  # of cells, from the pocket's walls
    cells = np.argwhere(island.outline)
    axes, ends = box(prism, island)
    at = cells @ axes.T  # (N, 2) along the walls
    free = np.ones((2, 2), bool)
    for axis in (0, 1):
        for k, sign in enumerate((-1, 1)):
            beside = cells[np.abs(at[:, axis] - ends[k, axis]) < BAND_CELLS]
            if np.median(away[tuple(beside.T)]) < _BORDER_CELLS:
                ends[k, axis] += _IN_WALL_CELLS * sign
                free[k, axis] = False
    outward = np.where(free, [[-1.0], [1.0]], 0.0)
    moves = [_WIDER_CELLS if free[:, axis].any() else (0.0,) for axis in (0, 1)]
    tried = [ends + outward * np.array(wider) for wider in product(*moves)]
    tried += [_steepest(axes, ends, free, slope)] if free.any() else []
    yield from (_rectangle(axes, some) for some in tried if (some[1] - some[0]).min() >= _NARROWEST_CELLS)


def _steepest(axes: Array, ends: Array, free: Cells, slope: Array) -> Array:
    """(2, 2) the ends of a rectangle, those that are `free` (2, 2) where the slope (R, C) along their side is largest.

    Each within `_FAR_CELLS`, and on its own half.
    """
    result = ends.copy()
    middle = ends.mean(axis=0)
    for end, axis in zip(*np.nonzero(free), strict=True):
        sign = (-1, 1)[end]
        inner = min(_FAR_CELLS, sign * (ends[end, axis] - middle[axis]) - 1)
        across = ends[end, axis] + sign * np.arange(-inner, _FAR_CELLS)
        low, high = ends[:, 1 - axis]
        along = np.linspace(low + _ENDS * (high - low), high - _ENDS * (high - low), _ALONG_SIDE)
        at = across[:, None, None] * axes[axis] + along[:, None] * axes[1 - axis]  # (K, L, 2)
        profile = np.median(ndimage.map_coordinates(slope, np.moveaxis(at, -1, 0), order=1), axis=1)
        result[end, axis] = across[int(np.argmax(profile))]
    return result


def box(prism: Prism, island: Prism) -> tuple[Array, Array]:
    """(2, 2) axes along a pocket's walls, and (2, 2) the ends of a boss along each, low ones and high ones.

    Those of its section, if it is drawn, else of its cells.
    """
    angle = 0.0 if prism.section is None else prism.section.angle
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    if island.section is not None:
        border = island.section.border(_BORDER_PLACES) @ axes.T
        return axes, np.array([border.min(axis=0), border.max(axis=0)])
    at = np.argwhere(island.outline) @ axes.T
    return axes, np.array([_ends(at[:, axis]) for axis in (0, 1)]).T


def _rectangle(axes: Array, ends: Array) -> Section:
    """A sharp rectangle along two axes (2, 2) between their ends (2, 2), low ones and high ones."""
    middle, half = ends.mean(axis=0) @ axes, (ends[1] - ends[0]) / 2
    shape = Rounded((float(half[0]), float(half[1])), 0.0)
    return Section((float(middle[0]), float(middle[1])), float(np.arctan2(axes[0, 1], axes[0, 0])), shape)


def _ends(along: Array) -> tuple[float, float]:
    """Where cells end to both sides along an axis: a fringe of few of them counts as none."""
    _, inverse, sizes = np.unique(np.round(along), return_inverse=True, return_counts=True)
    wide = sizes >= _FRINGE * np.quantile(sizes, _WIDE)
    kept = along[wide[inverse]]
    return float(kept.min()) - 0.5, float(kept.max()) + 0.5
