"""Shoulders: the floor of a wide round opening, where a narrower hole goes on along the same axis.

Rays that look into the hole contradict a flat floor. Where wall and floor throw so much light at each other that both
have one grey, a deeper floor is contradicted by fewer, and so all of a counterbore is opened too deep. That its floor
is a ring is told by a narrower opening that faces it, or by silhouettes, which have pierced the hull below it.

Where no view sees the floor at all, silhouettes may tell the least that it is deep: light that comes in by the narrower
hole and out by the wide one leaves a cone, which is wider than the hole only where the wide one is.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian import log
from brepgaussian.splatting.concave.depth import shoulder
from brepgaussian.splatting.concave.join import distance_between, face_each_other, throat
from brepgaussian.splatting.concave.openings import Images, rectify
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.rays import crossings_below
from brepgaussian.splatting.concave.scene import Scene

Array = NDArray[np.float64]

_ROUND = 1.15  # of the radius that its area tells, to an opening's farthest cell
_NARROWER = 0.8  # of the opening's radius, at most, the hole has
_LEAST_HOLLOW = 0.4  # of that radius is looked past where silhouettes have pierced a part of the hole
_PIERCED_CELLS = 3
_CLEAR_CELLS = 1.5  # from the walls of either, what silhouettes leave empty belongs to neither
_SHALLOWER = 0.9  # of the depth of a flat floor; else that is as good

logger = log.get_logger("stage1")


def with_shoulders(images: Images, scene: Scene, prisms: Sequence[Prism], tolerance: float) -> list[Prism]:
    """The same concavities, those with a narrower hole below them down to their shoulder, the hole up to it.

    Args:
        images: of all views.
        scene: the hull, before they are cut.
        prisms: concavities of one hull.
        tolerance: distance by which the axes of one hole may seem to differ.
    """
    left = list(prisms)
    for i in range(len(left)):
        wide = left[i]  # not as it came: a hole that reaches up to another one's shoulder has no floor any more
        if not _is_plain(wide):
            continue
        narrow = _narrower(wide, left, tolerance)
        if narrow and wide.endless:
            least = _emptied(scene, wide, [left[k] for k in narrow])
            if least is not wide:  # rays have told the walls for the floor
                left[i] = least
                continue
        hollow = max((throat(left[k]) for k in narrow), default=_pierced(scene, wide))
        depth = _shoulder(images, scene, wide, hollow) if hollow else None
        if depth is not None:
            left[i] = replace(wide, depth=depth, endless=False, ring=bool(narrow))
            for k in narrow:
                through = distance_between(wide, left[k]) - depth
                left[k] = replace(left[k], depth=max(through, left[k].depth), through=True, endless=False)
    return left


def _narrower(wide: Prism, prisms: Sequence[Prism], tolerance: float) -> list[int]:
    """Indices of narrower holes that face a concavity and may lead to it."""
    return [
        k
        for k, other in enumerate(prisms)
        if other is not wide and (other.endless or other.through) and throat(other) < _NARROWER * throat(wide)
        and face_each_other(wide, other, tolerance)
    ]  # fmt: skip


def _emptied(scene: Scene, wide: Prism, narrow: Sequence[Prism]) -> Prism:
    """The same without a floor that rays tell, down to where silhouettes leave more empty than the narrower holes."""
    pitch = wide.lattice.pitch
    cells = wide.lattice.centers()[wide.outline]
    clear = _away(wide) < throat(wide) - _CLEAR_CELLS * pitch
    for hole in narrow:
        offset = cells - hole.middle
        offset -= (offset @ hole.lattice.normal)[:, None] * hole.lattice.normal
        clear &= np.linalg.norm(offset, axis=1) > throat(hole) + _CLEAR_CELLS * pitch
    cells, deepest = cells[clear], max(distance_between(wide, hole) for hole in narrow)
    depth = wide.depth
    while depth + pitch < deepest:
        below = cells - (depth + pitch) * wide.lattice.normal
        if np.count_nonzero(~scene.inside(below)) < _PIERCED_CELLS:
            break
        depth += pitch
    if depth < wide.depth + _CLEAR_CELLS * pitch:
        return wide
    logger.info("opening of area %.4f: silhouettes leave it empty down to %.4f, not %.4f", wide.area, depth, wide.depth)
    return replace(wide, depth=depth)


def _shoulder(images: Images, scene: Scene, wide: Prism, hollow: float) -> float | None:
    """Depth of the shoulder around a hole of some radius, None if the flat floor that was found is as good."""
    taken, centers = images.as_taken, images.views.cameras.centers
    stack = rectify(taken, scene, wide.lattice)
    depth = shoulder(stack, wide.outline, centers, scene, taken.tolerance, hollow / wide.lattice.pitch + 1)
    found = depth if depth is not None and depth < _SHALLOWER * wide.depth else None
    logger.info(
        "opening of area %.4f over a hole of radius %.4f: shoulder %s deep, not %.4f%s",
        wide.area, hollow, "unknown" if depth is None else f"{depth:.4f}", wide.depth, "" if found else ": kept",
    )  # fmt: skip
    return found


def _is_plain(prism: Prism) -> bool:
    """Whether a concavity is round and straight, has a floor, and nothing stands over it."""
    if prism.through or prism.domed or prism.draft or any(prism.tilt) or prism.above:
        return False
    return is_round(prism.outline)


def is_round(outline: NDArray[np.bool_]) -> bool:
    """Whether an outline (R, C) is about a disc; an empty one is none."""
    cells = np.argwhere(outline)
    if not len(cells):
        return False
    away = np.linalg.norm(cells - cells.mean(axis=0), axis=1).max()
    return bool(away < _ROUND * np.sqrt(len(cells) / np.pi) + 1)


def _pierced(scene: Scene, prism: Prism) -> float:
    """Radius about a concavity's middle within which silhouettes have pierced what lies below; 0 if they haven't."""
    crossings, _ = crossings_below(scene, prism.lattice.centers()[prism.outline], prism.lattice)
    empty, away, radius = ~np.isfinite(crossings).any(axis=1), _away(prism), throat(prism)
    within = empty & (away < _NARROWER * radius)
    if np.count_nonzero(within) < _PIERCED_CELLS or np.count_nonzero(empty) > np.count_nonzero(within):
        return 0.0
    return float(max(away[within].max(), _LEAST_HOLLOW * radius))


def _away(prism: Prism) -> Array:
    """(N,) distance of an opening's cells from their middle."""
    cells = np.argwhere(prism.outline)
    return np.asarray(np.linalg.norm(cells - cells.mean(axis=0), axis=1) * prism.lattice.pitch)
