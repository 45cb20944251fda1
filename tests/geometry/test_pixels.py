"""Distances on a grid of pixels, against scipy's exact transform and by hand."""

import numpy as np
from brepgaussian.geometry.pixels import inner_distance
from scipy import ndimage


def test_distances_are_those_of_scipy_with_all_past_the_border_off():
    rng = np.random.default_rng(7)
    mask = ndimage.gaussian_filter(rng.normal(size=(390, 530)), 15) > -0.02
    exact = ndimage.distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]
    np.testing.assert_array_equal(inner_distance(mask), exact)


def test_a_full_mask_ends_at_the_border():
    assert inner_distance(np.ones((5, 5), bool)).max() == 3.0
    assert not inner_distance(np.zeros((4, 6), bool)).any()
