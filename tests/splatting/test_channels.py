"""Channels straightened by their sections, holes that reach from mouth to mouth; on solids made by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.splatting.concave import carve, find, shorten, sweep, widening
from brepgaussian.splatting.concave.columns import Cut, cuts, holes
from brepgaussian.splatting.concave.contours import Chords
from brepgaussian.splatting.concave.join import in_line, joined, opposite, square_ends, told_once
from brepgaussian.splatting.concave.prism import Lattice, Prism, plane_axes
from brepgaussian.splatting.concave.sweep import _filling
from brepgaussian.splatting.concave.volume import Volume

SPACING = 1 / 100
GRID = np.stack(np.meshgrid(*[SPACING * np.arange(101)] * 3, indexing="ij"), axis=-1)
UP = np.array([0, 0, 1.0])


def block_with_slot(rise):
    """A block with a slot along x, .2 wide and .2 deep at its ends, whose floor rises inwards; a bore along y below."""
    x, y, z = np.moveaxis(GRID, -1, 0)
    block = np.minimum.reduce([0.4 - np.abs(x - 0.5), 0.3 - np.abs(y - 0.5), 0.3 - np.abs(z - 0.5)])
    floor = 0.6 + rise * np.minimum(x - 0.1, 0.9 - x)
    slot = np.minimum(0.1 - np.abs(y - 0.5), z - floor)
    bore = 0.12 - np.hypot(x - 0.5, z - 0.55)
    return Volume(np.minimum.reduce([block, -slot, -bore]).astype(np.float32), np.zeros(3), SPACING)


@pytest.mark.parametrize("rise", [0.1, 0.3])
def test_a_channel_is_told_from_a_bore_across_it_by_its_ends(rise):
    ends = [SimpleNamespace(normal=np.array([s, 0, 0.0]), offset=0.4 + s * 0.5) for s in (1.0, -1.0)]
    hull = block_with_slot(rise)
    found = cuts(hull, np.array([1.0, 0, 0]), ends)
    (slot,) = [c for c in found if c.at_ends]
    within = np.array([[0.5, 0.5, 0.63], [0.3, 0.43, 0.65], [0.7, 0.57, 0.69]])
    beside = np.array([[0.5, 0.3, 0.55], [0.5, 0.7, 0.55], [0.5, 0.5, 0.57], [0.3, 0.37, 0.65], [0.5, 0.5, 0.45]])
    (prism,) = slot.prisms
    assert (hull.without(prism, 0.0).scene().signed_distance(within) > 0).all()
    assert (prism.signed_distance(beside, 0.0) > 0).all()
    somewhere = [c for c in found if not c.at_ends]
    assert all((c.prisms[0].signed_distance(beside, 0.0) < 0).any() for c in somewhere)  # they take the bore along


@pytest.mark.parametrize("told", [False, True])
def test_what_nothing_tells_of_is_not_cut_along_with_a_channel(monkeypatch, told):
    """Columns that are empty somewhere take a bore along; what shows the ends of a slot speaks for it alone."""
    ends = [SimpleNamespace(normal=np.array([s, 0, 0.0]), offset=0.4 + s * 0.5) for s in (1.0, -1.0)]
    hull = block_with_slot(0.1)
    found = cuts(hull, np.array([1.0, 0, 0]), ends)
    (somewhere,) = [c for c in found if not c.at_ends]
    opened = hull.without(somewhere.prisms[0], 0.0)

    def disagreements(images, before, after, reach):
        rest = not (before.signed_distance(np.array([[0.3, 0.5, 0.61]])) < 0).any()  # the slot is open before
        return (1.0, 0.2, 500 if told else 0) if rest else (1.0, 0.2, 500)

    monkeypatch.setattr(sweep, "disagreements", disagreements)
    monkeypatch.setattr(sweep, "one_surface", lambda *_: 0.0)
    less = sweep._shown_at_ends(None, hull, somewhere, opened, found)
    assert (less is None) == told
    if less is not None:
        left = less[0].scene().signed_distance(np.array([[0.3, 0.5, 0.61], [0.3, 0.5, 0.5]]))
        assert left[0] > 0  # in the slot
        assert left[1] < 0  # beside the bore


@pytest.mark.parametrize(("deep", "rays", "ends"), [(0.28, 500, True), (0.28, 30, False), (0.4, 500, False)])
def test_a_bore_with_a_narrower_end_is_not_carried_along(monkeypatch, deep, rays, ends):
    """Silhouettes see through it, and leave a funnel that is as wide as the bore at its mouth."""
    x, y, z = np.moveaxis(GRID, -1, 0)
    block = np.minimum.reduce([0.4 - np.abs(x - 0.5), 0.4 - np.abs(y - 0.5), 0.2 - np.abs(z - 0.5)])
    hull = Volume(block.astype(np.float32), np.zeros(3), SPACING)
    on = Lattice(np.array([0.3, 0.3, 0.7]), *np.eye(3), SPACING, (40, 40))
    prism = Prism(on, np.linalg.norm(on.centers()[..., :2] - 0.5, axis=-1) < 0.15, 0.4, False, 0.0)
    axis = np.column_stack([np.full((80, 2), 0.5), np.linspace(0.305, 0.695, 80)])
    true = axis[:, 2] > 0.7 - deep

    def disagreements(images, before, after, reach):
        wrong = [float(((scene.signed_distance(axis) > 0) != true).mean()) for scene in (before, after)]
        return (*wrong, rays)

    monkeypatch.setattr(sweep, "disagreements", disagreements)
    opened = hull.without(prism, 0.0)
    assert sweep._ends_before(None, hull, Cut((prism,), 100.0, False), opened) == ends


@pytest.mark.parametrize(("brim", "deep", "kept"), [(0.02, False, True), (0.02, True, False), (0.0, False, True)])
def test_a_section_loses_the_brim_that_silhouettes_need(brim, deep, kept):
    """A slot's section .2 wide, with a brim on either side: rays along the brim have nothing else in their way."""
    outline = np.zeros((100, 60), bool)
    outline[40:60, 30:60] = True  # y, z
    wide = outline.copy()
    wide[round(40 - 100 * brim) : round(60 + 100 * brim), 55:60] = True
    lattice = Lattice(
        np.array([0.9, 0, 0]), np.array([0, 1.0, 0]), np.array([0, 0, 1.0]), np.array([1.0, 0, 0]), 0.01, wide.shape
    )
    y = np.array([0.385, 0.615, *np.linspace(0.42, 0.58, 90)])
    entry = np.column_stack([np.full(92, 0.2), y, np.full(92, 0.575)])
    if deep:
        entry[:40, 1], entry[:40, 2] = 0.5, 0.45
    only = np.arange(92) < (40 if deep else 2)  # the others have something below the slot in their way, too
    chords = Chords(
        np.arange(92),
        entry,
        entry + np.where(only, 0.6, 0.9)[:, None] * [1, 0, 0] + np.where(only, 0, -0.5)[:, None] * UP,
    )
    cut = Cut((Prism(lattice, wide, 0.8, False, 0.0),), 1e4, True)
    found = _filling(chords, chords.samples(), cut)
    assert (found is not None) == kept
    if found is not None and brim:
        left = found.prisms[0].outline
        assert not left[:39].any()
        assert not left[61:].any()
        assert (left & outline).sum() > 0.95 * outline.sum()


