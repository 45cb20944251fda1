"""Pockets with a notch in their rim: the lid that is left tells the whole opening, and the notch is none of it."""

import numpy as np
import pytest
from brepgaussian.splatting.concave import broken
from brepgaussian.splatting.concave.broken import broken_rims
from brepgaussian.splatting.concave.draw import around, border_of
from brepgaussian.splatting.concave.openings import LID, WALL, Stack
from brepgaussian.splatting.concave.planes import Plane, region_on
from brepgaussian.splatting.concave.prism import Lattice
from brepgaussian.splatting.concave.sections import Rounded, Section
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.hull import carve
from build123d import Align, Box, Cylinder, Pos
from rendered import missed, rendered, wrong_of
from scipy import ndimage

PITCH, SHAPE, TOP = 0.005, (160, 120), 0.5
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]
FACE = (ROWS >= 30) & (ROWS < 130) & (COLUMNS >= 30) & (COLUMNS < 90)
POCKET = (ROWS >= 40) & (ROWS < 120) & (COLUMNS >= 40) & (COLUMNS < 80)
NOTCH = (ROWS >= 120) & (ROWS < 130) & (np.abs(COLUMNS - 60) < 8)
OPENED = NOTCH | POCKET & (60 + 4 * np.abs(COLUMNS - 66) < ROWS) & (COLUMNS < 78)  # a wedge through the notch
LEFT = FACE & ~ndimage.binary_erosion(OPENED, iterations=2)  # of the face, to within the hull's roughness
LATTICE = Lattice(np.array([0, 0, TOP]), *np.eye(3), PITCH, SHAPE)


def hull():
    """A block under the face, whose top is .1 lower where it is opened."""
    steps = np.arange(0, 0.85, PITCH)
    x, y, z = np.meshgrid(steps, steps, steps, indexing="ij")
    cells = [np.clip((v / PITCH).astype(int), 0, n - 1) for v, n in zip((x, y), SHAPE, strict=True)]
    top = np.where(OPENED[tuple(cells)], TOP - 0.1, TOP)
    sides = np.minimum.reduce([x - 0.15, 0.65 - x, y - 0.15, 0.45 - y, z - 0.1])
    return Volume(np.minimum(sides, top - z).astype(np.float32), np.zeros(3), PITCH)


def shown(domain, opened):
    """What 12 views show: a third of them something else where it is open."""
    views = np.full((12, *SHAPE), LID, np.uint8)
    views[::3, opened] = WALL
    return Stack(LATTICE, domain, views, np.zeros((12, *SHAPE), np.float32), np.zeros(SHAPE))


@pytest.fixture
def looked(monkeypatch):
    """A face as it is looked at: without what is opened, and with it; no frame is added."""
    face = shown(LEFT, POCKET & LEFT)
    monkeypatch.setattr(Lattice, "widened", lambda self, _: self)
    monkeypatch.setattr(broken, "rectify", lambda *_: face)
    monkeypatch.setattr(broken, "across", lambda _images, _scene, _lattice, domain: shown(domain, POCKET | NOTCH))
    return face


def test_a_pocket_is_told_by_what_is_left_of_its_lid_and_its_rim(looked):
    face, whole, outlines = broken_rims(None, hull().scene(), looked, 50 * PITCH**2)
    assert face is looked
    assert whole.domain[POCKET].mean() > 0.98
    (outline,) = outlines
    assert np.count_nonzero(outline ^ POCKET) < 0.03 * np.count_nonzero(POCKET)
    assert not outline[ROWS > 121].any()  # the notch


def test_a_face_that_nothing_has_opened_stays_as_it_is(looked):
    x, y, z = np.meshgrid(*[np.arange(0, 0.85, PITCH)] * 3, indexing="ij")
    whole = np.minimum.reduce([x - 0.15, 0.65 - x, y - 0.15, 0.45 - y, z - 0.1, TOP - z]).astype(np.float32)
    face = shown(FACE, POCKET)
    assert broken_rims(None, Volume(whole, np.zeros(3), PITCH).scene(), face, 50 * PITCH**2) == (face, face, [])


def test_what_silhouettes_have_opened_altogether_needs_no_more(looked):
    """A gap in a rim without a lid beside it."""
    bare = shown(LEFT, np.zeros(SHAPE, bool))
    assert broken_rims(None, hull().scene(), bare, 50 * PITCH**2)[2] == []


