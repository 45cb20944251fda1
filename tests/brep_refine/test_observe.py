"""Sub-pixel positions against images whose edges are known exactly."""

import numpy as np
import pytest
from brepgaussian.brep.refine.observe import Images, measure
from brepgaussian.brep.refine.samples import Rays
from brepgaussian.brep.refine.visibility import CREASE, SILHOUETTE, Seen
from scipy.special import ndtr

SIZE = 60


PIXEL_FILTER = 0.41  # px, standard deviation of a renderer's filter 3 px wide


def half_plane(angle: float, offset: float) -> np.ndarray:
    """(H, W) coverage of n . (x - centre) < offset through a Gaussian pixel filter, exact."""
    n, at = np.array([np.cos(angle), np.sin(angle)]), np.arange(SIZE) + 0.5 - SIZE / 2
    x, y = np.meshgrid(at, at)
    return ndtr((offset - n[0] * x - n[1] * y) / PIXEL_FILTER).astype(np.float32)


def half_plane_by_area(angle: float, offset: float, fine: int = 16) -> np.ndarray:
    """(H, W) the same through a box of one pixel."""
    n = np.array([np.cos(angle), np.sin(angle)])
    at = ((np.arange(SIZE)[:, None] + (np.arange(fine) + 0.5) / fine) - SIZE / 2).ravel()
    x, y = np.meshgrid(at, at)
    inside = n[0] * x + n[1] * y < offset
    return inside.reshape(SIZE, fine, SIZE, fine).mean(axis=(1, 3)).astype(np.float32)


def seen_at(angle: float, kind: int, count: int = 9) -> Seen:
    """Rays along the line through the centre of the image, normal at `angle`."""
    n = np.array([np.cos(angle), np.sin(angle)])
    along = np.linspace(-10, 10, count)[:, None] * np.array([-n[1], n[0]])
    zero = np.zeros(count, int)
    return Seen(
        Rays(
            zero,
            zero,
            np.arange(count),
            np.zeros((count, 3)),
            np.zeros((count, 2), int),
            SIZE / 2 + along,
            np.tile(n, (count, 1)),
            np.zeros((count, 2)),
        ),
        np.full(count, kind),
    )


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.1, 2.5, 4.0])
@pytest.mark.parametrize("offset", [-4.3, -0.4, 0.0, 0.7, 5.2])
def test_silhouettes_are_found_to_hundredths_of_a_pixel(angle, offset):
    alpha = half_plane(angle, offset)[None]
    images = Images(alpha, np.zeros_like(alpha), np.zeros(2), 0.0, 0.02)
    found = measure(images, seen_at(angle, SILHOUETTE), 6.0, 3.0)
    np.testing.assert_allclose(found.offset, offset, atol=0.035)  # what pixels alias
    assert np.abs(found.offset - offset).mean() < 0.02


@pytest.mark.parametrize("angle", [0.3, 1.1, 2.5])
def test_aliased_silhouettes_are_right_on_average(angle):
    alpha = half_plane_by_area(angle, 0.3)[None]
    images = Images(alpha, np.zeros_like(alpha), np.zeros(2), 0.0, 0.02)
    found = measure(images, seen_at(angle, SILHOUETTE, 31), 6.0, 3.0)
    assert abs(found.offset.mean() - 0.3) < 0.01
    np.testing.assert_allclose(found.offset, 0.3, atol=0.08)


@pytest.mark.parametrize("angle", [0.2, 1.9, 3.7])
@pytest.mark.parametrize("offset", [-1.6, 0.25, 2.4])
def test_steps_are_found_with_their_height(angle, offset):
    luminance = 90 + 40 * half_plane(angle, offset)[None]
    images = Images(np.ones_like(luminance), luminance, np.zeros(2), 0.0, 0.02)
    found = measure(images, seen_at(angle, CREASE), 6.0, 3.0)
    np.testing.assert_allclose(found.offset, offset, atol=0.035)
    np.testing.assert_allclose(found.step, 40, atol=0.5)


def test_noise_widens_the_expected_error_not_the_mean():
    rng, angle = np.random.default_rng(2), 0.8
    luminance = (90 + 40 * half_plane(angle, 0.5) + rng.normal(0, 5, (SIZE, SIZE))).astype(np.float32)[None]
    images = Images(np.ones_like(luminance), luminance, np.zeros(2), 5.0, 0.02)
    found = measure(images, seen_at(angle, CREASE, 41), 6.0, 3.0)
    good = np.isfinite(found.offset)
    assert good.mean() > 0.9
    assert abs(np.median(found.offset[good]) - 0.5) < 0.2
    assert (found.sigma[good] > 0.3).all()


def test_a_missing_edge_is_not_invented():
    flat = np.full((1, SIZE, SIZE), 100, np.float32)
    images = Images(np.ones_like(flat), flat, np.zeros(2), 0.0, 0.02)
    assert np.isnan(measure(images, seen_at(0.4, CREASE), 6.0, 3.0).offset).all()
    assert np.isnan(measure(images, seen_at(0.4, SILHOUETTE), 6.0, 3.0).offset).all()


def test_a_minority_of_opposite_steps_is_dropped():
    angle = 0.3
    bright, dark = 90 + 40 * half_plane(angle, 0.0), 90 - 40 * half_plane(angle, 0.0)
    luminance = np.stack([bright, bright, dark]).astype(np.float32)
    parts = [seen_at(angle, CREASE) for _ in range(3)]
    rays = Rays(
        **{
            name: np.concatenate([getattr(p.rays, name) for p in parts])
            for name in vars(parts[0].rays)
            if name != "view"
        },
        view=np.repeat([0, 1, 2], 9),
    )
    seen = Seen(rays, np.full(27, CREASE))
    found = measure(Images(np.ones_like(luminance), luminance, np.zeros(2), 0.0, 0.02), seen, 6.0, 3.0)
    assert np.isfinite(found.offset[:18]).all()
    assert np.isnan(found.offset[18:]).all()
