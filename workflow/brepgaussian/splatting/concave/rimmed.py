"""Lids of which nothing but a thin rim is a face: the lid is turned and moved to where views agree about that rim.

The plane of a hull's lid errs by a cell. A wide frame of face around an opening bears that; a rim of a few cells does
not, and without a frame an opening is not looked at.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.pixels import inner_distance
from brepgaussian.log import get_logger
from brepgaussian.splatting.concave.openings import Images, Stack, across, is_framed, openings, rectify
from brepgaussian.splatting.concave.planes import PARALLEL, Plane
from brepgaussian.splatting.concave.prism import Lattice
from brepgaussian.splatting.concave.scene import Scene

Array = NDArray[np.float64]

_MOST_OF = 0.6  # of a lid is one opening, if a rim is all that is left of it
_BLUR_CELLS, _RIM_CELLS = 1, (4, 2)  # from a lid's border, where its rim is looked at: a wide one tells more
_STEPS = (2.0, 1.0, 0.5, 0.25)  # cells by which a lid is moved, or its border by a turn
_LEAST_AGREED = 0.8  # of the views of a rim's cell, on average
_BETTER = 0.03  # of the views more have to agree where a lid is moved

logger = get_logger("stage1")


def settled(
    images: Images, scene: Scene, stack: Stack, known: Sequence[Plane], least_area: float
) -> tuple[Stack, bool]:
    """What the views show on a lid, moved to its rim if that is all that is left of it, and whether it was.

    Args:
        images: of all views.
        scene: the hull.
        stack: what they show on the lid as it came.
        known: planes of faces that views have confirmed: the lid may be parallel to one.
        least_area: of an opening.
    """
    wide = [outline for outline in openings(stack, least_area) if rimmed(outline, stack)]
    if not wide or is_framed(stack, wide[0]):
        return stack, False
    away = inner_distance(stack.domain)
    starts = [stack.lattice, *_parallel(stack.lattice, known)]
    for width in _RIM_CELLS:
        rim = (away > _BLUR_CELLS) & (away <= width)
        before, after, lattice = _climbed(images, scene, starts, rim)
        if max(before, after) >= _LEAST_AGREED:
            moved = after >= before + _BETTER
            logger.info(
                "lid with a thin rim: %.2f of the views agree about it, %.2f where it is moved%s",
                before, after, "" if moved else ": it is not",
            )  # fmt: skip
            return (rectify(images, scene, lattice) if moved else stack), True
    return stack, False


def rimmed(outline: NDArray[np.bool_], stack: Stack) -> bool:
    """Whether an outline leaves but a rim of a lid."""
    return bool(outline.sum() >= _MOST_OF * stack.domain.sum())


def _climbed(
    images: Images, scene: Scene, starts: Sequence[Lattice], rim: NDArray[np.bool_]
) -> tuple[float, float, Lattice]:
    """Agreement about the rim on the first start, and the best agreement, with its lattice, step by step from there."""

    def agreed(lattice: Lattice) -> float:
        return float(across(images, scene, lattice, rim).agreement[rim].mean()) if rim.any() else 0.0

    scores = [agreed(start) for start in starts]
    best, lattice = max(scores), starts[int(np.argmax(scores))]
    for step in _STEPS:
        moved = True
        while moved:
            moved = False
            for move in (*np.eye(3), *-np.eye(3)):
                other = _moved(lattice, step * move)
                score = agreed(other)
                if score > best:
                    best, lattice, moved = score, other, True
    return scores[0], best, lattice


def _parallel(lattice: Lattice, known: Sequence[Plane]) -> list[Lattice]:
    """The lattice turned about its middle to be parallel to planes that it nearly is parallel to."""
    alike = [float(np.sign(p.normal @ lattice.normal)) * p.normal for p in known]
    return [_turned(lattice, normal) for normal in alike if normal @ lattice.normal > PARALLEL]


def _moved(lattice: Lattice, by: Array) -> Lattice:
    """The lattice moved along its normal, and turned by so many cells at its borders (3,)."""
    pitch, (rows, columns) = lattice.pitch, lattice.shape
    raised = replace(lattice, origin=lattice.origin + by[0] * pitch * lattice.normal)
    tilt = by[1] / (rows / 2) * lattice.first + by[2] / (columns / 2) * lattice.second
    return _turned(raised, (lattice.normal + tilt) / np.linalg.norm(lattice.normal + tilt))


def _turned(lattice: Lattice, normal: Array) -> Lattice:
    """The lattice turned about its middle to a normal (3,)."""
    half = np.array(lattice.shape) * lattice.pitch / 2
    middle = lattice.origin + half[0] * lattice.first + half[1] * lattice.second
    first = lattice.first - (lattice.first @ normal) * normal
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    return replace(
        lattice, origin=middle - half[0] * first - half[1] * second, first=first, second=second, normal=normal
    )
