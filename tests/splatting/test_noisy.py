"""Noisy images: smoothed ones tell where a concavity is, those as taken how deep."""

import numpy as np
import pytest
from brepgaussian.artifacts.base import Provenance
from brepgaussian.artifacts.views import read_views
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.splatting.concave import Images
from brepgaussian.splatting.concave.depth import measure, measured
from brepgaussian.splatting.concave.openings import rectify
from brepgaussian.splatting.concave.planes import PITCH_PIXELS
from brepgaussian.splatting.concave.prism import Lattice
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.views.degrade import degrade_photos
from brepgaussian.views.noise import denoised
from build123d import Align, Box, Pos
from rendered import rendered

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
SIDE, DEEP = 22.0, 7.0  # of a pocket in a block 40 wide


@pytest.fixture(scope="module")
def views(tmp_path_factory):
    """A block with a square pocket in its top, as a camera with noise and JPEG shows it."""
    part = Box(40, 40, 24, align=LOW) - Pos(0, 0, 24 - DEEP) * Box(SIDE, SIDE, DEEP, align=LOW)
    clean, _ = rendered(tmp_path_factory.mktemp("pocket"), part, 40, 500)
    return denoised(degrade_photos(clean, ViewsSettings(noise=2.0, jpeg_quality=85, seed=3)))


def test_images_as_taken_go_through_the_file(views, tmp_path):
    assert views.taken is not None
    views.write(tmp_path / "views.h5", Provenance("pocket", ""))
    again = read_views(tmp_path / "views.h5")
    np.testing.assert_array_equal(again.rgb, views.rgb)
    np.testing.assert_array_equal(again.as_taken.rgb, views.taken)
    assert again.as_taken.as_taken.taken is None


def test_a_pocket_has_its_depth(views):
    images = Images.of(views, 0.3)
    assert images.as_taken.tolerance > 2 * images.tolerance
    grid = np.stack(np.meshgrid(*[np.arange(97) / 96] * 3, indexing="ij"), axis=-1)
    half = np.array([20, 20, 12]) / 40
    hull = Volume((half - np.abs(grid - 0.5)).min(axis=-1).astype(np.float32), np.zeros(3), 1 / 96).scene()
    pitch = PITCH_PIXELS * views.cameras.footprint()
    cells = 2 * round(0.4 / pitch) + 1
    corner = np.array([0.5, 0.5, 0.5 + half[2]]) - cells * pitch / 2 * np.array([1, 1, 0])
    lattice = Lattice(corner, *np.eye(3), pitch, (cells, cells))
    outline = np.abs(lattice.centers()[..., :2] - 0.5).max(axis=-1) < SIDE / 80
    stack = rectify(images, hull, lattice)
    prism, gain = measured(images, hull, stack, outline)
    assert prism.depth == pytest.approx(DEEP / 40, rel=0.03)
    assert gain == measure(stack, outline, views.cameras.centers, hull, images.tolerance)[1]
