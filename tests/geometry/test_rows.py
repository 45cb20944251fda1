"""Distinct rows by one number each, against NumPy's own."""

import numpy as np
import pytest
from brepgaussian.geometry.rows import distinct
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays


def reference(rows):
    found, inverse, counts = np.unique(rows, axis=0, return_inverse=True, return_counts=True)
    return found, inverse.reshape(-1), counts


@given(arrays(np.int64, array_shapes(min_dims=2, max_dims=2, min_side=0, max_side=30).filter(lambda s: s[1] > 0),
              elements=st.integers(-5, 5)))  # fmt: skip
def test_small_numbers(rows):
    for mine, known in zip(distinct(rows), reference(rows), strict=True):
        np.testing.assert_array_equal(mine, known)


@pytest.mark.parametrize("reach", [10**3, 10**9, 2**62])
def test_wide_ranges_too(reach):
    rng = np.random.default_rng(4)
    rows = rng.integers(-reach, reach, (200, 3))[rng.integers(0, 200, 900)]
    for mine, known in zip(distinct(rows), reference(rows), strict=True):
        np.testing.assert_array_equal(mine, known)
