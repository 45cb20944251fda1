"""Robust weights against a plain reference."""

import numpy as np
import pytest
from brepgaussian.brep.refine.solve import _medians


@pytest.mark.parametrize("count", [1, 2, 7, 5000])
def test_medians_of_groups_are_those_of_numpy(count: int) -> None:
    rng = np.random.default_rng(count)
    values, group = rng.random(count), 3 * rng.integers(0, max(1, count // 4), count)
    expected = np.array([np.median(values[group == k]) for k in group])
    np.testing.assert_array_equal(_medians(values, group), expected)