def test_a_channel_goes_on_past_a_slot_across_it():
    x = GRID[..., 0]
    hull = block_with_slot(0.1)
    hull = hull.with_field(
        np.minimum(hull.field, np.maximum(np.abs(x - 0.5) - 0.08, 0.45 - GRID[..., 2])).astype(np.float32)
    )
    walls = [SimpleNamespace(normal=np.array([s, 0, 0.0]), offset=-0.08 + s * 0.5) for s in (1.0, -1.0)]
    ends = [SimpleNamespace(normal=np.array([s, 0, 0.0]), offset=0.4 + s * 0.5) for s in (1.0, -1.0)]
    whole = [c for c in cuts(hull, np.array([1.0, 0, 0]), walls + ends) if c.prisms[0].depth > 0.7]
    within = np.array([[0.15, 0.5, 0.63], [0.3, 0.43, 0.64], [0.7, 0.57, 0.63], [0.85, 0.5, 0.63]])
    beside = np.array([[0.3, 0.5, 0.57], [0.7, 0.65, 0.65], [0.2, 0.35, 0.65]])
    assert any(
        (c.prisms[0].signed_distance(within, 0.0) < 0).all() and (c.prisms[0].signed_distance(beside, 0.0) > 0).all()
        for c in whole
    )
    assert all(c.at_ends for c in whole)  # what is empty somewhere in it may be the slot across


