"""Interpolation in images and volumes against scipy's."""

import numpy as np
import pytest
from brepgaussian.splatting.sample import sample
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage


@given(
    shape=st.one_of(st.tuples(*[st.integers(1, 7)] * 2), st.tuples(*[st.integers(1, 7)] * 3)),
    seed=st.integers(0, 2**31),
)
def test_as_scipy_interpolates(shape: tuple[int, ...], seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(size=shape).astype(np.float32)
    at = rng.uniform(-1, np.array(shape) + 1, (50, len(shape)))
    corners = np.array([np.zeros(len(shape)), np.array(shape) - 1.0])
    at = np.vstack([at, corners])
    expected = ndimage.map_coordinates(values, at.T, order=1, cval=-3.0)
    np.testing.assert_allclose(sample(values, at, -3.0), expected, atol=1e-6)


def test_images_of_bytes() -> None:
    rng = np.random.default_rng(7)
    image = rng.integers(0, 256, (20, 30)).astype(np.uint8)
    at = rng.uniform(-1, 31, (200, 2))
    np.testing.assert_allclose(sample(image, at), sample(image.astype(np.float32), at), atol=1e-5)


def test_no_values_and_no_places() -> None:
    assert sample(np.zeros((0, 4), np.float32), [[0.0, 0.0]], 2.0).tolist() == [2.0]
    assert sample(np.zeros((3, 4), np.float32), np.zeros((0, 2))).shape == (0,)


def test_not_a_number_lies_outside() -> None:
    assert sample(np.ones((3, 3), np.float32), [[np.nan, 1.0]], -1.0).tolist() == [-1.0]


def test_wrong_shapes() -> None:
    with pytest.raises(ValueError, match="shape"):
        sample(np.zeros((3, 3), np.float32), np.zeros((4, 3)))
