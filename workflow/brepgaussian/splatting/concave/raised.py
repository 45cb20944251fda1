"""Pockets that were opened down to the tops of the bosses in them only.

Rays past a boss's top tell no deeper floor, so a pocket's floor may be taken to be at that height; on it an opening
shows that reaches all walls and leaves the tops. Pocket and opening are one, and the bosses stand in it.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.islands import has_room
from brepgaussian.splatting.concave.openings import opened
from brepgaussian.splatting.concave.planes import PARALLEL
from brepgaussian.splatting.concave.prism import Prism, carried
from brepgaussian.splatting.concave.tops import Top

Cells = NDArray[np.bool_]
Standing = Callable[[int, Prism, Sequence[Top]], Prism]  # a known concavity, deeper, with what stands in it

_ON_FLOOR_CELLS = 3.0  # an opening's plane lies from the floor at most
_AT_WALLS, _WALL_CELLS = 0.6, 4  # share of a floor's border, so wide, that the opening takes; a shoulder keeps it
_LEAST_SHARE = 0.4  # of a floor is open
_COVERED = 0.6  # of what is left of it are tops of bosses that views believe
_WITHIN = 0.8  # of another opening's cells are the pocket's: it is a part of it

logger = log.get_logger("stage1")


def raised(known: Sequence[Prism], found: Sequence[Prism], standing: Standing) -> tuple[dict[int, Prism], list[Prism]]:
    """Known pockets that are deeper and have bosses in them, by their index, and what was found besides.

    Args:
        known: concavities that are carved already; found: openings in what they leave.
        standing: which of some likely bosses views believe in one of the known ones once it is deeper.
    """
    deeper: dict[int, Prism] = {}
    left = list(found)
    for k, prism in _candidates(known, found):
        if k in deeper or not any(prism is other for other in left):
            continue
        whole = replace(known[k], depth=known[k].depth + prism.depth, endless=prism.endless, error=prism.error)
        if not has_room(whole):
            continue
        rest = opened(known[k].outline & ~carried(prism.lattice, prism.outline, known[k].lattice))
        labels, count = ndimage.label(rest)
        if not count:
            continue
        whole = standing(k, whole, [Top(labels == i, known[k].depth, 1.0) for i in range(1, count + 1)])
        stand = np.any([np.zeros_like(rest), *(island.outline for island in whole.islands)], axis=0)
        good = bool((stand & rest).sum() >= _COVERED * rest.sum())
        logger.info(
            "pocket of area %.4f, %.4f deep, around tops on its floor: %.4f deep, %d bosses%s",
            known[k].area, known[k].depth, whole.depth, len(whole.islands), "" if good else ": not believed",
        )  # fmt: skip
        if good:
            deeper[k] = whole
            left = [other for other in left if other is not prism and not _within(other, whole)]
    return deeper, left


def _candidates(known: Sequence[Prism], found: Sequence[Prism]) -> Iterator[tuple[int, Prism]]:
    """Pockets without bosses, each with an opening of its floor that reaches its walls but leaves a part of it."""
    for prism in sorted(found, key=lambda prism: -prism.area):
        for k, pocket in enumerate(known):
            if pocket.through or pocket.ring or pocket.islands or not _on_floor(pocket, prism):
                continue
            open_cells = pocket.outline & carried(prism.lattice, prism.outline, pocket.lattice)
            beside = pocket.outline & ~ndimage.binary_erosion(pocket.outline, iterations=_WALL_CELLS)
            share = open_cells.sum() / max(pocket.outline.sum(), 1)
            if share >= _LEAST_SHARE and (open_cells & beside).sum() >= _AT_WALLS * beside.sum():
                yield k, prism


def _on_floor(pocket: Prism, prism: Prism) -> bool:
    """Whether an opening lies in a pocket's floor."""
    lattice = pocket.lattice
    height = (prism.lattice.origin - lattice.origin) @ lattice.normal + pocket.depth
    aligned = float(prism.lattice.normal @ lattice.normal) > PARALLEL
    return aligned and not prism.through and abs(float(height)) < _ON_FLOOR_CELLS * lattice.pitch


def _within(prism: Prism, pocket: Prism) -> bool:
    """Whether an opening is a part of a pocket."""
    if float(prism.lattice.normal @ pocket.lattice.normal) < PARALLEL:
        return False
    lattice = pocket.lattice
    mouth = float((prism.lattice.origin - lattice.origin) @ lattice.normal)
    slack = _ON_FLOOR_CELLS * lattice.pitch
    if mouth > slack or prism.depth - mouth > pocket.depth + slack:
        return False
    here = carried(prism.lattice, prism.outline, lattice)
    cells = max(int(prism.outline.sum() * (prism.lattice.pitch / lattice.pitch) ** 2), 1)
    return bool((here & pocket.outline).sum() >= _WITHIN * cells)
