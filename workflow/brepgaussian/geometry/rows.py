"""Distinct rows of integers, by one number a row: sorting rows as such takes several times as long."""

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]

_LARGEST = 2.0**62  # of the numbers that stand for rows


def distinct(rows: Indices) -> tuple[Indices, Indices, Indices]:
    """As `numpy.unique(rows, axis=0, return_inverse=True, return_counts=True)`.

    Args:
        rows: (N, K) integers.

    Returns:
        (P, K) rows in lexicographic order, (N,) which of them each row is, (P,) how often each occurs.
    """
    low, high = (rows.min(axis=0), rows.max(axis=0)) if len(rows) else (rows[:0], rows[:0])
    if len(rows) and np.prod(high.astype(float) - low + 1) < _LARGEST:
        size = tuple((high - low + 1).tolist())
        numbers = np.ravel_multi_index(tuple((rows - low).T), size)
        numbers, inverse, counts = np.unique(numbers, return_inverse=True, return_counts=True)
        return np.column_stack(np.unravel_index(numbers, size)) + low, inverse, counts
    found, inverse, counts = np.unique(rows, axis=0, return_inverse=True, return_counts=True)
    return found, inverse.reshape(-1), counts
