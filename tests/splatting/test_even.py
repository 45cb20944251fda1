"""Holes of one pattern, as deep as the deepest: drilled into rendered blocks; what views tell apart stays apart."""

import numpy as np
import pytest
from brepgaussian.splatting.hull import carve
from build123d import Align, Box, Cylinder, Pos
from rendered import rendered

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
LONG, HIGH = 64, 40


def holes(tmp_path, drilled):
    """(depth, radius) of the holes that are opened, in the order of their places; `drilled` has x, y, radius, depth."""
    block = Box(LONG, 44, HIGH, align=LOW)
    for x, y, radius, deep in drilled:
        block -= Pos(x, y, HIGH - deep) * Cylinder(radius, deep, align=LOW)
    views, truth = rendered(tmp_path, block, 50, 600)
    hull, _ = carve(views, 128, concavities=True)
    corner, found = truth.mesh_vertices.min(axis=0), []
    for x, y, _, _ in drilled:
        mouth = corner + np.array([LONG / 2 + x, 22 + y, HIGH]) / LONG
        away = [np.linalg.norm(p.lattice.centers()[p.outline].mean(axis=0) - mouth) for p in hull.prisms]
        hole = hull.prisms[int(np.argmin(away))]
        assert min(away) < 0.01
        found.append((hole.depth * LONG, float(np.sqrt(hole.area / np.pi)) * LONG))
    return found


def test_deep_holes_of_one_drill_are_as_deep_as_one_another(tmp_path):
    places = [(-22, -12), (20, -13), (-21, 13), (22, 11)]
    found = holes(tmp_path, [(x, y, 3.2, 15) for x, y in places])
    depths = [depth for depth, _ in found]
    assert max(depths) - min(depths) < 0.5
    assert min(depths) > 8
    assert max(depths) < 16


def test_holes_that_views_tell_apart_keep_their_depths(tmp_path):
    found = holes(tmp_path, [(-18, 0, 7, 6), (16, 1, 7, 11), (0, 14, 3, 14)])
    assert [depth for depth, _ in found[:2]] == pytest.approx([6, 11], abs=0.3)
    assert [radius for _, radius in found] == pytest.approx([7, 7, 3], abs=0.3)
