"""A screw's hole through both halves of a split clamp, up to its counterbore; and a blind pocket over a hole."""

import numpy as np
import pytest
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.hull import carve
from build123d import Align, Box, Cylinder, Pos
from rendered import rendered

LOW = (Align.CENTER, Align.CENTER, Align.MIN)


@pytest.mark.parametrize("goes_on", [True, False])
def test_a_hole_goes_on_behind_a_gap_if_the_floor_there_is_open(tmp_path, goes_on):
    clamp = Box(46, 26, 32, align=LOW) - Pos(8, 0, 14) * Box(40, 60, 4, align=LOW)
    clamp -= Pos(12, 0, 0) * Cylinder(3.5, 80 if goes_on else 32)
    clamp -= Pos(12, 0, 27) * Cylinder(6, 10, align=LOW)
    views, truth = rendered(tmp_path, clamp, 40)
    hull, _ = carve(views, 128, concavities=True)
    solid, found = Scene(truth.mesh_vertices, truth.mesh_triangles), Scene(hull.vertices, hull.triangles)
    # down the middle of the upper half's hole
    middle = (np.array([12, 0, 22.5]) - [0, 0, 16]) / 46 + 0.5
    points = middle + np.random.default_rng(0).uniform(-0.04, 0.04, (200, 3))
    assert ((solid.signed_distance(points) > 0) == goes_on).all()
    assert ((found.signed_distance(points) > 0) == goes_on).mean() > 0.95
