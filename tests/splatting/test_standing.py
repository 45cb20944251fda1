"""What stands where a hull is blind: beside walls over holes, inside pockets; on hulls and views made by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.splatting.concave import standing
from brepgaussian.splatting.concave.enclosed import beside_islands, enclosed, to_rims
from brepgaussian.splatting.concave.openings import LID, WALL, Stack, openings
from brepgaussian.splatting.concave.prism import Lattice, plane_axes
from brepgaussian.splatting.concave.sweep import directions
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.faces.confirm import Face
from brepgaussian.splatting.faces.holes import clear_holes

SPACING, PITCH, LEVEL = 1 / 80, 1 / 160, 0.4
MIDDLE, RADIUS = np.array([0.5, 0.5]), 0.12
UP = np.array([0, 0, 1.0])


def lattice(cells=128):
    first, second = plane_axes(UP)
    middle = np.append(MIDDLE, LEVEL)
    return Lattice(middle - (first + second) * cells * PITCH / 2, first, second, UP, PITCH, (cells, cells))


def face_with_hole():
    on = lattice()
    away = np.linalg.norm(on.centers()[..., :2] - MIDDLE, axis=-1)
    return Face(on, away > RADIUS, 0.001, 0.1)


def plate_with_column(reach):
    """A plate with a hole, and over the hole a column, 0.1 high, where x is larger than `reach`."""
    grid = np.stack(np.meshgrid(*[SPACING * np.arange(81)] * 3, indexing="ij"), axis=-1)
    hole = RADIUS - np.linalg.norm(grid[..., :2] - MIDDLE, axis=-1)  # positive over it
    plate = np.minimum(0.45 - np.abs(grid[..., :2] - 0.5).max(axis=-1), 0.15 - np.abs(grid[..., 2] - 0.25))
    column = np.minimum.reduce([hole, grid[..., 0] - reach, 0.2 - np.abs(grid[..., 2] - 0.3)])
    return Volume(np.maximum(np.minimum(plate, -hole), column).astype(np.float32), np.zeros(3), SPACING)


@pytest.mark.parametrize(
    ("reach", "needed", "cleared"),
    [(0.54, False, True), (0.54, True, False), (0.3, False, False)],
    ids=["a part of the hole", "silhouettes show it", "a boss"],
)
def test_what_stands_over_a_part_of_a_hole_goes(reach, needed, cleared):
    hull = plate_with_column(reach)
    left = clear_holes(hull, [face_with_hole()], lambda points, _: np.full(len(points), needed), 0.05)
    column = np.array([[0.59, 0.5, 0.46]])
    assert hull.scene().signed_distance(column)[0] < 0
    assert (left.scene().signed_distance(column)[0] > 0) == cleared
    beside = np.array([[0.8, 0.8, 0.38], [0.2, 0.5, 0.3]])  # the plate itself
    assert (left.scene().signed_distance(beside) < 0).all()


def test_a_hub_in_a_hole_is_not_cut_through_below_its_top():
    """Silhouettes show its top, which would hide from them what is cut away below."""
    face = replace(face_with_hole(), bulge=2 * SPACING)  # a slab lower than the column
    hull = plate_with_column(0.54)
    left = clear_holes(hull, [face], lambda points, scene: scene.signed_distance(points + 0.02 * UP) > 0, 0.05)
    column = np.array([[0.59, 0.5, z] for z in (0.42, 0.44, 0.48)])
    assert (left.scene().signed_distance(column) < 0).all()


def floor_with(grey, agreed):
    """A floor of grey 180 with a disc of another grey, about which views agree or not; (R, C) the disc."""
    on = lattice(80)
    disc = np.linalg.norm(on.centers()[..., :2] - MIDDLE, axis=-1) < 0.1
    shown = np.full((8, 80, 80), LID, np.uint8)
    shown[:, disc] = LID if agreed else WALL
    picture = np.where(disc, grey, 180.0).astype(np.float32)
    stack = Stack(on, np.ones((80, 80), bool), shown, np.repeat(picture[None], 8, axis=0), np.zeros((80, 80)))
    return stack, disc


@pytest.mark.parametrize(("grey", "agreed", "found"), [(120.0, True, 1), (180.0, True, 0), (120.0, False, 0)])
def test_a_boss_in_a_pocket_is_left_out_of_its_floor(grey, agreed, found):
    stack, disc = floor_with(grey, agreed)
    whole = np.zeros(disc.shape, bool)
    whole[5:-5, 5:-5] = True
    outlines = beside_islands(stack, whole, enclosed(stack, 50 * PITCH**2, 1.5))
    assert len(outlines) == found
    for outline in outlines:
        wrong = (outline != (whole & ~disc)).sum()
        assert wrong < 2.5 * np.sqrt(4 * np.pi * disc.sum())  # cells along the boss's rim, whose blur has two


def test_a_blurred_rim_is_where_the_grey_changes_most():
    on = lattice(80)
    away = np.linalg.norm(on.centers()[..., :2] - MIDDLE, axis=-1)
    picture = (180 + 20 / (1 + np.exp((away - 0.1) / (0.8 * PITCH)))).astype(np.float32)  # light thrown on by walls
    stack = Stack(
        on,
        np.ones((80, 80), bool),
        np.full((8, 80, 80), LID, np.uint8),
        np.repeat(picture[None], 8, axis=0),
        np.zeros((80, 80)),
    )
    (rough,) = [r for r in enclosed(stack, 50 * PITCH**2, 1.5) if r[40, 40]]
    (found,) = to_rims(stack, [rough], [])
    disc = away < 0.1
    assert rough.sum() < 0.8 * disc.sum()
    assert found.sum() == pytest.approx(disc.sum(), rel=0.2)  # a cell of its radius, which the depth's search moves
    assert to_rims(stack, [rough], [disc]) == []


def test_a_hole_that_most_views_refute_is_told_from_strips_along_a_wall():
    on = lattice(80)
    away = np.linalg.norm(on.centers()[..., :2] - MIDDLE, axis=-1)
    disc, strip = away < 0.08, np.zeros((80, 80), bool)
    strip[6:74, 44:56] = True
    shown = np.full((20, 80, 80), LID, np.uint8)
    shown[:3, strip] = WALL  # walls that are a cell off
    shown[:10, disc] = WALL
    stack = Stack(on, np.ones((80, 80), bool), shown, np.full((20, 80, 80), 180.0, np.float32), np.zeros((80, 80)))
    found = openings(stack, 50 * PITCH**2)
    assert max((disc & o).sum() / (disc | o).sum() for o in found) > 0.9


def test_channels_end_at_faces_that_look_away_from_each_other():
    def facing(x, offset):
        return SimpleNamespace(normal=np.array([x, 0, 0.0]), offset=offset)

    outer, inner = [facing(1.0, 0.9), facing(-1.0, -0.1)], [facing(1.0, 0.3), facing(-1.0, -0.7)]
    assert len(directions(outer)) == 1  # they share it
    assert directions(inner) == []


def plate_with_hub(skirt):
    """A plate whose top is at z = LEVEL, a hub .2 high on it, and around its foot a cone that silhouettes leave."""
    grid = np.stack(np.meshgrid(*[SPACING * np.arange(81)] * 3, indexing="ij"), axis=-1)
    away, height = np.linalg.norm(grid[..., :2] - MIDDLE, axis=-1), grid[..., 2] - LEVEL
    plate = np.minimum(0.45 - np.abs(grid[..., :2] - 0.5).max(axis=-1), 0.15 - np.abs(grid[..., 2] - 0.25))
    hub = np.minimum(0.08 + np.maximum(skirt * (1 - height / 0.15), 0) - away, 0.2 - np.abs(height))
    return Volume(np.maximum(plate, hub).astype(np.float32), np.zeros(3), SPACING)


@pytest.mark.parametrize(("skirt", "hidden"), [(0.04, 0.04), (0.08, 0.08), (0.04, -0.015)])
def test_a_recess_around_a_hub_leaves_the_hub_out(monkeypatch, skirt, hidden):
    """The cells that a lattice leaves out of a face may be fewer than the hub has: those well inside of it."""
    monkeypatch.setattr(standing, "_filling", lambda found, *_: found)
    on = lattice()
    away = np.linalg.norm(on.centers()[..., :2] - MIDDLE, axis=-1)
    domain = away > 0.08 + hidden
    shown = np.full((9, *on.shape), LID, np.uint8)
    shown[::3, domain & (away < 0.25)] = WALL  # a third of the views see something else in the recess
    stack = Stack(on, domain, shown, shown * 1.0, np.zeros(on.shape))
    found = standing.around_hubs(stack, plate_with_hub(skirt).scene(), None, 50 * PITCH**2)
    assert len(found) == 3
    truth = (away < 0.25) & (away > 0.08)
    overlaps = [(outline & truth).sum() / (outline | truth).sum() for outline, _ in found]
    assert overlaps == sorted(overlaps)  # the higher the section, the less of the corner is in it
    assert overlaps[-1] > 0.93
    assert found[-1][1] == pytest.approx(0.2, abs=2 * PITCH)
    agreed = replace(stack, shown=np.full_like(shown, LID))  # a face, not a recess
    assert standing.around_hubs(agreed, plate_with_hub(skirt).scene(), None, 50 * PITCH**2) == []


@pytest.mark.parametrize(("middle", "free"), [((0.5, 0.5), False), ((0.8, 0.8), True)])
def test_nothing_is_open_under_a_hub_that_silhouettes_show(middle, free):
    scene, on = plate_with_hub(0.0).scene(), lattice()
    across, heights = np.repeat(np.linspace(-0.076, 0.076, 41), 5), np.tile(LEVEL + np.linspace(0.03, 0.17, 5), 41)
    origins = np.column_stack([np.full(len(heights), -1.0), 0.5 + across, heights])
    images = SimpleNamespace(contour_rays=(origins, np.tile([1.0, 0.0, 0.0], (len(origins), 1))))
    domain = np.linalg.norm(on.centers()[..., :2] - MIDDLE, axis=-1) > 0.07
    stack = SimpleNamespace(lattice=on, domain=domain)
    outline = np.linalg.norm(on.centers()[..., :2] - np.array(middle), axis=-1) < 0.15
    assert bool(standing.standing_free([outline], stack, scene, images)) == free


@pytest.mark.parametrize(("kept", "filled"), [(0.08, True), (0.075, True), (0.05, False)])
def test_a_recess_may_not_take_what_silhouettes_show_of_a_hub(kept, filled):
    """Rays just inside of a hub's contour, of which a cell more or less tells nothing."""
    scene, on = plate_with_hub(0.0).scene(), lattice()
    across = np.linspace(-0.076, 0.076, 81)
    heights = np.tile(LEVEL + np.linspace(0.03, 0.17, 5), len(across))
    origins = np.column_stack([np.full(len(heights), -1.0), 0.5 + np.repeat(across, 5), heights])
    images = SimpleNamespace(contour_rays=(origins, np.tile([1.0, 0.0, 0.0], (len(origins), 1))))
    away = np.linalg.norm(on.centers()[..., :2] - MIDDLE, axis=-1)
    outline = (away < 0.25) & (away > kept)
    stack = SimpleNamespace(lattice=on)
    assert bool(standing._filling([(outline, 0.2)], stack, scene, images)) == filled


def test_an_outline_as_narrow_as_blur_is_no_recess():
    """Around a hub as wide as its recess a ring is left of a cell or two: no core of it is sure."""
    scene, on = plate_with_hub(0.0).scene(), lattice()
    images = SimpleNamespace(contour_rays=(np.array([[-1.0, 0.5, LEVEL + 0.1]]), np.array([[1.0, 0.0, 0.0]])))
    away = np.linalg.norm(on.centers()[..., :2] - MIDDLE, axis=-1)
    ring, disc = np.abs(away - 0.25) < PITCH, np.linalg.norm(on.centers()[..., :2] - 0.8, axis=-1) < 0.1
    stack = SimpleNamespace(lattice=on)
    assert [o is disc for o, _ in standing._filling([(ring, 0.2), (disc, 0.2)], stack, scene, images)] == [True]
    assert standing._filling([(ring, 0.2)], stack, scene, images) == []
