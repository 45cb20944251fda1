"""Narrow round holes: what surrounds them, and holes in a pocket's floor, in a block that nothing was tuned on."""

import numpy as np
from brepgaussian.splatting.concave.drilled import ringed
from brepgaussian.splatting.concave.openings import Stack
from brepgaussian.splatting.concave.prism import Lattice
from brepgaussian.splatting.hull import carve
from build123d import Align, Box, Cylinder, Pos
from rendered import rendered
from scipy import ndimage

SHAPE, PITCH = (60, 80), 0.01


def seen(brighter: np.ndarray, views: int = 8) -> Stack:
    """A face on which all views show `brighter` cells (R, C) 30 grey levels above the rest, blurred by a cell."""
    lattice = Lattice(np.zeros(3), *np.eye(3), PITCH, SHAPE)
    grey = np.repeat(ndimage.gaussian_filter(100 + 30.0 * brighter, 1.0)[None], views, axis=0).astype(np.float32)
    return Stack(lattice, np.ones(SHAPE, bool), np.zeros(grey.shape, np.uint8), grey, np.zeros(SHAPE))


def test_compact_narrow_regions_are_ringed_and_nothing_else():
    row, column = np.indices(SHAPE)
    disc = np.hypot(row - 20, column - 20) < 6
    slot = (np.abs(row - 45) < 3) & (np.abs(column - 25) < 15)
    wide = np.hypot(row - 30, column - 60) < 14
    (found,) = ringed(seen(disc | slot | wide), 30 * PITCH**2, 1.5)
    assert (found & disc).sum() > 0.9 * disc.sum()
    assert np.sqrt(found.sum() / np.pi) < 6 + 2.5  # rims are sought 3 cells around
    assert ringed(seen(np.zeros(SHAPE, bool)), 30 * PITCH**2, 1.5) == []
    assert ringed(seen(disc), 300 * PITCH**2, 1.5) == []


def test_narrow_blind_holes_in_a_pockets_floor_are_open(tmp_path):
    """Silhouettes show nothing of them, strips beside the pocket's walls join them, and no ray tells their floors."""
    low = (Align.CENTER, Align.CENTER, Align.MIN)
    block = Box(64, 44, 26, align=low) - Pos(1, -1, 17) * Box(46, 28, 9, align=low)
    places = [(-14, -4), (12, 3)]
    for x, y in places:
        block -= Pos(x, y, 9) * Cylinder(1.6, 9, align=low)
    views, truth = rendered(tmp_path, block, 40, 800)
    hull, _ = carve(views, 128, concavities=True)
    holes = [p for p in hull.prisms if p.area < 0.01]
    assert len(hull.prisms) == 1 + len(places)
    assert len(holes) == len(places)
    corner = truth.mesh_vertices.min(axis=0)
    for x, y in places:
        middle = corner[:2] + np.array([32 + x, 22 + y]) / 64
        away = [np.linalg.norm(p.lattice.centers()[p.outline].mean(axis=0)[:2] - middle) for p in holes]
        hole = holes[int(np.argmin(away))]
        assert min(away) < 0.002
        assert abs(np.sqrt(hole.area / np.pi) * 64 - 1.6) < 0.1
        assert hole.depth * 64 > 2.5
