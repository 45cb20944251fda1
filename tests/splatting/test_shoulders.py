"""Counterbores: the floor of a wide opening is a ring where a narrower hole goes on below."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.splatting.concave import Images, shoulders
from brepgaussian.splatting.concave.depth import shoulder
from brepgaussian.splatting.concave.openings import rectify
from brepgaussian.splatting.concave.planes import PITCH_PIXELS
from brepgaussian.splatting.concave.prism import Lattice, Prism
from brepgaussian.splatting.concave.volume import Volume
from build123d import Align, Box, Cylinder, Pos
from rendered import rendered

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
PITCH, SPACING = 1 / 200, 1 / 80
TOP, BOTTOM = 0.7, 0.3  # of a block in the unit frame


def disc(radius, level=TOP, up=1.0, depth=0.1, pitch=PITCH, **more):
    """A round opening about (.5, .5) in a plane of some height."""
    cells = 2 * round(0.25 / pitch) + 1
    axes = np.eye(3) * np.array([[1.0], [up], [up]])
    corner = np.array([0.5, 0.5, level]) - cells * pitch / 2 * (axes[0] + axes[1])
    on = Lattice(corner, *axes, pitch, (cells, cells))
    outline = np.linalg.norm(on.centers()[..., :2] - 0.5, axis=-1) < radius
    return Prism(on, outline, depth, False, 0.0, **more)


def block(hole=0.0, aside=0.0):
    grid = np.stack(np.meshgrid(*[SPACING * np.arange(81)] * 3, indexing="ij"), axis=-1)
    inside = 0.4 - np.abs(grid[..., :2] - 0.5).max(axis=-1)
    inside = np.minimum(inside, (TOP - BOTTOM) / 2 - np.abs(grid[..., 2] - (TOP + BOTTOM) / 2))
    away = np.hypot(grid[..., 0] - 0.5 - aside, grid[..., 1] - 0.5) - hole
    return Volume((np.minimum(inside, away) if hole else inside).astype(np.float32), np.zeros(3), SPACING)


@pytest.mark.parametrize(
    ("changes", "plain"),
    [
        ({}, True),
        ({"through": True}, False),
        ({"domed": True}, False),
        ({"draft": 0.1}, False),
        ({"above": 0.1}, False),
    ],
)
def test_only_round_straight_openings_with_a_floor_have_shoulders(changes, plain):
    assert shoulders._is_plain(replace(disc(0.1), **changes)) == plain
    square = replace(disc(0.1), outline=np.pad(np.ones((41, 41), bool), 30))
    assert not shoulders._is_plain(square)


@pytest.mark.parametrize(
    ("hole", "aside", "found"), [(0.0, 0.0, 0.0), (0.03, 0.0, 0.04), (0.03, 0.04, 0.07), (0.12, 0.0, 0.0)]
)
def test_how_wide_silhouettes_have_pierced_the_hull(hole, aside, found):
    """Those of all of the opening are its own walls, and tell no narrower hole."""
    radius = shoulders._pierced(block(hole, aside).scene(), disc(0.1))
    assert radius == pytest.approx(found, abs=1.5 * PITCH)


@pytest.mark.parametrize(("told", "depth", "through"), [(0.15, 0.15, True), (0.24, 0.25, False), (None, 0.25, False)])
def test_a_hole_that_faces_a_counterbore_goes_up_to_its_shoulder(monkeypatch, told, depth, through):
    wide, narrow = disc(0.1, depth=0.25, endless=True), disc(0.05, BOTTOM, -1.0, depth=0.1, endless=True)
    beside = replace(
        disc(0.1, depth=0.25), lattice=replace(wide.lattice, origin=wide.lattice.origin + 0.3 * np.eye(3)[0])
    )
    monkeypatch.setattr(shoulders, "rectify", lambda *_: None)
    monkeypatch.setattr(shoulders, "shoulder", lambda *_: told)
    images = SimpleNamespace(views=SimpleNamespace(cameras=SimpleNamespace(centers=None)), tolerance=1.5)
    images.as_taken = images
    scene = block().scene()
    found = shoulders.with_shoulders(images, scene, [wide, narrow, beside], 2 * SPACING)
    assert found[0].depth == depth
    assert found[0].ring == found[1].through == through
    assert found[1].depth == pytest.approx(TOP - BOTTOM - depth if through else 0.1)
    assert found[2] is beside


@pytest.mark.parametrize("deep", [8.0, 11.0])
def test_the_depth_of_a_shoulder_over_a_hole_that_is_as_bright(tmp_path, deep):
    part = Box(40, 36, 40, align=LOW) - Pos(0, 0, 40 - deep) * Cylinder(7, deep, align=LOW) - Cylinder(4, 90)
    views, _ = rendered(tmp_path, part, 40, 500)
    images = Images.of(views, 0.0)
    grid = np.stack(np.meshgrid(*[np.arange(97) / 96] * 3, indexing="ij"), axis=-1)
    half = np.array([20, 18, 20]) / 40
    hull = Volume((half - np.abs(grid - 0.5)).min(axis=-1).astype(np.float32), np.zeros(3), 1 / 96).scene()
    wide = disc(7 / 40, level=1.0, pitch=PITCH_PIXELS * views.cameras.footprint())
    stack, centers = rectify(images, hull, wide.lattice), views.cameras.centers
    found = shoulder(stack, wide.outline, centers, hull, images.tolerance, 4 / 40 / wide.lattice.pitch)
    assert wide.depth != found == pytest.approx(deep / 40, abs=0.02)


def test_a_hole_that_reaches_up_to_a_shoulder_has_no_floor_any_more(monkeypatch):
    """Silhouettes may have pierced it, too; then it is not taken for a counterbore itself."""
    wide, narrow = disc(0.1, depth=0.25, endless=True), disc(0.05, BOTTOM, -1.0, depth=0.1, endless=True)
    monkeypatch.setattr(shoulders, "rectify", lambda *_: None)
    monkeypatch.setattr(shoulders, "shoulder", lambda *_: 0.08)
    images = SimpleNamespace(views=SimpleNamespace(cameras=SimpleNamespace(centers=None)), tolerance=1.5)
    images.as_taken = images
    monkeypatch.setattr(shoulders, "_pierced", lambda *_: 0.02)
    _, hole = shoulders.with_shoulders(images, block().scene(), [wide, narrow], 2 * SPACING)
    assert hole.through
    assert hole.depth == pytest.approx(TOP - BOTTOM - 0.08)


@pytest.mark.parametrize(("cone", "depth"), [(0.0, 0.15), (0.04, 0.25)], ids=["a hole", "a cone of light"])
def test_a_floor_lies_below_what_silhouettes_leave_empty_beside_a_narrower_hole(monkeypatch, cone, depth):
    """Light through a narrow hole and a wide one leaves a cone about the narrow one, as far as the wide one reaches."""
    hull, floor = block(), TOP - 0.3  # of the wide hole, in truth
    grid = np.stack(np.meshgrid(*[SPACING * np.arange(81)] * 3, indexing="ij"), axis=-1)
    radius = 0.05 + cone * np.maximum(grid[..., 2] - floor, 0) / (TOP - floor)
    away = np.hypot(grid[..., 0] - 0.5, grid[..., 1] - 0.5) - radius
    scene = replace(hull, field=np.minimum(hull.field, away).astype(np.float32)).scene()
    wide, narrow = disc(0.1, depth=0.15, endless=True), replace(disc(0.05, BOTTOM, -1.0, depth=0.4), through=True)
    monkeypatch.setattr(shoulders, "_shoulder", lambda *_: None)
    found, through = shoulders.with_shoulders(None, scene, [wide, narrow], 2 * SPACING)
    assert found.depth == pytest.approx(depth, abs=0.02)
    assert found.depth < 0.3
    assert found.endless  # it is the least that it may be
    assert through is narrow
