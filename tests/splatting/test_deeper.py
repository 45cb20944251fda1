"""Whether all of a floor lies deeper: rays through the mouth of a rendered block's pocket decide."""

from dataclasses import replace

import pytest
from blocks import BLOCK, SPACING, disc
from brepgaussian.splatting.concave import Images
from brepgaussian.splatting.concave.deeper import is_whole, surely_deeper
from brepgaussian.splatting.concave.planes import PITCH_PIXELS
from build123d import Align, Box, Cylinder, Pos
from rendered import rendered

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
SIDE, RADIUS, DEEP = 40.0, 10.0, 10.0


@pytest.mark.parametrize(("cut", "deeper"), [(6.0, True), (DEEP, False)])
def test_a_floor_lies_deeper_if_rays_through_its_mouth_say_so(tmp_path, cut, deeper):
    part = Box(SIDE, SIDE, SIDE, align=LOW) - Pos(0, 0, SIDE - DEEP) * Cylinder(RADIUS, DEEP, align=LOW)
    views, _ = rendered(tmp_path, part, 40, 400)
    images = Images.of(views, 0.0)
    pitch = PITCH_PIXELS * views.cameras.footprint()
    floor = disc(RADIUS / SIDE, cut / SIDE, pitch)
    scene = BLOCK.without(floor, 2 * SPACING).scene()
    below = replace(floor, lattice=floor.lowered(cut / SIDE), depth=4 / SIDE)
    assert is_whole(floor, below)
    assert surely_deeper(images, scene, floor, below) == deeper


def test_a_narrower_hole_leaves_a_shoulder():
    floor = disc(0.2, 0.1, 0.005)
    assert not is_whole(floor, disc(0.15, 0.1, 0.005))
    assert is_whole(floor, disc(0.198, 0.1, 0.005))
