"""Which cells of a pocket's floor a view sees past its rim: against the circle that its rays cross at the mouth."""

import numpy as np
import pytest
from blocks import BLOCK, SPACING, disc
from brepgaussian.artifacts.views import Views
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.splatting.concave import Images
from brepgaussian.splatting.concave.openings import UNSEEN, rectify
from brepgaussian.splatting.hull import carve
from build123d import Align, Box, Cylinder, Pos
from poses import look_at
from rendered import rendered

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
PITCH, RADIUS, DEPTH, FAR, SIZE = 0.004, 0.2, 0.15, 2.5, 200
VOXELS = 1.5 * SPACING  # by which the rim of a hull is off


def all_grey(elevations):
    """Views from all around that show one grey everywhere."""
    turns = np.linspace(0, 2 * np.pi, len(elevations), endpoint=False)
    e = np.radians(elevations)
    ways = np.column_stack([np.cos(e) * np.cos(turns), np.cos(e) * np.sin(turns), np.sin(e)])
    poses = np.array([look_at(0.5 + FAR * way, np.full(3, 0.5)) for way in ways])
    cameras = Cameras(np.tile([1.2 * SIZE, 1.2 * SIZE, SIZE / 2, SIZE / 2], (len(e), 1)), poses, SIZE, SIZE)
    alpha = np.full((len(e), SIZE, SIZE), 255, np.uint8)
    return Views(
        "block", tuple(map(str, turns)), np.repeat(alpha[..., None] // 2, 3, axis=-1), alpha, cameras, np.eye(4)
    )


@pytest.mark.parametrize("known", [False, True])
def test_views_see_the_floor_through_the_mouth_only(known):
    views = all_grey([25, 40, 55, 70, 35, 80, 47])
    pocket = disc(RADIUS, DEPTH, PITCH)
    scene = BLOCK.without(pocket, 2 * SPACING).scene([pocket] if known else [])
    floor = pocket.lowered(DEPTH)
    stack = rectify(Images.of(views), scene, floor)
    cells = floor.centers()
    within = np.linalg.norm(cells[..., :2] - 0.5, axis=-1) < RADIUS - VOXELS
    for view, center in enumerate(views.cameras.centers):
        share = DEPTH / (center[2] - (1 - DEPTH))
        crossing = np.linalg.norm((cells + share * (center - cells))[..., :2] - 0.5, axis=-1)
        seen = stack.shown[view] != UNSEEN
        lean = np.linalg.norm(center[:2] - 0.5) / (center[2] - 1)
        off = VOXELS * max(1, lean)
        assert seen[within & (crossing < RADIUS - off)].all()
        nearest = RADIUS - 1.5 * PITCH if known else RADIUS + off
        assert not seen[within & (crossing > nearest)].any()


def test_holes_in_counterbores_are_opened(tmp_path):
    """Past the rim of a counterbore, oblique views show the face around it, not what is in its floor."""
    block = Box(60, 40, 40, align=LOW)
    places = {-15: (7, 5, 4), 16: (8, 9, 3.4)}
    for x, (wide, deep, narrow) in places.items():
        block -= Pos(x, 0, 40 - deep) * Cylinder(wide, deep, align=LOW)
        block -= Pos(x, 0, 8) * Cylinder(narrow, 32, align=LOW)
    views, truth = rendered(tmp_path, block, 50, 600)
    hull, _ = carve(views, 128, concavities=True)
    corner = truth.mesh_vertices.min(axis=0)
    for x, (_, deep, narrow) in places.items():
        mouth = corner + np.array([30 + x, 20, 40 - deep]) / 60
        away = [np.linalg.norm(p.lattice.centers()[p.outline].mean(axis=0) - mouth) for p in hull.prisms]
        hole = hull.prisms[int(np.argmin(away))]
        assert min(away) < 0.01
        assert np.sqrt(hole.area / np.pi) * 60 == pytest.approx(narrow, abs=0.25)
        assert hole.depth * 60 > 2 * narrow
