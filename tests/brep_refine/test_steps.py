"""Steps in grey clear of a solid's edges: features that it lacks, and none where it is right."""

from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.brep.refine.steps import image_steps, stepped, watching
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.splatting.concave import Images
from build123d import Align, Axis, Box, Cylinder, Pos, Rot, fillet
from refine_support import asked_of, views_of

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
LIMIT = BrepSettings().accept_stepped


def grooved(width=3.0, deep=1.5):
    """A shaft between two flanges, with a groove around it."""
    shaft = Cylinder(10, 40, align=LOW) + Cylinder(18, 8, align=LOW) + Pos(0, 0, 32) * Cylinder(18, 8, align=LOW)
    ring = Pos(0, 0, 18) * (Cylinder(11, width, align=LOW) - Cylinder(10 - deep, width, align=LOW))
    return shaft, shaft - ring


@pytest.mark.parametrize("settings", [{}, {"noise": 5.0}, {"jpeg_quality": 85}, {"interreflection": 0.95}])
def test_no_step_is_clear_of_the_edges_of_the_right_solid(tmp_path, settings):
    plate = Box(60, 44, 8, align=LOW)
    plate = fillet(plate.edges().filter_by(Axis.Z), 5)
    part = plate + Pos(0, 0, 8) * Cylinder(11, 9, align=LOW) - Pos(20, 0, 4) * Box(9, 20, 9, align=LOW)
    assert stepped(*asked_of(part, views_of(part, tmp_path, **settings))) == 0


@pytest.mark.parametrize("settings", [{}, {"jpeg_quality": 85}])
def test_a_groove_that_a_solid_lacks_is_seen(tmp_path, settings):
    shaft, part = grooved()
    views = views_of(part, tmp_path, **settings)
    assert stepped(*asked_of(part, views)) == 0
    assert stepped(*asked_of(shaft, views)) > 3 * LIMIT


def test_a_slot_that_a_solid_has_elsewhere_is_seen(tmp_path):
    block, slot = Box(50, 40, 20, align=LOW), Rot(0, 0, 20) * Box(18, 5, 3)
    views = views_of(block - Pos(0, 0, 20) * slot, tmp_path)
    moved = block - Pos(12, 8, 20) * slot
    assert stepped(*asked_of(moved, views)) > LIMIT


def test_views_watch_a_place_that_is_not_hidden_nor_at_a_graze(tmp_path):
    part = Box(40, 40, 10, align=LOW) + Pos(0, 0, 10) * Box(4, 40, 12, align=LOW)
    scene, _, shown, _ = asked_of(part, views_of(part, tmp_path))
    high, low = scene.mesh.vertices.max(axis=0), scene.mesh.vertices.min(axis=0)
    size = (high[0] - low[0]) / 40
    middle = (high + low) / 2
    places = middle + size * np.array([[10.0, 0, -1], [-10, 0, -1], [0, 0, 11]])  # beside the wall, and on it
    eyes = (shown.views.cameras.centers[:, None] - places) / size  # (V, 3, 3)
    steep = eyes[..., 2] / np.linalg.norm(eyes, axis=2)
    wall = np.array([-8.0, 8.0, np.inf])  # from the place to the wall's nearer side
    over = eyes[..., 2] * wall / eyes[..., 0]  # height of the ray there
    hidden = np.where(eyes[..., 0] * wall > 0, np.abs(over) < 12, False)
    expected = ((steep > 0.25) & ~hidden).sum(axis=0)
    up = np.tile([0.0, 0.0, 1.0], (3, 1))
    assert np.abs(watching(scene, places, up, shown) - expected).max() <= 1


def test_steps_are_ridges_of_the_gradient():
    """Not the smooth shades of a small fillet, which are as steep."""
    column = np.arange(80.0)
    fine, smooth = np.where(column < 30, 80.0, 120.0), 80 + 6 * np.clip(column - 20, 0, 30)
    alpha = np.zeros((2, 60, 80), np.uint8)
    alpha[:, 5:-5, 5:-5] = 255
    luminance = np.stack([np.tile(fine, (60, 1)), np.tile(smooth, (60, 1))]).astype(np.float32)
    shown = Images(SimpleNamespace(alpha=alpha), luminance, 1.5)
    found = image_steps(shown)
    assert set(found[:, 0]) == {0}
    assert set(found[:, 2]) <= {29, 30}
    assert found[:, 1].min() == 10  # clear of the silhouette
    assert found[:, 1].max() == 49