def narrowing_bore(radius=0.1, least=0.06):
    """A block with an upright bore that silhouettes leave too narrow in the middle, and a dent in its side."""
    x, y, z = np.moveaxis(GRID, -1, 0)
    block = np.minimum.reduce([0.3 - np.abs(x - 0.5), 0.3 - np.abs(y - 0.5), 0.4 - np.abs(z - 0.5)])
    wide = np.maximum(radius - (radius - least) * np.maximum(1 - np.abs(z - 0.5) / 0.3, 0), least)
    bore = wide - np.hypot(x - 0.5, y - 0.5)
    dent = 0.1 - np.linalg.norm(GRID - [0.8, 0.5, 0.5], axis=-1)
    return Volume(np.minimum.reduce([block, -bore, -dent]).astype(np.float32), np.zeros(3), SPACING)


@pytest.mark.parametrize(("rays", "widened"), [(0, True), (100, False)])
def test_a_hole_that_nobody_sees_into_is_straight(monkeypatch, rays, widened):
    hull = narrowing_bore()
    nothing = SimpleNamespace(contour_rays=(np.array([[-1, 0.3, 0.2]]), np.array([[1.0, 0, 0]])))
    monkeypatch.setattr(widening, "disagreements", lambda *_: (1.0, 1.0 * bool(rays), rays))
    opened, prisms = widening.widen(nothing, hull, [], [])
    in_bore = np.array([[0.585, 0.5, 0.5], [0.5, 0.415, 0.45], [0.57, 0.5, 0.6]])
    elsewhere = np.array([[0.62, 0.5, 0.5], [0.5, 0.38, 0.5], [0.78, 0.55, 0.35], [0.3, 0.5, 0.5]])
    assert (opened.scene().signed_distance(in_bore) > 0).all() == widened
    assert (opened.scene().signed_distance(elsewhere) < 0).all()
    assert bool(prisms) == widened


def test_faces_elsewhere_end_no_hole():
    """The walls of a slot in a block's side lie between the ends of a bore, and not beside it."""
    x, _, z = np.moveaxis(GRID, -1, 0)
    slot = np.minimum(0.06 - np.abs(z - 0.5), 0.3 - x)
    hull = narrowing_bore()
    hull = hull.with_field(np.minimum(hull.field, -slot).astype(np.float32))
    heights = {0.1: -1.0, 0.44: 1.0, 0.56: -1.0, 0.9: 1.0}
    faces = [SimpleNamespace(normal=np.array([0, 0, side]), offset=side * h) for h, side in heights.items()]
    longest = holes(hull, np.array([0, 0, 1.0]), faces)[0].prisms[0]
    assert longest.depth == pytest.approx(0.8)
    assert (longest.signed_distance(np.array([[0.585, 0.5, 0.5], [0.5, 0.415, 0.45]]), 0.0) < 0).all()


def test_a_hole_is_no_wider_past_the_floor_of_its_counterbore():
    x, y, z = np.moveaxis(GRID, -1, 0)
    block = np.minimum.reduce([0.3 - np.abs(x - 0.5), 0.3 - np.abs(y - 0.5), 0.4 - np.abs(z - 0.5)])
    bore = np.where(z > 0.5, 0.2, 0.08) - np.hypot(x - 0.5, y - 0.5)
    hull = Volume(np.minimum(block, -bore).astype(np.float32), np.zeros(3), SPACING)
    faces = [
        SimpleNamespace(normal=np.array([0, 0, side]), offset=side * height)
        for height, side in ((0.1, -1.0), (0.5, 1.0), (0.9, 1.0))
    ]
    assert all(cut.prisms[0].depth < 0.45 for cut in holes(hull, np.array([0, 0, 1.0]), faces))


