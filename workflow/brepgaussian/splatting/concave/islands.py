"""Bosses that stand on a pocket's floor and end below its rim.

No silhouette shows them, and rays through the pocket's rim tell of its floor, so they are cut away with the pocket. On
planes between floor and rim, views agree about a boss's top, at its own height only, and about nothing around it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from brepgaussian.log import get_logger
from brepgaussian.splatting.concave.agreement import Rays, mean_cost, rays_at_object
from brepgaussian.splatting.concave.bosses import LEVEL_CELLS, box, sectioned
from brepgaussian.splatting.concave.openings import OPENING_CELLS, Images, across
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.tops import LEAST_HEIGHT_CELLS, Top, tops
from brepgaussian.splatting.concave.volume import Volume

Array = NDArray[np.float64]
Cells = NDArray[np.bool_]

_UPRIGHT_CELLS = 2.0  # by which walls lean at their foot at most: what stands on a floor may look like that
_STRIDE_PX = 2  # between the rays that judge a boss
_FINE_CELLS = (0.0, -0.5, 0.5, -1.0, 1.0)  # from a plane, to find a top's height
_LARGER = 0.25  # power of its area by which a boss may leave more of the views' disagreement than a part of it
_OVERLAP = 0.2  # of a top, that may be another one's
_LOOKS = 3  # at those of one turn, without what turned out to be none
_TURNS = 3  # in which tops are tried: one that is none may stand out more than the one that it overlaps with
_TRIED_CELLS = 2.0  # between the height of a top that views don't believe and that of one which is worth a try
_IN_LINE_CELLS = 1.5  # by which the sides of two pieces of one wall's top are off each other, at most
_NO_WORSE = 1.25  # of what views disagree by is left with a wall whole: where there is a gap they agree about that
_GAIN = 0.75  # share of the views' disagreement that a boss leaves at most where it is: with a hole in it .4-.7,
# false ones .85 and more
_SURE_LEFT = 0.5  # what leaves less stands there, whatever stands beside it: .1-.4 measured, .6 of what was none
_LEAST_OFF = 0.5  # tolerances by which views disagree about what would be seen if there were none
_LEAST_RAYS = 20  # that tell something, for them to judge

logger = get_logger("stage1")


def with_islands(
    images: Images, hull: Volume, prism: Prism, margin: float, likely: Sequence[Top] | None = None
) -> Prism:
    """A pocket with the bosses that stand in it, if there are any.

    Args:
        images: of all views.
        hull: before the pocket is cut.
        prism: the pocket, straight, with a flat floor; anything else stays as it is.
        margin: by which it is cut longer.
        likely: the tops that they may have; None = to be sought.
    """
    if not has_room(prism):
        return prism
    found_as, prism = prism, replace(prism, draft=0.0)
    cut = hull.without(prism, margin).scene()
    found: list[_Seen] = []
    narrow, wide = tops(images, cut, prism) if likely is None else (list(likely), [])
    if not (narrow or wide):
        return found_as
    rays = rays_at_object(images, _STRIDE_PX)
    narrow.sort(key=lambda top: -top.contrast * top.outline.sum())  # a part of one is none
    wide.sort(key=lambda top: -top.contrast)  # what is more than one is none
    for some in (narrow, wide):
        found += _found(images, rays, hull, prism, margin, cut, some)
    best: list[Prism] = []
    for one in sorted(found, key=lambda one: one.left / one.island.area**_LARGER):  # a part of one may fit as well
        if not any(_overlaps(one.island.outline, b.outline) for b in best):
            best.append(one.island)
    kept = _beside_others(rays, hull, prism, margin, _believed(rays, hull, prism, margin, cut, best))
    logger.info(
        "pocket of area %.4f: %d bosses in it, of heights %s", prism.area, len(kept), [round(i.depth, 4) for i in kept]
    )
    if not kept:
        return found_as
    drawn = _drawn(images, hull, prism, margin, kept)
    joined = _joined(rays, hull, prism, margin, drawn)
    return replace(prism, islands=tuple(drawn if joined is drawn else _drawn(images, hull, prism, margin, joined)))


def _drawn(images: Images, hull: Volume, prism: Prism, margin: float, islands: Sequence[Prism]) -> list[Prism]:
    return sectioned(images, _standing(hull, prism, margin, islands), prism, islands)


def _standing(hull: Volume, prism: Prism, margin: float, islands: Sequence[Prism]) -> Scene:
    """The hull with a pocket in which bosses stand."""
    return hull.without(replace(prism, islands=tuple(islands)), margin).scene()


def has_room(prism: Prism) -> bool:
    """Whether bosses may stand in a concavity: it is upright, and has a flat floor that lies deep enough."""
    pitch = prism.lattice.pitch
    upright = prism.draft * prism.depth <= _UPRIGHT_CELLS * pitch and np.isinf(prism.sink)
    flat = not (prism.through or prism.endless or prism.domed or any(prism.tilt))
    return bool(flat and upright and prism.depth >= 2 * LEAST_HEIGHT_CELLS * pitch)


def _found(
    images: Images, rays: Rays, hull: Volume, prism: Prism, margin: float, cut: Scene, candidates: Sequence[Top]
) -> list["_Seen"]:
    """The bosses with some of the tops, best first, that views believe."""
    kept: list[_Seen] = []
    wrong: list[Prism] = []
    for _ in range(_TURNS):
        known = [one.island for one in kept]
        turn = [_island(prism, _levelled(images, cut, prism, top)) for top in _turn(prism, candidates, known, wrong)]
        if not turn:
            break
        islands = [*known, *turn]
        kept = _believed(rays, hull, prism, margin, cut, islands)
        wrong += [island for island in islands if not any(island is one.island for one in kept)]
    return kept


def _turn(prism: Prism, candidates: Sequence[Top], kept: Sequence[Prism], wrong: Sequence[Prism]) -> list[Top]:
    """Tops, best first, that overlap with none of them, with no boss that is known, and are not tried yet."""
    chosen: list[Top] = []
    taken = np.any([np.zeros_like(prism.outline), *(island.outline for island in kept)], axis=0)
    for top in candidates:
        height = prism.depth - top.depth
        alike = [i for i in wrong if abs(i.depth - height) <= _TRIED_CELLS * prism.lattice.pitch]
        if not any(_overlaps(top.outline, other) for other in (taken, *(i.outline for i in alike))):
            chosen.append(top)
            taken |= top.outline
    return chosen


def _overlaps(outline: Cells, other: Cells) -> bool:
    """Whether too much of an outline lies on another one."""
    return bool((outline & other).sum() > _OVERLAP * outline.sum())


@dataclass(frozen=True)
class _Seen:
    """A boss, what views disagree by without it, the share of that which it leaves, and whether they believe it."""

    island: Prism
    off: float
    left: float
    believed: bool


def _believed(
    rays: Rays, hull: Volume, prism: Prism, margin: float, cut: Scene, islands: Sequence[Prism]
) -> list[_Seen]:
    """The bosses that views believe, those of one height looked at again without what stood before them."""

    def seen(some: Sequence[Prism]) -> list[_Seen]:
        return _seen(rays, _standing(hull, prism, margin, some), cut, some)

    left, said = list(islands), []
    for _ in range(_LOOKS if islands else 0):
        said = seen(left)
        possible = [one.island for one in said if one.left < 1]  # what is none stands before what is one
        if len(possible) == len(left):
            break
        left = possible
    kept = [one for one in said if one.believed]
    pitch = prism.lattice.pitch
    level = [i for i in islands if any(abs(i.depth - k.island.depth) <= LEVEL_CELLS * pitch for k in kept)]
    return [one for one in seen(level) if one.believed] if len(level) > len(kept) else kept


def _beside_others(rays: Rays, hull: Volume, prism: Prism, margin: float, seen: Sequence[_Seen]) -> list[Prism]:
    """The bosses, but for those that little speaks for once the others stand: views see these behind what is none."""
    left = [one.island for one in seen]
    for one in sorted(seen, key=lambda one: -one.left):
        others = [island for island in left if island is not one.island]
        if not others or one.left <= _SURE_LEFT:
            break
        both = [_standing(hull, prism, margin, some) for some in (left, others)]
        if not _seen(rays, both[0], both[1], [one.island])[0].believed:
            left = others
    return left


def _joined(rays: Rays, hull: Volume, prism: Prism, margin: float, islands: list[Prism]) -> list[Prism]:
    """The bosses, with one for those in line between which views say nothing against another: pieces of a wall's top.

    If there are none, the list as it came.
    """
    for one, other in combinations(islands, 2):
        span = _spanned(prism, one, other)
        if span is not None and (not span[1] or _may_go_on(rays, hull, prism, margin, islands, (one, other), span[0])):
            rest = [i for i in islands if i is not one and i is not other]
            return _joined(rays, hull, prism, margin, [replace(one, outline=span[0], section=None), *rest])
    return islands


def _may_go_on(
    rays: Rays, hull: Volume, prism: Prism, margin: float, islands: Sequence[Prism], ends: tuple[Prism, Prism],
    whole: Cells,
) -> bool:  # fmt: skip
    """Whether views say nothing against a wall's top (R, C) between two bosses that would be its ends."""
    between = replace(ends[0], outline=whole & ~(ends[0].outline | ends[1].outline), section=None)
    both = [_standing(hull, prism, margin, some) for some in ([*islands, between], islands)]
    seen = _seen(rays, both[0], both[1], [between])[0]
    return seen.off >= _LEAST_OFF and seen.left <= _NO_WORSE


