"""What one of several equal features has open is opened at the others, where views agree."""

import numpy as np
import pytest
from blocks import GRID
from brepgaussian.splatting.concave import Images, alike, open_alike
from brepgaussian.splatting.concave.planes import Plane
from brepgaussian.splatting.concave.volume import Volume
from build123d import Align, Box, Pos
from rendered import rendered
from test_levels import fields

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
SIDE, HIGH, POCKET, DEEP, OFF = 40.0, 16.0, 9.0, 7.0, 10.0
PLACES = [(x, y) for x in (-OFF, OFF) for y in (-OFF, OFF)]
PLANES = [Plane(sign * np.eye(3)[k], 0.0) for k in range(3) for sign in (1.0, -1.0)]


def block(pockets):
    """(n, n, n) volume of a block with square pockets in its top, in the unit frame that its views have."""
    spacing = float(GRID[1, 0, 0, 0] - GRID[0, 0, 0, 0])
    at = SIDE * (GRID - 0.5)
    field = (np.array([SIDE, SIDE, HIGH]) / 2 - np.abs(at)).min(axis=-1)
    for x, y in pockets:
        inside = np.minimum(POCKET / 2 - np.abs(at[..., :2] - [x, y]).max(axis=-1), at[..., 2] - HIGH / 2 + DEEP)
        field = np.minimum(field, -inside)
    return Volume((field / SIDE).astype(np.float32), np.zeros(3), spacing)


def floors(volume):
    """(4,) whether the volume is open 2 mm above where the floors of the four pockets are."""
    places = np.array([[x, y, HIGH / 2 - DEEP + 2] for x, y in PLACES]) / SIDE + 0.5
    return fields(volume, places) < 0


@pytest.mark.parametrize("there", [4, 3])
def test_a_pocket_that_was_missed_is_opened_as_the_others_are_if_it_is_there(tmp_path, there):
    part = Box(SIDE, SIDE, HIGH, align=LOW)
    for x, y in PLACES[:there]:
        part -= Pos(x, y, HIGH - DEEP) * Box(POCKET, POCKET, DEEP, align=LOW)
    views, truth = rendered(tmp_path, part, 40)
    hull = block(PLACES[:3])
    shift = (truth.mesh_vertices.min(axis=0) + truth.mesh_vertices.max(axis=0)) / 2 - 0.5
    hull = Volume(hull.field, hull.origin + shift, hull.spacing)
    moved = Volume(hull.field, hull.origin - shift, hull.spacing)
    assert floors(moved).sum() == 3
    opened = open_alike(Images.of(views), hull, PLANES)
    assert floors(Volume(opened.field, opened.origin - shift, hull.spacing)).sum() == there
    if there == 3:
        np.testing.assert_array_equal(opened.field, hull.field)


def test_a_motion_settles_where_it_carries_the_surface_onto_itself():
    volume = block(PLACES[:3])
    off = np.array([0.511, 0.493, 0.5])
    (mirror,) = alike._mirrors([np.array([1.0, 0.01, -0.012]) / np.linalg.norm([1.0, 0.01, -0.012])], off)
    vertices = volume.mesh()[0]
    settled = alike._settled(mirror, volume, vertices[::5])
    np.testing.assert_allclose(settled.matrix, np.diag([-1.0, 1.0, 1.0]), atol=2e-3)
    np.testing.assert_allclose(settled.shift, [1.0, 0.0, 0.0], atol=2e-3)


def test_what_is_alike_nowhere_stays_as_it_is():
    field = block(PLACES[:1]).field.copy()
    field[:, :40] = -0.1
    volume = Volume(field, np.zeros(3), 1 / 96)
    assert open_alike(None, volume, []) is volume
