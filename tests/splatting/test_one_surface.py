"""What is closed, and what a cut makes worse: rays at a rendered block tell."""

from dataclasses import replace

import numpy as np
import pytest
from blocks import BLOCK, GRID, SPACING, disc
from brepgaussian.splatting import opened
from brepgaussian.splatting.concave import Images, believed
from brepgaussian.splatting.concave.agreement import one_surface, preferred
from brepgaussian.splatting.concave.planes import PITCH_PIXELS
from build123d import Align, Box, Cylinder, Pos
from rendered import rendered

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
SIDE, WIDE, DEEP, BORE = 40.0, 5.0, 15.0, 8.0


@pytest.mark.parametrize("there", [True, False])
def test_a_wall_that_a_slot_is_cut_into_is_one_surface_if_there_is_none(tmp_path, there):
    part = Box(SIDE, SIDE, SIDE, align=LOW)
    if there:
        part -= Pos(0, 0, SIDE - DEEP) * Box(SIDE, WIDE, DEEP, align=LOW)
    views, _ = rendered(tmp_path, part, 40, 400)
    slot = np.maximum(np.abs(GRID[..., 1] - 0.5) - WIDE / SIDE / 2, 1 - DEEP / SIDE - GRID[..., 2])
    cut = BLOCK.with_field(np.minimum(BLOCK.field, slot.astype(np.float32)))
    share = one_surface(Images.of(views, 0.0), BLOCK.scene(), cut.scene(), 2 * SPACING)
    assert share < 0.15 if there else share > 0.4


def test_of_two_hulls_the_one_about_which_views_agree_is_preferred(tmp_path):
    part = Box(SIDE, SIDE, SIDE, align=LOW) - Cylinder(BORE, SIDE, align=LOW)
    views, _ = rendered(tmp_path, part, 40, 400)
    images = Images.of(views, 0.0)
    radius = np.linalg.norm(GRID[..., :2] - 0.5, axis=-1)

    def bored(wide):
        return BLOCK.with_field(np.minimum(BLOCK.field, (radius - wide).astype(np.float32))).scene()

    right, narrow, wide = (bored(share * BORE / SIDE) for share in (1.0, 0.7, 1.4))
    for wrong in (BLOCK.scene(), narrow, wide):
        assert preferred(images, wrong, right, 2 * SPACING)
        assert not preferred(images, right, wrong, 2 * SPACING)
    assert not preferred(images, right, right, 2 * SPACING)


@pytest.mark.parametrize(("rooms", "liked"), [(False, False), (True, False), (True, True)])
def test_rooms_are_cut_first_where_views_like_what_comes_of_it(monkeypatch, rooms, liked):
    flat = opened.Opened(BLOCK)
    roomy = BLOCK.with_field(BLOCK.field - 0.01)
    monkeypatch.setattr(opened, "open_levels", lambda images, hull, planes: roomy if rooms else hull)
    monkeypatch.setattr(
        opened, "_sides", lambda shown, bare, flat, hull: opened._Begun(BLOCK, hull, replace(flat, volume=hull))
    )
    monkeypatch.setattr(opened, "preferred", lambda images, one, other, reach: liked)
    begun = opened._begun(opened.Shown(None, None, None), BLOCK, flat)
    assert (begun.now.volume is roomy) == (rooms and liked)
    assert (begun.now.volume is BLOCK) == (not (rooms and liked))


def test_a_hole_that_narrows_is_not_cut_where_a_bore_is_straight(tmp_path):
    part = Box(SIDE, SIDE, SIDE, align=LOW) - Cylinder(BORE, SIDE, align=LOW)
    views, _ = rendered(tmp_path, part, 40, 400)
    images = Images.of(views, 0.0)
    radius = np.linalg.norm(GRID[..., :2] - 0.5, axis=-1)
    hull = BLOCK.with_field(np.minimum(BLOCK.field, (radius - BORE / SIDE).astype(np.float32)))
    mouth = disc(0.3, 1.0, PITCH_PIXELS * views.cameras.footprint())
    wide = replace(mouth, through=True, draft=0.5, sink=0.1)
    wider = hull.without(wide, 0.02)
    assert believed.disliked(images, hull, wider, wide)
    assert not believed.disliked(images, hull, hull, wide)


@pytest.mark.parametrize(
    ("said", "refused"),
    [
        ((0.29, 0.36, 164), True),  # a slit across a bore, through which the keyway at its other side showed
        ((0.28, 1.24, 75), True),  # a hole that leans, few rays
        ((0.28, 0.50, 75), False),
        ((0.28, 1.24, 20), False),  # too few
        ((0.30, 0.35, 200), False),
        ((2.00, 0.31, 14571), False),
    ],
)
def test_an_opening_that_views_like_less_is_not_cut(monkeypatch, said, refused):
    monkeypatch.setattr(believed, "disagreements", lambda *_: said)
    assert believed.disliked(None, BLOCK, BLOCK, disc(0.3, 1.0, 0.01)) == refused


@pytest.mark.parametrize(
    ("said", "floor_told", "expected"),
    [
        ((1.05, 1.36, 51), False, False),  # few rays, which refute what was opened as well
        ((0.20, 1.30, 20), False, True),  # fewer, which may be off by as much
        ((0.29, 0.60, 35), False, True),  # few, which differ as they do about true surfaces
        ((1.20, 1.10, 51), False, True),
        ((0.0, 0.3, 0), False, True),  # none
        ((0.29, 0.60, 35), True, False),
        ((0.60, 0.29, 35), True, True),
        ((0.60, 0.58, 200), False, False),  # enough to judge
        ((0.60, 0.29, 200), False, True),
    ],
)
def test_few_rays_do_not_judge_an_opening_unless_they_refute_it(monkeypatch, said, floor_told, expected):
    monkeypatch.setattr(believed, "disagreements", lambda *_: said)
    mouth = disc(0.3, 1.0, 0.01)
    assert believed.agreeable(None, None, None, mouth, 0.01, floor_told) is expected
