"""Circles next to points of a plane."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_REWEIGHTINGS = 15
_RANK = 1e-10  # singular values of the terms, over the largest one: points on a line lie on no circle


def circle_next_to(points: Array, weight: Array | float = 1.0) -> tuple[Array, float]:
    """Middle (2,) and radius of the circle next to points (N, 2), by algebraic least squares with (N,) weights."""
    solution, _ = _solved(points, weight)
    return solution[:2], float(np.sqrt(max(_square(solution), 0.0)))


def circle_through(points: Array) -> tuple[Array, float] | None:
    """The same, or None for points (N, 2) on a line, or too few."""
    solution, rank = _solved(points, 1.0)
    return None if rank < 3 or _square(solution) <= 0 else (solution[:2], float(np.sqrt(_square(solution))))


def circle_of_most(points: Array, scale: float) -> tuple[Array, float]:
    """Middle (2,) and radius of the circle on which most of points (N, 2) lie, by reweighted least squares.

    Args:
        points: some of which lie on no circle.
        scale: a tenth of it is the least distance that counts.
    """
    weight = np.ones(len(points))
    for _ in range(_REWEIGHTINGS):
        middle, radius = circle_next_to(points, weight)
        off = np.abs(np.linalg.norm(points - middle, axis=1) - radius)
        weight = 1 / (1 + (off / max(float(np.median(off)), scale / 10)) ** 2)
    return middle, radius


def _solved(points: Array, weight: Array | float) -> tuple[Array, int]:
    terms = np.column_stack([2 * points, np.ones(len(points))])
    solution, _, rank, _ = np.linalg.lstsq((terms.T * weight).T, (points**2).sum(axis=1) * weight, rcond=_RANK)
    return solution, int(rank)


def _square(solution: Array) -> float:
    return float(solution[2] + solution[:2] @ solution[:2])
