"""Holes that end short of another one: a shaft with a bore along z, and a hole into its side, all known exactly."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.splatting.concave.meeting import crossed, met
from brepgaussian.splatting.concave.prism import Lattice, Prism
from brepgaussian.splatting.concave.volume import Volume

SPACING, PITCH = 0.01, 0.005
TOP, SIDE = 0.85, 0.8  # of the block: its top, and the face that the hole is in
BORE, HOLE = 0.12, 0.05  # radii
WALL = SIDE - 0.5 - BORE  # between face and bore


def _disc(origin, axes, radius, depth, **kind) -> Prism:
    """A round hole about the middle of a lattice."""
    count = int(2.6 * radius / PITCH)
    first, second, normal = axes
    corner = origin - count / 2 * PITCH * (first + second)
    cells = np.stack(np.meshgrid(*[np.arange(count) + 0.5 - count / 2] * 2, indexing="ij"), axis=-1)
    outline = np.hypot(*np.moveaxis(cells, -1, 0)) < radius / PITCH
    return Prism(Lattice(corner, first, second, normal, PITCH, (count, count)), outline, depth, False, 0.0, **kind)


def _block(hole_depth: float, bore_depth: float = 0.6) -> tuple[Volume, Prism, Prism]:
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 101)] * 3, indexing="ij"), axis=-1)
    field = np.minimum(SIDE - 0.5 - np.abs(grid[..., :2] - 0.5).max(axis=-1), TOP - 0.5 - np.abs(grid[..., 2] - 0.5))
    x, y, z = np.eye(3)
    bore = _disc(np.array([0.5, 0.5, TOP]), (x, y, z), BORE, bore_depth)
    hole = _disc(np.array([SIDE, 0.5, 0.5]), (y, z, x), HOLE, hole_depth, endless=True)
    hull = Volume(field.astype(np.float32), np.zeros(3), SPACING)
    return hull.without(bore, 2 * SPACING).without(hole, 2 * SPACING), hole, bore


@pytest.mark.parametrize("short", [0.08, 0.03, 0.005])
def test_a_hole_goes_on_into_the_bore_that_it_nearly_reaches(short):
    hull, hole, bore = _block(WALL - short)
    longer = met(hull.scene([bore, hole]), hole, [bore])
    assert longer.through
    assert not longer.endless
    deepest = SIDE - 0.5 - np.sqrt(BORE**2 - HOLE**2)  # where its sides meet the bore
    assert longer.depth == pytest.approx(deepest, abs=SPACING)


def test_a_hole_stays_that_ends_far_away_or_has_a_floor_or_passes_below():
    hull, hole, bore = _block(WALL - 0.13)  # more than its width
    assert met(hull.scene([bore, hole]), hole, [bore]) is hole
    hull, hole, bore = _block(WALL - 0.03)
    ring = replace(hole, endless=False, ring=True)
    assert met(hull.scene([bore, hole]), ring, [bore]) is ring
    hull, hole, bore = _block(WALL - 0.03, bore_depth=0.25)  # the bore ends above it
    assert met(hull.scene([bore, hole]), hole, [bore]) is hole


def test_the_outside_is_no_other_hole():
    hull, hole, _ = _block(WALL - 0.03)
    assert met(hull.scene([hole]), hole, []) is hole


def _deep_block(bore_known: float, aside: float = 0.0, hole_known: float = 0.1) -> tuple[Volume, Prism, Prism]:
    """A solid block; of a bore along z and a hole along -x, whose axes cross at (.5, .5, .5), rays told the mouths."""
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 101)] * 3, indexing="ij"), axis=-1)
    field = np.minimum(SIDE - 0.5 - np.abs(grid[..., :2] - 0.5).max(axis=-1), TOP - 0.5 - np.abs(grid[..., 2] - 0.5))
    x, y, z = np.eye(3)
    bore = _disc(np.array([0.5, 0.5, TOP]), (x, y, z), BORE, bore_known, endless=True)
    hole = _disc(np.array([SIDE, 0.5 + aside, 0.5]), (y, z, x), HOLE, hole_known, endless=True)
    hull = Volume(field.astype(np.float32), np.zeros(3), SPACING)
    return hull.without(bore, 2 * SPACING).without(hole, 2 * SPACING), hole, bore


def test_holes_of_which_no_floor_is_told_go_on_to_where_their_axes_cross():
    hull, hole, bore = _deep_block(0.15)
    found = crossed(hull.scene([bore, hole]), [bore, hole])
    assert set(found) == {0, 1}
    assert found[1].through
    assert found[1].depth == pytest.approx(SIDE - 0.5, abs=PITCH)
    assert found[0].endless  # it may go on
    assert TOP - 0.5 + HOLE < found[0].depth < TOP - 0.5 + 2 * HOLE


@pytest.mark.parametrize("change", ["aside", "told bore", "told hole", "as wide", "far away", "likely only"])
def test_holes_stay_that_do_not_cross_or_end_before(change):
    hull, hole, bore = _deep_block(0.15, 0.03 if change == "aside" else 0.0, 0.06 if change == "far away" else 0.1)
    if change == "likely only":
        hole = replace(hole, shown=0.06)
    if change == "told bore":
        bore = replace(bore, endless=False)
    if change == "told hole":
        hole = replace(hole, endless=False)
    if change == "as wide":
        bore = replace(_disc(np.array([0.5, 0.5, TOP]), tuple(np.eye(3)), HOLE, 0.15), endless=True)
    assert crossed(hull.scene([bore, hole]), [bore, hole]) == {}


def test_a_hole_ends_in_the_gap_before_the_other_one():
    hull, hole, bore = _deep_block(0.15)
    x = np.linspace(0, 1, 101)[:, None, None]
    hull = hull.with_field(np.minimum(hull.field, np.abs(x - 0.675) - 0.025).astype(np.float32))
    assert crossed(hull.scene([bore, hole]), [bore, hole]) == {}


def test_a_hole_that_ends_on_an_axis_tells_that_the_bore_comes_that_far():
    hull, hole, bore = _deep_block(0.15)
    ends_there = replace(hole, depth=SIDE - 0.5 - BORE / 2, endless=False)
    found = crossed(hull.scene([bore, ends_there]), [bore, ends_there])
    assert found[0].depth > TOP - 0.5 + HOLE
    assert found[1].through


def test_a_counterbore_stays_whatever_goes_on_below_it():
    hull, hole, bore = _block(0.1)
    narrow = _disc(np.array([SIDE, 0.5, 0.5]), tuple(np.roll(np.eye(3), -1, axis=0)), 0.9 * HOLE, 0.3)
    narrow = replace(narrow, through=True)
    hull, wide = hull.without(narrow, 2 * SPACING), replace(hole, endless=False)
    assert met(hull.scene([bore, wide, narrow]), wide, [bore, narrow]) is wide