def hole(normal, middle, depth, radius=0.06, error=0.1, through=True):
    """A round hole, straight down from a mouth."""
    normal = np.asarray(normal, float) / np.linalg.norm(normal)
    first, second = plane_axes(normal)
    pitch, size = 0.005, 41
    origin = np.asarray(middle, float) - (first + second) * pitch * (size - 1) / 2
    rows, columns = np.mgrid[:size, :size]
    outline = np.hypot(rows - size // 2, columns - size // 2) * pitch < radius
    return Prism(Lattice(origin, first, second, normal, pitch, outline.shape), outline, depth, through, error)


def test_a_hole_reaches_from_mouth_to_mouth():
    down, up = hole(UP, [0.5, 0.5, 0.8], 0.2, radius=0.055), hole(-UP, [0.5, 0.5, 0.3], 0.1)
    depths = [prism.depth for prism in joined([down, up], 0.02)]
    assert max(depths) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("radius", "error", "straight"), [(0.055, 0.03, True), (0.04, 0.03, False), (0.055, 0.2, False)]
)
def test_a_hole_whose_far_mouth_is_straight_and_as_wide_is_not_countersunk(radius, error, straight):
    sunk = replace(hole(UP, [0.5, 0.5, 0.8], 0.5, radius=0.055), draft=1.4, sink=0.014)
    found = joined([sunk, hole(-UP, [0.5, 0.5, 0.3], 0.5, radius, error)], 0.02)
    assert (found[0].draft == 0) == straight


def test_a_hole_through_a_tubes_wall_does_not_join_what_is_around_it_to_its_bore():
    """Silhouettes leave a slit of it, and a chamfer empties what is outside of the tube at one end."""
    x, y, z = np.moveaxis(GRID - 0.5, -1, 0)
    away = np.hypot(x, y)
    wall = np.minimum(0.35 - np.maximum(z - 0.2, 0) - away, away - 0.15 - 0.05 * (z < 0.1))
    slit = np.minimum.reduce([0.008 - np.abs(y - 0.001), 0.05 - np.abs(z), -x])
    field = np.minimum.reduce([wall, -slit, 0.3 - np.abs(z)])
    hull = Volume(field.astype(np.float32), np.zeros(3), SPACING)
    ends = [SimpleNamespace(normal=s * UP, offset=0.3 + s * 0.5) for s in (1.0, -1.0)]
    somewhere = [c for c in cuts(hull, UP, ends) if not c.at_ends]
    parts, wholes = ([c.prisms[0] for c in somewhere if c.necked == necked] for necked in (False, True))
    in_wall, in_bore = np.array([[0.25, 0.5, 0.3], [0.25, 0.5, 0.7]]), np.array([[0.67, 0.5, 0.7]])
    assert all((prism.signed_distance(in_wall, 0.0) > 0).all() for prism in parts)
    assert any((prism.signed_distance(in_bore, 0.0) < 0).all() for prism in parts)
    (whole,) = wholes  # tried after its parts
    assert (whole.signed_distance(np.concatenate([in_wall, in_bore]), 0.0) < 0).all()


@pytest.mark.parametrize(("lean", "kept"), [(0.15, 1), (0.0, 2), (0.9, 2)])
def test_a_crooked_far_mouth_is_the_same_hole(lean, kept):
    straight = hole(-UP, [0.5, 0.5, 0.2], 0.4)
    crooked = hole([0, -lean, 1.0], [0.5, 0.5, 0.59], 0.4, radius=0.05, error=0.2)
    found = told_once([crooked, straight], [], 0.02)
    assert len(found) == kept
    assert found[-1] is straight
    assert len(told_once([crooked], [straight], 0.02)) == kept - 1  # what is known stays


@pytest.mark.parametrize(("error", "kept"), [(0.2, 1), (0.01, 2)], ids=["told worse", "told better"])
def test_a_lid_that_leans_within_a_pocket_is_gone_with_it(error, kept):
    pocket = hole(UP, [0.5, 0.5, 0.8], 0.15, radius=0.09, error=0.05, through=False)
    lid = hole([0, -0.6, 0.8], [0.5, 0.5, 0.74], 0.05, radius=0.04, error=error, through=False)
    below = hole(UP, [0.5, 0.5, 0.65], 0.1, radius=0.04, error=error, through=False)  # its lid is the pocket's floor
    assert len(told_once([pocket, lid], [], 0.02)) == kept
    assert len(told_once([pocket, below], [], 0.02)) == 2


