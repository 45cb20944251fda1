"""Holes that meet another one: a set-screw hole, a vent, a port, a channel that crosses a bore.

Down a narrow hole few views see where it leads, and a bore behind its end has the grey of its own walls. So rays tell
the least depth that explains them, and no floor. Nobody leaves a thin wall between two holes; so where no ray tells a
floor and the other hole is less than its own width away, it meets that. And axes hardly cross by chance: a hole whose
axis crosses that of a wider one, which may have no told floor either, goes on to it; so does one that ends there. But
in what is turned they cross by themselves: there, too, no more than its own width may be between.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian import log
from brepgaussian.splatting.concave.ends import core_of, is_straight
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.rays import crossings_below
from brepgaussian.splatting.concave.scene import Scene

Array = NDArray[np.float64]

_AT_FLOOR_CELLS = 2.0  # between a hull's floor and the depth that it was cut to
_WITHIN_CELLS = 1.0  # of the other hole's wall: where a line leaves the solid it is in that one
_THINNEST_WALL = 1.0  # widths of a hole: what is left between it and another one is thicker
_CROSSING = 0.25  # radii of the narrower hole between axes that cross: it may seem to lean by a degree
_WIDER = 1.1  # times the radius: holes of one drill that point at each other's axes may as well stop before
_ASKEW = np.cos(np.radians(30.0))  # between axes that cross
_PAST = 1.5  # radii of the narrower hole that the wider one goes on beyond its axis
_MUCH_DEEPER = 6.0  # times as deep as rays have shown the wider one, at most
_MOSTLY = 0.5  # of its cells lie over the other hole, which may be narrower

logger = log.get_logger("stage1")


def met(scene: Scene, prism: Prism, others: Sequence[Prism]) -> Prism:
    """A straight blind hole, or the same up to another hole that it nearly reaches.

    Where a floor of it is told, views have to agree better on what becomes of it: of a wide bore that was not known
    by then, rays told something.

    Args:
        scene: the hull with all concavities carved.
        prism: one of them; others: the rest.
    """
    plain = not (prism.ring or prism.domed or prism.step or prism.islands)
    if prism.through or not is_straight(prism) or not plain:
        return prism
    pitch = prism.lattice.pitch
    width = 2 * np.sqrt(prism.area / np.pi) / pitch
    ends = _reached(scene, prism, others, _THINNEST_WALL * width)
    core = np.isfinite(ends)[core_of(prism)[prism.outline]]
    if not len(core) or core.mean() < _MOSTLY:
        return prism
    depth = float(ends[np.isfinite(ends)].max()) * pitch
    logger.info("hole of area %.4f: %.4f deep to where it meets another, not %.4f", prism.area, depth, prism.depth)
    return replace(prism, depth=max(depth, prism.depth), through=True, endless=False)


def crossed(scene: Scene, known: Sequence[Prism]) -> dict[int, Prism]:
    """Those of some straight holes that go on to where their axes cross, by index.

    Args:
        scene: the hull with all of them carved.
        known: all concavities.
    """
    result: dict[int, Prism] = {}
    for k, hole in enumerate(known):
        if hole.through or not is_straight(hole):
            continue
        for j, wide in enumerate(known):
            if j != k and is_straight(wide) and not (wide.domed or wide.step):
                pair = _to_crossing(scene, hole, result.get(j, wide))
                if pair is not None:
                    result[k], result[j] = pair
                    logger.info("hole of area %.4f: %.4f deep to the axis of another, %.4f deep, not %.4f and %.4f",
                                hole.area, pair[0].depth, pair[1].depth, hole.depth, wide.depth)  # fmt: skip
                    break
    return {k: prism for k, prism in result.items() if prism is not known[k]}


def _to_crossing(scene: Scene, hole: Prism, wide: Prism) -> tuple[Prism, Prism] | None:
    """A hole up to the axis of a wider one, and that as deep as it has to be; None if they do not cross."""
    narrow, broad = (float(np.sqrt(p.area / np.pi)) for p in (hole, wide))
    down, across = -hole.lattice.normal, -wide.lattice.normal
    if broad < _WIDER * narrow or abs(float(down @ across)) > _ASKEW:
        return None
    (deep, along), apart = _closest(hole.middle, down, wide.middle, across)
    if apart > _CROSSING * narrow or along < narrow or deep < broad:
        return None
    if deep - broad - hole.least_depth > 2 * _THINNEST_WALL * narrow:
        return None
    if not hole.endless and abs(hole.depth - deep) > broad:
        return None  # its floor is told, and lies elsewhere
    if not _is_solid(scene, hole, deep - broad):
        return None  # a fork's bore ends in its gap, or before
    needed = along + _PAST * narrow
    if wide.depth < needed:
        if not wide.endless or wide.through or needed > _MUCH_DEEPER * wide.least_depth:
            return None
        wide = replace(wide, depth=needed)
    end = wide.middle + wide.depth * across
    if not wide.through and not scene.inside(np.array([end + narrow * across]))[0]:
        return None  # it would come out
    return replace(hole, depth=max(deep, hole.depth), through=True, endless=False), wide


def _is_solid(scene: Scene, hole: Prism, depth: float) -> bool:
    """Whether nothing but solid lies between the end of a hole and a greater depth, along its axis."""
    pitch = hole.lattice.pitch
    depths = np.arange(hole.depth + _AT_FLOOR_CELLS * pitch, depth - _AT_FLOOR_CELLS * pitch, pitch)
    places = hole.middle - depths[:, None] * hole.lattice.normal
    return bool(scene.inside(places).all())


def _closest(one: Array, along: Array, other: Array, across: Array) -> tuple[Array, float]:
    """(2,) how far along two lines through points (3,) in unit directions (3,) they are closest, and how close."""
    design = np.column_stack([along, -across])
    far = np.asarray(np.linalg.lstsq(design, other - one, rcond=None)[0], np.float64)
    return far, float(np.linalg.norm(one + far[0] * along - other - far[1] * across))


def _reached(scene: Scene, prism: Prism, others: Sequence[Prism], most: float) -> Array:
    """(N,) depth, in cells, at which lines down from its opening come into another hole, infinite where they don't.

    At `most` so many cells of solid lie between that and what rays show of the hole.
    """
    starts, pitch = prism.lattice.centers()[prism.outline], prism.lattice.pitch
    crossings, _ = crossings_below(scene, starts, prism.lattice)
    floor = prism.depth / pitch
    beyond = np.sort(np.where(crossings > floor - _AT_FLOOR_CELLS, crossings, np.inf), axis=1)
    first, second = np.pad(beyond, ((0, 0), (0, 2)), constant_values=np.inf)[:, :2].T
    # a line that does not meet the floor is in the open there already: below a shoulder, too, of which one is told
    end = np.where(first <= floor + _AT_FLOOR_CELLS, second, floor if prism.endless else np.inf)
    end = np.where(end - prism.least_depth / pitch <= most, end, np.inf)
    found = np.flatnonzero(np.isfinite(end))
    places = starts[found] - ((end[found] + _WITHIN_CELLS) * pitch)[:, None] * prism.lattice.normal
    within = np.zeros(len(found), bool)
    for other in others:
        within |= other.signed_distance(places, 0.0) < _WITHIN_CELLS * pitch
    end[found[~within]] = np.inf
    return end
