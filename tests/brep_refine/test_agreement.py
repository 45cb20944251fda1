"""Views disagree where a solid's face is not what they see, although all edges and silhouettes are right."""

import numpy as np
import pytest
from brepgaussian.artifacts.views import Views
from brepgaussian.brep.refine.agreement import disagreement, without_trend
from brepgaussian.brep.refine.looks import largest_areas
from brepgaussian.settings.brep import BrepSettings
from build123d import Align, Box, Cylinder, Pos
from refine_support import asked_of, views_of

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
LIMIT = BrepSettings().accept_disputed


def disputed(part, views: Views):
    scene, structure, shown, poses = asked_of(part, views)
    return disagreement(scene, structure, shown, poses), structure


def block():
    return Box(50, 40, 20, align=LOW)


def pocket(depth):
    return Pos(0, 0, 20 - depth) * Box(24, 16, depth, align=LOW)


@pytest.mark.parametrize("settings", [{}, {"noise": 5.0}, {"jpeg_quality": 85}])
def test_views_agree_about_the_right_solid(tmp_path, settings):
    part = block() - pocket(8) - Cylinder(4, 100)
    found, _ = disputed(part, views_of(part, tmp_path, **settings))
    assert found.area <= LIMIT


def test_a_pocket_that_is_filled_up_is_disputed_on_its_lid(tmp_path):
    part = block() - pocket(8)
    found, structure = disputed(block(), views_of(part, tmp_path))
    assert found.area > 2 * LIMIT
    top = max(range(len(structure.faces)), key=lambda k: found.faces[k])
    assert found.faces[top] == found.faces.sum()


def test_a_bore_that_ends_too_early_is_disputed_on_its_floor(tmp_path):
    part = block() - Cylinder(10, 100)
    found, _ = disputed(block() - Pos(0, 0, 14) * Cylinder(10, 6, align=LOW), views_of(part, tmp_path))
    assert found.area > LIMIT


def test_the_foot_of_a_boss_is_not_disputed_for_the_light_that_the_plate_throws_on_it(tmp_path):
    part = Box(60, 44, 8, align=LOW) + Pos(0, 0, 8) * Cylinder(11, 9, align=LOW)
    found, _ = disputed(part, views_of(part, tmp_path, interreflection=0.95))
    assert found.area <= LIMIT / 3


def test_a_trend_goes_and_what_differs_between_views_stays():
    rng = np.random.default_rng(4)
    at = np.column_stack([rng.uniform(0, 6, (3000, 3)), np.zeros(3000)])
    slope = np.array([20.0, -7.0, 3.0])
    smooth = 90 + at[:, :3] @ slope
    rest = without_trend(at, smooth, 1.5)
    assert np.abs(rest).max() < 0.5
    other = rng.random(3000) < 0.25  # another surface is seen by some
    rest = without_trend(at, smooth + 12 * other, 1.5)
    assert np.median(rest[other]) > 9
    assert np.median(np.abs(rest[~other])) < 2
    few = without_trend(at[:10], smooth[:10], 1.5)
    np.testing.assert_array_equal(few, smooth[:10])


def test_the_largest_area_is_that_of_one_face():
    row = [[i, 0, 0, 0] for i in range(4)]
    beside = [[i, 1, 0, 1] for i in range(3)]
    apart = [[9, 9, 9, 0]]
    assert largest_areas(np.array(row + beside + apart), 3).tolist() == [4, 3, 0]
    assert largest_areas(np.zeros((0, 4), np.int64), 1).tolist() == [0]
