"""Rooms that corners left beside a pocket: rays into a rendered block's pocket tell which are there."""

from dataclasses import replace

import numpy as np
import pytest
from blocks import BLOCK, GRID, SPACING, disc
from brepgaussian.splatting.concave import Images, refilled
from brepgaussian.splatting.concave.planes import PITCH_PIXELS
from brepgaussian.splatting.concave.volume import Volume
from build123d import Align, Box, Cylinder, Pos
from rendered import rendered

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
SIDE, RADIUS, DEEP = 40.0, 13.0, 10.0
ROOM = np.array([[0.5, 0.35, 0.75], [0.92, 0.65, 0.96]])  # of the unit frame: from the pocket into its wall


@pytest.mark.parametrize("there", [True, False])
def test_a_room_beside_a_pocket_is_filled_if_it_is_not_there(tmp_path, there):
    part = Box(SIDE, SIDE, SIDE, align=LOW) - Pos(0, 0, SIDE - DEEP) * Cylinder(RADIUS, DEEP, align=LOW)
    if there:
        middle = SIDE * (ROOM.mean(axis=0) - [0.5, 0.5, 0])
        part -= Pos(*middle) * Box(*(SIDE * np.ptp(ROOM, axis=0)))
    views, _ = rendered(tmp_path, part, 40, 400)
    images = Images.of(views, 0.0)
    outside = np.maximum(ROOM[0] - GRID, GRID - ROOM[1]).max(axis=-1).astype(np.float32)
    cornered = BLOCK.with_field(np.minimum(BLOCK.field, outside))
    pocket = disc(RADIUS / SIDE, DEEP / SIDE, PITCH_PIXELS * views.cameras.footprint())
    opened = cornered.without(pocket, 2 * SPACING)
    result = refilled(images, BLOCK, cornered, opened, [pocket])
    room, middle = tuple(np.round(96 * np.array([0.87, 0.5, 0.85])).astype(int)), (48, 48, 90)
    assert opened.field[room] < 0
    assert (result.field[room] < 0) == there
    assert result.field[middle] < 0
    np.testing.assert_array_equal(result.field[:40], opened.field[:40])  # nothing else changes


def test_without_corners_nothing_is_filled():
    volume = Volume(np.ones((4, 4, 4), np.float32), np.zeros(3), 0.25)
    other = replace(volume, spacing=0.5)
    assert refilled(None, volume, volume, other, []) is other