def oblique(turn, depth=0.5, **changes):
    """A hole of a tube that leans by 30 degrees, from the plane z = .2 up, its direction off by some radians."""
    lean = np.radians(30.0) + turn
    mouth = hole(-UP, [0.5, 0.5, 0.2], depth, **changes)
    cells = mouth.lattice.centers() - [0.5, 0.5, 0.2]
    outline = (cells[..., 0] * np.cos(np.radians(30.0))) ** 2 + cells[..., 1] ** 2 < 0.06**2
    axes = mouth.lattice.first, mouth.lattice.second
    tilt = tuple(float(np.tan(lean) * axis[0]) for axis in axes)
    return replace(mouth, outline=outline, tilt=tilt)


@pytest.mark.parametrize("turn", [0.0, 0.06, -0.06, None])
def test_a_hole_with_an_oblique_mouth_runs_square_to_its_other_one(turn):
    """However its direction is told from the oblique mouth, if at all, it ends where all of that is open."""
    axis = np.array([np.sin(np.radians(30.0)), 0, np.cos(np.radians(30.0))])
    square = replace(hole(axis, [0.5, 0.5, 0.2] + 0.6 * axis, 0.3, through=False), endless=True)
    leaning = replace(oblique(0.0, 0.05, through=False), tilt=(0.0, 0.0)) if turn is None else oblique(turn)
    pair = [leaning, square]
    for order in (pair, pair[::-1]):
        (bore,) = square_ends(order, 0.02)
        assert bore.through
        np.testing.assert_allclose(bore.lattice.normal, axis)
        assert bore.depth == pytest.approx(0.6 + 0.06 * np.tan(np.radians(30.0)), abs=0.006)


@pytest.mark.parametrize("other", ["floor", "beside", "wide", "another way"])
def test_what_may_not_be_the_square_end_of_an_oblique_hole_stays(other):
    lean = np.radians(10.0 if other == "another way" else 30.0)
    axis = np.array([np.sin(lean), 0, np.cos(lean)])
    middle = np.array([0.5, 0.54 if other == "beside" else 0.5, 0.2]) + 0.6 * axis
    square = hole(axis, middle, 0.3, radius=0.09 if other == "wide" else 0.06, through=False)
    square = replace(square, endless=other != "floor")
    leaning = oblique(0.0)
    assert square_ends([leaning, square], 0.02) == [leaning, square]


def lidded(prism):
    return prism, prism.lattice.centers()[prism.outline]


@pytest.mark.parametrize("lean", [0.0, 0.11, 0.3])
def test_a_cross_hole_in_a_cone_runs_along_the_line_through_both_mouths(lean):
    """The cone's sides lean, and what is found under them leans as much, down from both."""
    ends = [hole([0, sign, -lean], [0.5, 0.5 + 0.25 * sign, 0.4], 0.2, error=0.1, through=False) for sign in (1, -1)]
    ends = [replace(end, endless=True) for end in ends]
    asked = []

    def again(lid, way):
        asked.append(way)
        return [lidded(replace(hole(way, lid.mean(axis=0), 0.5, error=0.1 - 0.02 * len(asked)), endless=True))]

    (bore,) = in_line([lidded(end) for end in ends], again)
    np.testing.assert_allclose(np.abs(bore.lattice.normal), [0, 1, 0], atol=0.015)  # half a cell
    assert bore.through
    assert bore.depth == pytest.approx(0.5, abs=1e-3)
    assert len(asked) == (2 if lean else 0)  # parallel faces have told the direction
    if lean:
        assert bore.error == pytest.approx(0.06)  # the end that is told better