@pytest.mark.parametrize(("radius", "told"), [(28, True), (12, False)])
def test_a_bore_that_a_slot_crosses_is_the_disc_in_what_is_open(monkeypatch, radius, told):
    """The slot has left a segment of the lid; a disc in the slot alone touches the rim in two places."""
    plate = (ROWS >= 20) & (ROWS < 140) & (COLUMNS >= 20) & (COLUMNS < 100)
    slot = plate & (np.abs(COLUMNS - 60) < 10)
    bore = np.hypot(ROWS - 80, COLUMNS - 60) < radius
    gone = slot | bore & (COLUMNS < 78)
    left = plate & ~ndimage.binary_erosion(gone, iterations=2)
    face = shown(left, (bore if told else plate & (COLUMNS > 90)) & left)
    monkeypatch.setattr(Lattice, "widened", lambda self, _: self)
    monkeypatch.setattr(broken, "rectify", lambda *_: face)
    monkeypatch.setattr(broken, "across", lambda _images, _scene, _lattice, domain: shown(domain, bore | slot))
    monkeypatch.setattr(broken, "_gone", lambda *_: gone & ~left)
    monkeypatch.setattr(broken, "_refuted_below", lambda *_: False)
    found = broken_rims(None, None, face, 50 * PITCH**2)[2]
    assert len(found) == told
    for outline in found:
        assert np.count_nonzero(outline ^ bore) < 0.04 * np.count_nonzero(bore)


@pytest.mark.parametrize("turn", [0.0, 0.3])
@pytest.mark.parametrize("radius", [0.0, 12.0])
def test_a_rectangle_is_told_without_one_of_its_corners(turn, radius):
    cells = np.stack(np.meshgrid(np.arange(200.0), np.arange(160.0), indexing="ij"), axis=-1) - (100, 80)
    turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    cells = np.abs(cells @ turned)
    beyond = cells - (60 - radius, 40 - radius)
    inside = np.linalg.norm(np.maximum(beyond, 0), axis=-1) + np.minimum(beyond.max(axis=-1), 0) <= radius
    places = border_of(inside)
    left = places[np.linalg.norm(places - (100, 80) - turned @ (60, 40), axis=1) > 30]
    assert len(left) < len(places)
    section = around(left)
    assert section.center == pytest.approx((100, 80), abs=0.5)
    assert sorted(section.shape.half) == pytest.approx([40, 60], abs=0.6)


@pytest.mark.parametrize("gap", [0.3, 0.8])
def test_a_circle_is_told_without_an_arc_of_it_and_with_a_chord_beside_that(gap):
    """A round pocket whose wall a slot breaks: at the slot's sides the outline leaves the rim for the chord."""
    cells = np.stack(np.meshgrid(np.arange(160.0), np.arange(160.0), indexing="ij"), axis=-1) - (80.3, 79.6)
    inside = (np.linalg.norm(cells, axis=-1) <= 60) & (cells[..., 0] <= 60 * np.cos(gap))
    places = border_of(inside)
    left = places[np.abs(places[:, 1] - 79.6) > 60 * np.sin(gap) - 4]
    left = np.concatenate([left, places[(places[:, 0] < 80) & (np.abs(places[:, 1] - 79.6) <= 60 * np.sin(gap) - 4)]])
    section = around(left)
    assert section.center == pytest.approx((80.3, 79.6), abs=0.3)
    assert section.shape.half == pytest.approx((60, 60), abs=0.5)
    assert section.shape.radius == pytest.approx(60, abs=0.5)


def test_what_lies_on_a_known_plane():
    vertices, triangles = hull().mesh()
    top = region_on(Plane(np.array([0, 0, 1.0]), TOP), vertices, triangles, PITCH)
    assert top.area(vertices, triangles) == pytest.approx(np.count_nonzero(FACE & ~OPENED) * PITCH**2, rel=0.1)
    assert region_on(Plane(np.array([0, 0, 1.0]), TOP + 0.1), vertices, triangles, PITCH) is None
    assert region_on(Plane(np.array([0, 0, -1.0]), -TOP), vertices, triangles, PITCH) is None


def test_a_widened_lattice_has_the_same_cells():
    wider = LATTICE.widened(3)
    np.testing.assert_allclose(wider.centers()[3:-3, 3:-3], LATTICE.centers(), atol=1e-12)


