"""Thin leftovers of a hull go if views agree better without them; thin ribs stay."""

import numpy as np
from blocks import GRID, SPACING
from brepgaussian.splatting.concave import Images, without_fins
from brepgaussian.splatting.concave.volume import Volume
from build123d import Align, Box, Pos
from rendered import rendered
from test_levels import fields

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
SIDE, HIGH, RIB = 40.0, 20.0, 1.2  # the rib is less than three voxels wide


def solid(*boxes):
    """A volume of boxes: (2, 3) corners each, in the unit frame."""
    return np.max([np.minimum(GRID - low, high - GRID).min(axis=-1) for low, high in np.array(boxes)], axis=0)


def test_a_sheet_goes_and_a_rib_stays(tmp_path):
    part = Box(SIDE, SIDE, HIGH, align=LOW) + Pos(0, 0, HIGH) * Box(RIB, SIDE, 10, align=LOW)
    views, truth = rendered(tmp_path, part, 40)
    low = truth.mesh_vertices.min(axis=0)
    block = [[0, 0, 0], [1, 1, HIGH / SIDE]]
    rib = [[0.5 - RIB / SIDE / 2, 0, 0.3], [0.5 + RIB / SIDE / 2, 1, (HIGH + 10) / SIDE]]
    sheet = [[0.6, 0.1, 0.6], [0.95, 0.9, 0.6 + 1.5 * SPACING]]
    post = [[0.6, 0.1, 0.4], [0.63, 0.13, 0.61]]  # it hangs together with the part
    field = solid(block, rib, sheet, post).astype(np.float32)
    hull = Volume(field, low, SPACING)
    cleaned = without_fins(Images.of(views), hull)
    places = low + np.array([[0.8, 0.5, 0.6 + SPACING / 2], [0.5, 0.5, 0.6], [0.5, 0.5, 0.3]])
    np.testing.assert_array_equal(fields(hull, places) > 0, [True, True, True])
    np.testing.assert_array_equal(fields(cleaned, places) > 0, [False, True, True])
    np.testing.assert_array_equal(cleaned.field[:45], hull.field[:45])  # nothing else changes


def test_without_anything_thin_nothing_is_looked_at():
    hull = Volume(solid([[0.1, 0.1, 0.1], [0.9, 0.8, 0.7]]).astype(np.float32), np.zeros(3), SPACING)
    assert without_fins(None, hull) is hull
    empty = hull.with_field(-np.abs(hull.field))
    assert without_fins(None, empty) is empty