@pytest.mark.parametrize("other", ["floor", "wide", "steep", "nothing again", "a floor again"])
def test_what_may_not_be_two_ends_of_one_hole_stays_two(other):
    slope = 0.7 if other == "steep" else 0.11
    first = replace(hole([0, 1, -slope], [0.5, 0.75, 0.4], 0.2, through=False), endless=True)
    second = hole([0, -1, -slope], [0.5, 0.25, 0.4], 0.2, radius=0.09 if other == "wide" else 0.06, through=False)
    second = replace(second, endless=other != "floor")

    def again(lid, way):
        looked = lidded(hole(way, lid.mean(axis=0), 0.1, through=False))
        return [] if other == "nothing again" else [looked]

    assert in_line([lidded(first), lidded(second)], again) == [first, second]


@pytest.mark.parametrize("pierced", [0.0, 0.03], ids=["closed", "open in its middle"])
@pytest.mark.parametrize("lean", [0.0, 0.1])
def test_a_hole_without_floor_is_looked_for_on_the_other_side(lean, pierced):
    """Silhouettes may have opened the middle of both mouths."""
    x, y, z = np.moveaxis(GRID, -1, 0)
    block = np.minimum.reduce([0.3 - np.abs(x - 0.5), 0.3 - np.abs(y - 0.5), 0.3 - np.abs(z - 0.5)])
    scene = Volume(np.minimum(block, np.hypot(x - 0.5, y - 0.5) - pierced), np.zeros(3), SPACING).scene()
    first = replace(hole([0, lean, 1], [0.5, 0.5, 0.8], 0.2, through=False), endless=True)
    lid = lidded(first)[1]
    far = opposite(first, lid, scene)
    assert far[:, 2].mean() == pytest.approx(0.2, abs=0.02)
    np.testing.assert_allclose(far[:, :2].mean(axis=0), [0.5, 0.5 - 0.6 * lean], atol=0.015)
    np.testing.assert_allclose(far - far.mean(axis=0), lid - lid.mean(axis=0), atol=1e-9)
    assert opposite(replace(first, endless=False), lid, scene) is None


@pytest.mark.parametrize(("lumen", "goes_on"), [(0.0, False), (0.04, True)], ids=["a whole wall", "a pierced one"])
def test_a_hole_goes_on_through_a_wall_that_silhouettes_pierce_where_no_ray_tells(monkeypatch, lumen, goes_on):
    x, y, z = np.moveaxis(GRID, -1, 0)
    walls = np.minimum.reduce([0.3 - np.abs(x - 0.5), 0.3 - np.abs(y - 0.5), 0.1 - np.abs(np.abs(z - 0.5) - 0.2)])
    away = np.hypot(x - 0.5, y - 0.5)
    hull = Volume(np.minimum(walls, away - lumen).astype(np.float32), np.zeros(3), SPACING)
    monkeypatch.setattr(shorten, "disagreements", lambda *_: (0.0, 0.0, 0))
    through = hole(UP, [0.5, 0.5, 0.8], 0.6)
    kept = shorten.shortened(None, hull, through, 2 * SPACING)
    assert (kept.depth == through.depth) == goes_on
    if not goes_on:
        assert kept.depth == pytest.approx(0.2, abs=0.02)
    assert shorten.shortened(None, hull, replace(through, through=False), 0.0).depth == through.depth


@pytest.mark.parametrize("bridge", [0.03, 0.0], ids=["in part", "all"])
def test_a_hole_that_silhouettes_have_opened_ends_before_the_wall_behind(monkeypatch, bridge):
    """A window in a case: seen through from above, so that there is nothing left of the first wall, or a strip."""
    x, y, z = np.moveaxis(GRID, -1, 0)
    outer = np.minimum.reduce([0.3 - np.abs(x - 0.5), 0.3 - np.abs(y - 0.5), 0.1 - np.abs(np.abs(z - 0.5) - 0.2)])
    window = np.maximum.reduce([np.hypot(x - 0.5, y - 0.5) - 0.06, 0.5 - z, bridge - np.abs(x - 0.5)])
    hull = Volume(np.minimum(outer, window).astype(np.float32), np.zeros(3), SPACING)
    said = []
    monkeypatch.setattr(shorten, "disagreements", lambda *_: said.append(1) or (0.1, 1.7, 500))
    kept = shorten.shortened(None, hull, hole(UP, [0.5, 0.5, 0.8], 0.6), 2 * SPACING)
    assert said
    assert 0.19 < kept.depth < 0.38 if bridge else 0 < kept.depth < 0.38


