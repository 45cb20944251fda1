"""Noise is estimated, and taken out of views without their steps."""

import cv2
import numpy as np
import pytest
from brepgaussian.artifacts.views import Views
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.degrade import degrade_photos
from brepgaussian.views.noise import denoised, estimate_noise, for_steps
from brepgaussian.views.rig import rig

SIDE = 128


@pytest.mark.parametrize("sigma", [1.0, 2.0, 5.0, 9.0])
def test_noise_is_estimated_on_shaded_faces(sigma):
    rng = np.random.default_rng(17)
    y, x = np.mgrid[:120, :150]
    grey = 80 + 0.3 * x + 0.002 * y**2 + 60 * (x > 70)
    noisy = np.rint(grey + rng.normal(0, sigma, grey.shape)).astype(np.float32)
    assert estimate_noise(noisy, np.ones(grey.shape, bool)) == pytest.approx(sigma, rel=0.15)


@pytest.mark.parametrize(("quality", "sigma"), [(75, 3), (75, 5), (85, 2), (85, 3), (85, 5), (95, 2), (95, 3), (95, 5)])
def test_noise_that_a_jpeg_keeps_is_estimated(quality, sigma):
    """Compression takes the fine part of noise away, so that neighbours alone say there is hardly any."""
    rng = np.random.default_rng(18)
    y, x = np.mgrid[:240, :300]
    grey = np.rint(80 + 0.2 * x + 0.001 * y**2 + 60 * (x > 140)).astype(np.uint8)
    noisy = np.clip(np.rint(grey + rng.normal(0, sigma, grey.shape)), 0, 255).astype(np.uint8)
    _, encoded = cv2.imencode(".jpg", noisy, [cv2.IMWRITE_JPEG_QUALITY, quality])
    kept = cv2.imdecode(encoded, cv2.IMREAD_GRAYSCALE).astype(np.float32)
    rest = (kept - grey)[:, (x[0] < 130) | (x[0] > 152)].std()  # the step's blocks ring
    assert estimate_noise(kept, np.ones(grey.shape, bool)) == pytest.approx(rest, rel=0.25)


def test_noise_free_jpegs_have_little() -> None:
    y, x = np.mgrid[:240, :300]
    grey = np.rint(80 + 0.2 * x + 0.001 * y**2 + 60 * (x > 140)).astype(np.uint8)
    _, encoded = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, 85])
    kept = cv2.imdecode(encoded, cv2.IMREAD_GRAYSCALE).astype(np.float32)
    assert estimate_noise(kept, np.ones(grey.shape, bool)) < 0.6


@pytest.fixture
def faces():
    """Views of two shaded faces with a step of 12 grey levels between them, on garbage."""
    cameras = rig(ViewsSettings(rendered_views=8, image_size=SIDE))
    y, x = np.mgrid[:SIDE, :SIDE]
    grey = np.rint(90 + 0.1 * x + 0.05 * y + 12 * (x > 64)).astype(np.uint8)
    alpha = np.zeros((8, SIDE, SIDE), np.uint8)
    alpha[:, 8:120, 8:120] = 255
    rgb = np.where(alpha[..., None] > 0, grey[None, :, :, None], 0).repeat(3, axis=3).astype(np.uint8)
    return Views("faces", tuple("abcdefgh"), rgb, alpha, cameras, np.eye(4))


def test_views_with_little_noise_stay_as_they_are(faces):
    assert denoised(faces) is faces
    slightly = degrade_photos(faces, ViewsSettings(noise=0.4))
    assert denoised(slightly) is slightly


@pytest.mark.parametrize(("noise", "jpeg", "rest"), [(2.0, 0, 0.4), (5.0, 0, 0.9), (2.0, 85, 0.8), (4.0, 90, 1.0)])
def test_noise_goes_and_steps_stay(faces, noise, jpeg, rest):
    noisy = degrade_photos(faces, ViewsSettings(noise=noise, jpeg_quality=jpeg))
    smooth = denoised(noisy)
    assert smooth.as_taken.rgb is noisy.rgb
    error = smooth.rgb[..., 0].astype(float) - faces.rgb[..., 0]
    flat = np.zeros((SIDE, SIDE), bool)
    flat[16:112, 16:56] = flat[16:112, 74:112] = True
    assert error[:, flat].std() < rest
    step = smooth.rgb[:, 16:112, 66, 0].mean() - smooth.rgb[:, 16:112, 63, 0].mean()
    assert step > 0.75 * 12  # across three pixels
    outside = faces.alpha == 0
    np.testing.assert_array_equal(smooth.rgb[outside], noisy.rgb[outside])


def test_colour_goes_through_and_bytes_do_not_depend_on_threads(faces):
    noisy = degrade_photos(faces, ViewsSettings(noise=3.0))
    tinted = noisy.rgb.copy()
    tinted[..., 2] //= 2
    noisy = Views("faces", noisy.names, tinted, noisy.alpha, noisy.cameras, noisy.world_from_unit)
    one, two = denoised(noisy, 1).rgb, denoised(noisy, 2).rgb
    np.testing.assert_array_equal(one, two)
    error = one[:, 16:112, 16:56].astype(float) - faces.rgb[:, 16:112, 16:56] * np.array([1, 1, 0.5])
    assert np.abs(error).mean() < 0.8


def test_an_empty_view_does_no_harm(faces):
    noisy = degrade_photos(faces, ViewsSettings(noise=3.0))
    alpha = noisy.alpha.copy()
    alpha[3] = 0
    empty = Views("faces", noisy.names, noisy.rgb, alpha, noisy.cameras, noisy.world_from_unit)
    assert (denoised(empty).rgb[3] == noisy.rgb[3]).all()


def test_steps_are_looked_for_in_the_images_as_taken_unless_they_were_compressed(faces):
    assert for_steps(faces) is faces
    white = denoised(degrade_photos(faces, ViewsSettings(noise=2.0)))
    np.testing.assert_array_equal(for_steps(white).rgb, white.taken)
    compressed = denoised(degrade_photos(faces, ViewsSettings(noise=2.0, jpeg_quality=85)))
    assert for_steps(compressed) is compressed
