"""Ends of holes: which mouths are those of one hole, also in curved faces, and how far it goes."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.splatting.concave import believed, carve, find, shorten
from brepgaussian.splatting.concave.columns import cuts
from brepgaussian.splatting.concave.join import in_line, joined, opposite, square_ends, told_once
from brepgaussian.splatting.concave.prism import Lattice, Prism, plane_axes
from brepgaussian.splatting.concave.volume import Volume

SPACING = 1 / 100
GRID = np.stack(np.meshgrid(*[SPACING * np.arange(101)] * 3, indexing="ij"), axis=-1)
UP = np.array([0, 0, 1.0])


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


def test_the_cone_of_a_seat_goes_on_to_the_bore_that_its_other_mouth_shows():
    """Few rays tell where a seat ends, so its throat is taken for wider than the bore."""
    seat = replace(hole(UP, [0.5, 0.5, 0.8], 0.5, radius=0.09), draft=0.6, sink=0.03)
    found, bore = joined([seat, hole(-UP, [0.5, 0.5, 0.3], 0.5, radius=0.04)], 0.01)
    assert not found.through
    assert found.sink == pytest.approx(0.05, abs=0.004)
    assert found.depth == pytest.approx(found.sink / 0.6)
    assert bore.through


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


def test_a_lid_that_leans_within_a_hole_is_gone_with_it_however_well_it_is_told():
    bore = hole(UP, [0.5, 0.5, 0.8], 0.6, radius=0.09, error=0.05)
    lid = hole([0, -0.8, 0.6], [0.5, 0.5, 0.7], 0.03, radius=0.04, error=0.01, through=False)
    assert told_once([bore, lid], [], 0.02) == [bore]
    doubtful = replace(bore, error=0.15)
    assert told_once([doubtful, lid], [], 0.02) == [doubtful, lid]


@pytest.mark.parametrize(("tilt", "kept"), [(0.5, 1), (0.0, 2)])
def test_the_far_end_of_a_leaning_hole_is_no_pocket(tilt, kept):
    leaning = replace(hole(-UP, [0.5, 0.5, 0.2], 0.4, error=0.02), tilt=(tilt, 0.0))
    far = np.array([0.5, 0.5, 0.6]) + 0.4 * tilt * leaning.lattice.first
    pocket = hole(UP, far, 0.1, error=0.03, through=False)
    assert len(told_once([pocket, leaning], [], 0.02)) == kept


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
    monkeypatch.setattr(carve, "counterbored", lambda *_: [])
    monkeypatch.setattr(carve, "drawn", lambda images, scene, hull, prism, margin: prism)
    monkeypatch.setattr(believed, "disagreements", lambda *_: said)
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