def test_a_pot_through_whose_notch_silhouettes_have_opened_its_upper_half(tmp_path):
    low = (Align.CENTER, Align.CENTER, Align.MIN)
    part = Cylinder(20, 24, align=low) - Pos(0, 0, 4) * Cylinder(17, 30, align=low)
    views, truth = rendered(tmp_path, part - Pos(-20, 0, 14) * Box(12, 11, 20, align=low))
    too_much, too_little = missed(views, truth)
    assert too_much < 0.03
    assert too_little < 0.03


def test_a_case_of_whose_lid_two_notches_have_opened_an_end(tmp_path):
    """What is left of the lid spans half of it; under that a floor and a wall look like a corner.

    Of the top of the low wall across it, views tell some pieces.
    """
    low = (Align.CENTER, Align.CENTER, Align.MIN)
    part = (
        Box(80, 50, 24, align=low)
        - Pos(0, 0, 5) * Box(71, 41, 30, align=low)
        + Pos(9, 0, 5) * Box(4, 41, 11, align=low)
    )
    for x, wide in ((-21, 9), (25, 14)):
        part -= Pos(x, 25, 18) * Box(wide, 14, 20, align=low)
    views, truth = rendered(tmp_path, part, 50, 600)
    hull, _ = carve(views, 128, concavities=True, patches=truth.face_ids)
    (island,) = max(hull.prisms, key=lambda prism: prism.area).islands
    assert island.area * 80**2 == pytest.approx(4 * 41, rel=0.15)
    assert island.depth * 80 == pytest.approx(11, abs=0.3)
    too_much, too_little = wrong_of(hull, truth)
    assert too_much < 0.01
    assert too_little < 0.01


@pytest.mark.parametrize("notches", [1, 2])
def test_a_rectangle_is_told_without_the_notches_through_its_rim(notches):
    far = (ROWS < 40) & (ROWS >= 30) & (np.abs(COLUMNS - 62) < 6) & (notches == 2)
    opening = POCKET | NOTCH | far
    section = broken._without_notches(opening, shown(FACE, opening))
    outline = section.signed_distance(np.stack([ROWS, COLUMNS], axis=-1).astype(float)) <= 0
    assert np.count_nonzero(outline ^ POCKET) < 0.04 * np.count_nonzero(POCKET)


@pytest.mark.parametrize(("share", "refuted"), [(0.3, True), (0.0, False)])
def test_hull_below_an_opened_lid_is_a_floor_unless_views_refute_it(monkeypatch, share, refuted):
    places = []

    def asked(_images, _scene, xyz, normals, _pitch):
        places.append((xyz, normals))
        return np.full(len(xyz), share)

    monkeypatch.setattr(broken, "refuted_share", asked)
    wedge = OPENED & POCKET
    assert (
        broken._refuted_below(None, hull().scene(), shown(FACE, wedge), ndimage.binary_erosion(wedge, iterations=3))
        == refuted
    )
    ((xyz, normals),) = places
    assert xyz[:, 2] == pytest.approx(TOP - 0.1, abs=0.01)
    assert normals @ [0, 0, 1] == pytest.approx(1.0, abs=0.01)
    assert not broken._refuted_below(None, hull().scene(), shown(FACE, wedge), np.zeros(SHAPE, bool))


@pytest.mark.parametrize(("wide", "open_side", "walled"), [(8, False, True), (40, True, False), (0, False, True)])
@pytest.mark.parametrize("half", [(30.0, 20.0), (20.0, 30.0), (25.0, 25.0)])
def test_a_pocket_is_walled_in_on_all_sides_and_a_slots_end_is_not(wide, open_side, walled, half):
    """A notch leaves some of its side; a slot, seen from its end, has none on one of them."""
    section = Section((50.0, 40.0), 0.2, Rounded(half, 25.0 if half[0] == half[1] else 0.0))
    rim = section.border(400)
    at = section.local(rim)
    gone = (at[:, 0] > 0) & (np.abs(at[:, 0]) / half[0] > np.abs(at[:, 1]) / half[1])
    rim = rim[~(gone & ((np.abs(at[:, 1]) < wide / 2) | open_side))]
    assert broken._walled_in(section, rim) == walled
