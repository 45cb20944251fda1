"""Holes of one pattern, as deep as the deepest: drilled into rendered blocks; what views tell apart stays apart."""

import numpy as np
import pytest
from brepgaussian.splatting.concave.even import _likeliest
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


class Told:
    """An opening whose rays say, by depth in cells, how many standard errors speak for it."""

    deepest = 80.0

    def __init__(self, most, best):
        self.most, self.best = most, best

    def costs(self, shape):
        return self.most * np.clip((shape.depth - 20) / (self.best - 20), 0, 1)

    def advantage(self, before, after):
        return after - before


@pytest.mark.parametrize(
    ("most", "holes", "deeper"), [(1.5, 1, False), (1.5, 4, True), (4.0, 1, True), (0.0, 4, False)]
)
def test_untold_floors_lie_where_rays_make_it_likeliest(most, holes, deeper):
    """Beyond the true depth nothing speaks against more of it, so the least of the likely ones counts."""
    pitch = 0.005
    looked = [(pitch, (Told(most, 40.0),)) for _ in range(holes)]
    found = _likeliest(looked, 20 * pitch)
    assert found == pytest.approx(40 * pitch if deeper else 20 * pitch, rel=0.2 if deeper else 0)
    assert found <= 40 * pitch * 1.04


def test_without_rays_the_depth_stays():
    assert _likeliest([], 0.1) == 0.1