@pytest.mark.parametrize(
    ("said", "opened"), [((1.0, 0.5, 500), True), ((0.2, 1.3, 500), False), ((0.2, 1.3, 20), True)]
)
def test_views_judge_openings_in_curved_faces(monkeypatch, said, opened):
    x, y, z = np.moveaxis(GRID, -1, 0)
    shaft = Volume(np.minimum(0.2 - np.hypot(y - 0.5, z - 0.5), 0.4 - np.abs(x - 0.5)), np.zeros(3), SPACING)
    across = hole(UP, [0.5, 0.5, 0.7], 0.4)
    monkeypatch.setattr(carve, "find_prisms", lambda *_: [])
    monkeypatch.setattr(carve, "find_curved", lambda *_: [across])
    monkeypatch.setattr(carve, "drawn", lambda images, scene, hull, prism, margin: prism)
    monkeypatch.setattr(carve, "disagreements", lambda *_: said)
    hull, known, _ = carve.open_concavities(None, shaft)
    assert len(known) == opened
    assert (hull.scene().signed_distance(np.array([[0.5, 0.5, 0.6]]))[0] > 0) == opened


@pytest.mark.parametrize("margin", [0.0, 0.1])
def test_what_a_prism_contains_is_where_its_distance_is_negative(margin):
    points = np.random.default_rng(8).uniform(0, 1, (20000, 3))
    prism = hole(UP, [0.5, 0.5, 0.8], 0.3, through=margin > 0)
    assert np.array_equal(prism.contains(points, margin), prism.signed_distance(points, margin) < 0)


@pytest.mark.parametrize("lean", [0.0, 0.08])
@pytest.mark.parametrize("told", [True, False], ids=["both mouths", "one mouth"])
def test_the_far_mouth_of_a_leaning_hole_is_looked_at_too(monkeypatch, lean, told):
    """A hole through a cone leans with its face, and covers the place where it comes out."""
    mouths = [hole([0, sign, -lean], [0.5, 0.5 + 0.25 * sign, 0.4], 0.6, through=sign > 0) for sign in (1, -1)]
    mouths[1] = replace(mouths[1], endless=True)
    square = [hole([0, sign, 0], [0.5, 0.5 + 0.25 * sign, 0.4], 0.6) for sign in (1, -1)]
    spots = [SimpleNamespace(lattice=mouth.lattice, relief=np.zeros(mouth.outline.shape)) for mouth in mouths]
    surfaces = {id(prism.lattice): prism for prism in [*mouths, *square]}

    def around(places, scene, cell, pitch, facing=None):
        of = mouths if facing is None else square
        which = 0 if places.mean(axis=0)[1] > 0.5 else 1
        return SimpleNamespace(lattice=of[which].lattice, relief=np.zeros(of[which].outline.shape))

    def stack_of(images, scene, lattice, relief):
        return SimpleNamespace(lattice=lattice, surface=lattice.centers)

    def below(images, scene, stack, centered):
        prism = surfaces[id(stack.lattice)]
        return [(prism, 1.0)] if told or prism.lattice.normal[1] > 0 else []

    monkeypatch.setattr(find, "planar_regions", lambda *_: [])
    monkeypatch.setattr(find, "spots", lambda *_: spots)
    monkeypatch.setattr(find, "spot_around", around)
    monkeypatch.setattr(find, "rectify", stack_of)
    monkeypatch.setattr(find, "openings", lambda stack, least: [surfaces[id(stack.lattice)].outline])
    monkeypatch.setattr(find, "is_framed", lambda *_: True)
    monkeypatch.setattr(find, "_concavities", below)
    scene = SimpleNamespace(
        vertices=np.zeros((0, 3)),
        triangles=np.zeros((0, 3), int),
        near=lambda places, reach: np.zeros(len(places)),
        distances=lambda places, rays: np.full(len(places), np.inf),
    )
    images = SimpleNamespace(views=SimpleNamespace(cameras=SimpleNamespace(footprint=lambda: 0.005)))
    (bore,) = find.find_curved(images, scene, 0.005)
    assert bore.through
    np.testing.assert_allclose(bore.lattice.normal, [0, 1, 0] if told else mouths[0].lattice.normal, atol=0.015)
