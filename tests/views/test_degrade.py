"""Noise and JPEG in photographs."""

import numpy as np
import pytest
from brepgaussian.artifacts.views import Views
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.degrade import degrade_photos
from brepgaussian.views.rig import rig

SIDE = 64


@pytest.fixture
def photos():
    cameras = rig(ViewsSettings(rendered_views=8, image_size=SIDE))
    rgb = np.full((8, SIDE, SIDE, 3), 120, np.uint8)
    rgb[:, :, SIDE // 2 + 3 :] = 90  # a step inside a block of JPEG's
    alpha = np.zeros((8, SIDE, SIDE), np.uint8)
    alpha[:, 8:56, 8:56] = 255
    rgb[alpha == 0] = 0
    return Views("photos", tuple("abcdefgh"), rgb, alpha, cameras, np.eye(4))


def test_photos_stay_as_they_are_unless_asked(photos):
    assert degrade_photos(photos, ViewsSettings()) is photos


def test_noise_has_its_size_in_the_luminance_and_differs_between_views(photos):
    inside = photos.alpha == 255
    noisy = degrade_photos(photos, ViewsSettings(noise=5.0)).rgb
    change = noisy[inside].astype(float) - photos.rgb[inside]
    assert change.mean(axis=1).std() == pytest.approx(5, rel=0.05)
    assert (noisy[0] != noisy[1]).any()
    assert (noisy[~inside] == 0).all()
    assert (degrade_photos(photos, ViewsSettings(noise=5.0)).rgb == noisy).all()


def test_jpeg_changes_little_and_keeps_the_background(photos):
    coded = degrade_photos(photos, ViewsSettings(jpeg_quality=85)).rgb
    assert 0 < np.abs(coded.astype(int) - photos.rgb)[photos.alpha == 255].mean() < 3
    assert (coded[photos.alpha == 0] == 0).all()