def _spanned(prism: Prism, one: Prism, other: Prism) -> tuple[Cells, bool] | None:
    """(R, C) the rectangle along a pocket's walls that two bosses of one height and width span, one behind the other.

    With it, whether there is a gap between them that is wide enough to be told from blur.
    """
    if abs(one.depth - other.depth) > LEVEL_CELLS * prism.lattice.pitch:
        return None
    axes, mine = box(prism, one)
    its = box(prism, other)[1]
    across = [axis for axis in (0, 1) if np.abs(mine[:, axis] - its[:, axis]).max() <= _IN_LINE_CELLS]
    if len(across) != 1:
        return None
    ends = np.array([np.minimum(mine[0], its[0]), np.maximum(mine[1], its[1])])
    at = np.moveaxis(np.indices(prism.outline.shape), 0, -1) @ axes.T  # (R, C, 2)
    along = 1 - across[0]
    gap = max(mine[0, along], its[0, along]) - min(mine[1, along], its[1, along])
    apart = gap > 2 * OPENING_CELLS
    return np.asarray(((at > ends[0]) & (at < ends[1])).all(axis=-1) & prism.outline), bool(apart)


def _levelled(images: Images, cut: Scene, prism: Prism, top: Top) -> Top:
    """The same top at the height, to a part of a cell, at which views agree about most of it."""
    depths = top.depth + np.array(_FINE_CELLS) * prism.lattice.pitch
    agreed = [across(images, cut, prism.lowered(float(d)), top.outline).agreement[top.outline].mean() for d in depths]
    return replace(top, depth=float(depths[int(np.argmax(agreed))]))


def _island(prism: Prism, top: Top) -> Prism:
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
        result.append(_Seen(island, old, new / old if old else np.inf, believed))
    return result


def _on(island: Prism, points: Array) -> NDArray[np.bool_]:
    """(N,) which points (N, 3) lie on a boss's top or walls."""
    cells, height = island.lattice.coordinates(points)
    near = 2 * island.lattice.pitch
    return np.asarray((island.lateral(cells) < near) & (height < near) & (height > -island.depth + near))
