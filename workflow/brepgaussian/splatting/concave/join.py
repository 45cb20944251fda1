"""Two openings of one hole: a hole too long to be seen through shows the same outline on both sides, and no floor."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.concave.prism import Prism

Array = NDArray[np.float64]

_OPPOSITE = 0.999  # cosine of 2.5 degrees
_SAME_AREA = 1.5  # ratio of two outlines of one hole


def joined(prisms: Sequence[Prism], tolerance: float) -> list[Prism]:
    """The same concavities, but two that face each other and tell no floor are one hole that goes through.

    Args:
        prisms: concavities of one hull.
        tolerance: distance by which the axes of one hole may seem to differ.
    """
    left = list(prisms)
    for i, first in enumerate(left):
        for j in range(i + 1, len(left)):
            if _one_hole(first, left[j], tolerance) and not first.through:
                distance = _distance(first, left[j])
                smaller, larger = sorted((i, j), key=lambda k: left[k].area)
                left[smaller] = replace(left[smaller], depth=distance, through=True)
                left[larger] = replace(left[larger], depth=min(left[larger].depth, distance))
    return left


def _one_hole(first: Prism, second: Prism, tolerance: float) -> bool:
    """Whether two concavities may be the two ends of one straight hole."""
    straight = not (first.draft or second.draft or any(first.tilt) or any(second.tilt))
    if not (straight and first.endless and second.endless):
        return False
    if first.lattice.normal @ second.lattice.normal > -_OPPOSITE or _distance(first, second) <= 0:
        return False
    aside = _middle(second) - _middle(first)
    aside -= (aside @ first.lattice.normal) * first.lattice.normal
    ratio = first.area / second.area
    return bool(np.linalg.norm(aside) < tolerance and 1 / _SAME_AREA < ratio < _SAME_AREA)


def _distance(first: Prism, second: Prism) -> float:
    """How far the second's opening lies below the first's."""
    return float((_middle(first) - _middle(second)) @ first.lattice.normal)


def _middle(prism: Prism) -> Array:
    """(3,) the outline's centre."""
    return np.asarray(prism.lattice.centers()[prism.outline].mean(axis=0))
