"""Openings' outlines in cells and the sections that they are drawings of; rims, walls and the surfels on them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.splatting.concave import walls
from brepgaussian.splatting.concave.draw import border_of, fitted
from brepgaussian.splatting.concave.openings import Stack
from brepgaussian.splatting.concave.prism import Lattice, Prism
from brepgaussian.splatting.concave.rims import at_rim, rim_of
from brepgaussian.splatting.concave.sections import Flatted, Keyed, Polygon, Rounded, Section
from brepgaussian.splatting.concave.walls import Walls, agreed
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy import ndimage

SHAPE, PITCH = (90, 100), 0.005
CENTER = (43.2, 51.7)
SECTIONS = {
    "circle": Section(CENTER, 0.0, Rounded((17.3, 17.3), 17.3)),
    "small circle": Section(CENTER, 0.0, Rounded((5.2, 5.2), 5.2)),
    "slot": Section(CENTER, 0.4, Rounded((30.5, 9.8), 9.8)),
    "rectangle": Section(CENTER, -0.3, Rounded((27.4, 14.6), 0.0)),
    "pocket": Section(CENTER, 1.2, Rounded((28.1, 20.3), 9.4)),
    "hexagon": Section(CENTER, 0.2, Polygon(6, 16.2)),
    "octagon": Section(CENTER, 0.1, Polygon(8, 22.3)),
    "keyed": Section(CENTER, 2.2, Keyed(18.4, 5.6, 25.3)),
    "flatted": Section(CENTER, -0.7, Flatted(17.8, 11.2)),
}
PIECES = [
    ("circle", 1),
    ("slot", 4),
    ("rectangle", 4),
    ("pocket", 8),
    ("hexagon", 6),
    ("octagon", 8),
    ("keyed", 4),
    ("flatted", 2),
]
GRID = np.stack(np.indices(SHAPE), axis=-1).astype(float)


def raster(section: Section) -> np.ndarray:
    return section.signed_distance(GRID) < 0


def opened(cells: np.ndarray) -> np.ndarray:
    return ndimage.binary_opening(cells, iterations=3)


def chewed(cells: np.ndarray, seed: int) -> np.ndarray:
    """Cells with a border that runs half a cell to and fro, smoothly as the views' do."""
    noise = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=cells.shape), 2.0)
    noise *= 0.5 / noise.std()
    signed = ndimage.distance_transform_edt(cells) - ndimage.distance_transform_edt(~cells)
    return opened(signed + noise > 0)


@pytest.mark.parametrize("name", SECTIONS)
@pytest.mark.parametrize("seed", [11, 12])
def test_the_section_of_a_chewed_outline_is_found(name, seed):
    true = SECTIONS[name]
    found = fitted(chewed(raster(true), seed), opened)
    assert found is not None
    assert type(found.shape) is type(true.shape)
    assert np.allclose(found.center, true.center, atol=0.4)
    assert np.abs(found.signed_distance(true.border(200))).max() < 1.2
    if isinstance(true.shape, Rounded):
        assert np.allclose(sorted(found.shape.half), sorted(true.shape.half), atol=0.5)
        assert abs(found.shape.radius - true.shape.radius) < (1.5 if name == "pocket" else 0.5)


@pytest.mark.parametrize("radius", [10.0, 13.4, 25.0])
@pytest.mark.parametrize("seed", [21, 22])
def test_small_corners_of_a_large_pocket_are_found(radius, seed):
    """Beginning from large ones, all places on them are outliers."""
    true = Section((106.7, 76.8), 0.003, Rounded((91.4, 60.8), radius))
    grid = np.stack(np.indices((215, 155)), axis=-1).astype(float)
    found = fitted(chewed(true.signed_distance(grid) < 0, seed), opened)
    assert found is not None
    assert np.allclose(found.shape.half, true.shape.half, atol=0.5)
    assert abs(found.shape.radius - radius) < 2.5


@pytest.mark.parametrize("cut", ["disc with two ears", "angle", "triangle"])
def test_other_outlines_have_no_section(cut):
    rows, columns = np.indices(SHAPE)
    disc = (rows - 45) ** 2 + (columns - 50) ** 2 < 20**2
    shapes = {
        "disc with two ears": disc | ((np.abs(columns - 50) < 6) & (np.abs(rows - 45) < 32)),
        "angle": disc & ((rows > 45) | (columns > 50)),
        "triangle": (rows > 20) & (rows - 20 > 1.5 * np.abs(columns - 50)) & (rows < 80),
    }
    assert fitted(shapes[cut], opened) is None


def test_narrow_and_empty_outlines_have_no_section():
    assert fitted(np.zeros(SHAPE, bool), opened) is None
    assert fitted(raster(Section(CENTER, 0.0, Rounded((20.0, 1.5), 0.0))), lambda cells: cells) is None


@given(
    angle=st.floats(-3, 3),
    half=st.tuples(st.floats(4, 30), st.floats(4, 30)),
    share=st.floats(0, 1),
    at=st.tuples(st.floats(-60, 60), st.floats(-60, 60)),
)
def test_distance_outside_is_that_to_a_drawing_of_the_border(angle, half, share, at):
    radius = share * min(half)
    section = Section((0.0, 0.0), angle, Rounded(half, radius))
    inner = np.array(half) - radius
    steps, turn = np.linspace(-1, 1, 401)[:, None], np.linspace(0, 2 * np.pi, 721)
    ring = radius * np.column_stack([np.cos(turn), np.sin(turn)])
    lines = [np.array([a, b]) * inner + ring for a in (-1, 1) for b in (-1, 1)]
    lines += [np.hstack([steps * inner[0], np.full_like(steps, side * half[1])]) for side in (-1, 1)]
    lines += [np.hstack([np.full_like(steps, side * half[0]), steps * inner[1]]) for side in (-1, 1)]
    c, s = np.cos(angle), np.sin(angle)
    drawing = np.concatenate(lines) @ np.array([[c, s], [-s, c]])
    distance = section.signed_distance(np.array([at]))[0]
    assume(distance > 0)
    assert abs(np.linalg.norm(drawing - np.array(at), axis=1).min() - distance) < 0.1


@pytest.mark.parametrize(("name", "count"), PIECES)
def test_pieces_are_the_faces_of_a_wall(name, count):
    section = SECTIONS[name]
    places = section.border(2000)
    pieces, normals = section.pieces(places), section.gradient(places)
    away = ~section.near_corners(places, 0.6)  # a border is traced in steps of half a cell
    assert np.abs(section.signed_distance(places[away])).max() < 0.05
    assert len(np.unique(pieces)) == count
    curved = {"circle": 180.0, "slot": 180.0, "pocket": 91.0, "keyed": 180.0, "flatted": 180.0}
    for piece in np.unique(pieces):
        own = normals[(pieces == piece) & away]
        assert np.degrees(np.arccos(np.clip(own @ own.T, -1, 1))).max() <= curved.get(name, 1.0)


def test_border_lies_half_way_between_cells():
    cells = np.zeros((6, 7), bool)
    cells[2:4, 2:5] = True
    border = border_of(cells)
    assert len(border) == 10
    assert set(border[:, 0]) == {1.5, 2.0, 3.0, 3.5}
    assert set(border[:, 1]) == {1.5, 2.0, 3.0, 4.0, 4.5}


def prism_of(section: Section, depth: float = 0.2, flipped: bool = False) -> Prism:
    """A concavity below z = 0, or above z = -depth if flipped."""
    sign = -1.0 if flipped else 1.0
    origin = np.array([0.0, 0.0, -depth if flipped else 0.0])
    lattice = Lattice(
        origin, np.array([1.0, 0.0, 0.0]), np.array([0.0, sign, 0.0]), np.array([0.0, 0.0, sign]), PITCH, SHAPE
    )
    return Prism(lattice, raster(section), depth, True, 0.0)


def basis_of(prism: Prism) -> np.ndarray:
    return np.stack([prism.lattice.first, prism.lattice.second])


def placed(prism: Prism, cells: np.ndarray, depth: float | np.ndarray = 0.0) -> np.ndarray:
    """(N, 3) places of fractional cells (N, 2), below a prism's lattice."""
    below = np.broadcast_to(np.asarray(depth, float), len(cells))[:, None] * prism.lattice.normal
    return prism.lattice.origin + PITCH * (cells + 0.5) @ basis_of(prism) - below


def test_a_prism_with_a_section_has_straight_walls():
    section = SECTIONS["slot"]
    rough = prism_of(section)
    prism = replace(rough, section=fitted(rough.outline, opened))
    below = placed(prism, section.border(300), 0.1)
    exact = np.abs(prism.signed_distance(below, 0.0))
    assert exact.mean() < 0.5 * np.abs(rough.signed_distance(below, 0.0)).mean()
    assert exact.max() < 0.001


def test_surfels_are_put_on_the_piece_of_the_wall_that_they_lie_next_to():
    section = SECTIONS["slot"]
    prism = replace(prism_of(section), section=section)
    cells = section.border(400)
    rng = np.random.default_rng(3)
    xyz = placed(prism, cells, rng.uniform(0.02, 0.18, 400))
    normals = -section.gradient(cells) @ basis_of(prism)
    noisy = xyz + rng.normal(0, 0.001, (400, 1)) * normals
    found = Walls([prism], PITCH).under(noisy, normals)
    assert np.array_equal(found.piece, section.pieces(cells))
    assert np.abs(found.foot - xyz).max() < 2e-4
    assert np.einsum("nc,nc->n", found.normal, normals).min() > 0.9999
    # what faces another way, or lies below the floor, is not on it
    other = Walls([prism], PITCH).under(noisy, -normals)
    assert (other.piece == -1).all()
    assert np.array_equal(other.foot, noisy)
    assert (Walls([prism], PITCH).under(noisy - 0.3 * prism.lattice.normal, normals).piece == -1).all()


def around(prism: Prism, narrower: float, depth: float) -> tuple[np.ndarray, np.ndarray]:
    """(50, 3) places on a round hole's wall, `narrower` than its opening, and (50, 3) directions out of its axis."""
    turn = np.linspace(0, 2 * np.pi, 50, endpoint=False)
    out = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(50)])
    radius = PITCH * prism.section.shape.radius - narrower
    return placed(prism, np.array([CENTER]), depth) + radius * out, out


def test_the_wall_of_a_countersunk_hole_is_its_throat_not_its_rim():
    prism = replace(prism_of(SECTIONS["circle"]), section=SECTIONS["circle"], draft=1.0, sink=0.03)
    rim, out = around(prism, 0.015, 0.015)
    throat, _ = around(prism, 0.03, 0.1)
    leaning = (np.array([0, 0, 1.0]) - out) / np.sqrt(2)
    noisy = throat + 0.001 * out
    found = Walls([prism], PITCH).under(np.concatenate([rim, noisy]), np.concatenate([leaning, -out]))
    assert (found.piece[:50] == -1).all()
    assert np.array_equal(found.foot[:50], rim)
    assert len(np.unique(found.piece[50:])) == 1
    assert found.piece[50] >= 0
    assert np.allclose(found.foot[50:], throat, atol=1e-6)
    assert np.allclose(found.normal[50:], -out, atol=1e-6)


def test_the_wall_of_a_tapered_hole_leans():
    prism = replace(prism_of(SECTIONS["circle"]), section=SECTIONS["circle"], draft=0.25)
    places, out = around(prism, 0.025, 0.1)
    leaning = (0.25 * np.array([0, 0, 1.0]) - out) / np.sqrt(1 + 0.25**2)
    found = Walls([prism], PITCH).under(places, leaning)
    assert len(np.unique(found.piece)) == 1
    assert found.piece[0] >= 0
    assert np.allclose(found.foot, places, atol=1e-6)
    assert np.allclose(found.normal, leaning, atol=1e-6)


def test_both_ends_of_a_hole_get_one_wall():
    section = replace(SECTIONS["slot"], misfit=0.1, at_rim=True)
    near = replace(prism_of(section), section=section)
    # the far end's lattice is the mirror image: rows along x, columns along -y
    center = (CENTER[0], -1.0 - CENTER[1])
    mirrored = Section(center, -section.angle, Rounded((31.0, 9.4), 9.4), misfit=0.01)  # but told by cells
    far = replace(prism_of(section, flipped=True), section=mirrored)
    one, other = agreed([near, far])
    assert one.section == section
    assert np.allclose(other.section.shape.half, section.shape.half)
    assert np.allclose(other.section.center, center)
    exact = replace(mirrored, shape=section.shape)
    assert np.abs(exact.signed_distance(other.section.border(64))).max() < 0.05
    cells = section.border(100)
    xyz, normals = placed(near, cells, 0.1), -section.gradient(cells) @ basis_of(near)
    assert np.array_equal(Walls([one, other], PITCH).under(xyz, normals).piece, section.pieces(cells))
    swapped = Walls([other, one], PITCH).under(xyz, normals).piece  # whichever end comes first
    assert len(np.unique(np.column_stack([swapped, section.pieces(cells)]), axis=0)) == 4


def far_end(prism: Prism, outline: np.ndarray) -> Prism:
    """The other end of a hole with an outline (R, C) on the near end's lattice: columns run the other way."""
    lattice, (_, columns) = prism.lattice, SHAPE
    origin = lattice.origin + columns * PITCH * lattice.second - prism.depth * lattice.normal
    flipped = replace(lattice, origin=origin, second=-lattice.second, normal=-lattice.normal)
    return replace(prism, lattice=flipped, outline=outline[:, ::-1], section=None)


def test_an_end_that_no_rim_tells_goes_along_the_walls_of_the_other():
    section = replace(SECTIONS["slot"], at_rim=True)
    near = replace(prism_of(section), section=section)
    far = far_end(near, chewed(near.outline, 5))
    one, other = agreed([near, far])
    assert one.section == section
    xyz = placed(near, section.border(100), 0.1)
    assert np.abs(other.lateral(other.lattice.coordinates(xyz)[0])).max() < 0.01 * PITCH
    # not if cells alone have told the near one, nor if the far one's outline is another
    assert agreed([replace(near, section=replace(section, at_rim=False)), far])[1].section is None
    assert agreed([near, far_end(near, raster(section.grown(4.0)))])[1].section is None


def test_a_recess_about_a_hub_does_not_get_the_walls_of_the_hubs_bore():
    """The bore is open wherever the recess is looked into, so that it borders the recess's outline, too."""
    bore = Section(CENTER, 0.0, Rounded((8.0, 8.0), 8.0), at_rim=True)
    near = replace(prism_of(bore), section=bore)
    recess = raster(bore.grown(25.0)) & ~raster(bore.grown(6.0)) | raster(bore)
    assert agreed([near, replace(near, outline=recess, section=None)])[1].section is None
    assert agreed([near, far_end(near, recess)])[1].section is None


def rim_seen(section: Section, height: float, views: int = 12) -> tuple[Stack, np.ndarray]:
    """What cameras around an opening show on a lattice that lies `height` cells below the plane; their centres.

    The plane is bright. Below it is a floor with stripes, which parallax moves from view to view.
    """
    prism = prism_of(section)
    lattice, turn = prism.lattice, 2 * np.pi * np.arange(views) / views
    centers = placed(prism, np.array([CENTER])) + 2 * np.column_stack([np.cos(turn), np.sin(turn), np.ones(views)])
    grey = []
    for center in centers:
        sight = center - lattice.centers()
        lean = np.stack([sight @ lattice.first, sight @ lattice.second], axis=-1) / (sight @ lattice.normal)[..., None]
        inside = section.signed_distance(GRID + height * lean)  # where the ray through a cell meets the plane
        below = 120 + 25 * np.sin((GRID - 20 * lean)[..., 0] / 4)
        grey.append(below + (200 - below) * np.clip(inside + 0.5, 0, 1))
    levels = np.array(grey, np.float32)
    return Stack(lattice, np.ones(SHAPE, bool), np.zeros(levels.shape, np.uint8), levels, np.zeros(SHAPE)), centers


@pytest.mark.parametrize("height", [0.0, 0.7, -0.7])
@pytest.mark.parametrize("name", ["circle", "slot", "pocket", "hexagon", "keyed", "flatted"])
def test_the_rim_is_found_where_all_views_show_it(name, height):
    true = SECTIONS[name]
    stack, centers = rim_seen(true, height)
    rough = replace(true.grown(-0.6), center=(CENTER[0] + 0.4, CENTER[1] - 0.3))
    if isinstance(rough.shape, Rounded) and name == "slot":  # its ends are seen by few views
        rough = replace(rough, shape=Rounded((rough.shape.half[0] - 1.5, rough.shape.half[1]), rough.shape.radius))
    found = at_rim(rough, stack, centers, 1.5)
    assert found is not None
    assert found.at_rim
    assert type(found.shape) is type(true.shape)
    places = true.border(200)
    assert np.abs(found.signed_distance(places[~true.near_corners(places, 0.6)])).max() < 0.25
    if isinstance(true.shape, Rounded):
        assert abs(found.shape.radius - true.shape.radius) < 0.6


def test_without_a_rim_the_cells_count():
    section = SECTIONS["slot"]
    stack, centers = rim_seen(section, 0.0)
    for grey in (90.0, np.nan):  # the plane is as dark as what lies below; no view sees it
        blind = replace(stack, grey=np.full_like(stack.grey, grey))
        assert at_rim(section, blind, centers, 1.5) == section
        assert at_rim(replace(section, misfit=0.3), blind, centers, 1.5) is None


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_a_section_that_reaches_into_walls_moves_only_where_its_rim_can_be_seen(turn):
    true = Section(CENTER, turn, Rounded((15.0, 12.0), 0.0))
    stack, centers = rim_seen(true, 0.3)

    def covered(at):  # in the walls of a corner
        local = (at - np.array(CENTER)) @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        return (local > np.array([8.0, 6.0])).any(axis=1)

    stack = replace(stack, grey=np.where(covered(GRID.reshape(-1, 2)).reshape(SHAPE), np.nan, stack.grey))
    way = np.array([np.cos(turn), np.sin(turn)])
    rough = replace(true, center=tuple(CENTER - 0.75 * way), shape=Rounded((15.75, 12.0), 0.0))  # one side 1.5 off
    found = rim_of(rough, stack, centers, 1.5, 0.3, covered)
    assert found is not None
    assert found.told > 0.6
    places = true.border(200)
    assert np.abs(found.section.signed_distance(places[~true.near_corners(places, 1.5)])).max() < 0.25


def test_a_rim_of_another_shape_is_no_section():
    stack, centers = rim_seen(Section(CENTER, 0.3, Rounded((16.0, 16.0), 6.0)), 0.0)
    assert at_rim(Section(CENTER, 0.0, Polygon(8, 16.5)), stack, centers, 1.5) is None


def test_a_slot_of_cells_that_looks_keyed_is_a_slot_if_the_rim_says_so():
    """A keyway as wide as its bore: a slot with one square end, to the cells."""
    slot = Section(CENTER, 0.4, Rounded((30.5, 7.2), 7.2))
    way = np.array([np.cos(0.4), np.sin(0.4)])
    drawn = Section(tuple(CENTER - 23.3 * way), 0.4, Keyed(7.2, 7.1, 53.2), misfit=0.16)
    stack, centers = rim_seen(slot, 0.0)
    found = at_rim(drawn, stack, centers, 1.5)
    assert found is not None
    assert isinstance(found.shape, Rounded)
    assert np.abs(found.signed_distance(slot.border(200))).max() < 0.25


def test_a_small_octagon_of_cells_is_a_bore_if_the_rim_says_so_and_else_nothing():
    bore = Section(CENTER, 0.0, Rounded((7.2, 7.2), 7.2))
    drawn = Section(CENTER, 0.2, Polygon(8, 7.0), misfit=0.1)
    stack, centers = rim_seen(bore, 0.0)
    found = at_rim(drawn, stack, centers, 1.5)
    assert found is not None
    assert isinstance(found.shape, Rounded)
    assert abs(found.shape.radius - 7.2) < 0.25
    blind = replace(stack, grey=np.full_like(stack.grey, 90.0))
    assert at_rim(drawn, blind, centers, 1.5) is None
    assert at_rim(replace(SECTIONS["hexagon"], misfit=0.1), blind, centers, 1.5) is not None


def test_a_round_opening_of_which_parts_look_like_the_face_is_the_circle_that_its_rim_tells(monkeypatch):
    """In a dome, two pieces of a hole's outline are missing."""
    bore = Section(CENTER, 0.0, Rounded((14.2, 14.2), 14.2))
    stack, centers = rim_seen(bore, 0.0)
    away = GRID - np.array(CENTER)
    bitten = raster(bore) & (away @ [0.8, 0.6] < 10.5) & (away @ [-0.6, 0.8] < 9.5) & (away @ [-0.9, -0.44] < 11.5)
    views = SimpleNamespace(cameras=SimpleNamespace(centers=centers))
    images = SimpleNamespace(views=views, tolerance=1.5)
    monkeypatch.setattr(walls, "rectify", lambda *_: stack)
    prism = replace(prism_of(bore), outline=bitten)
    monkeypatch.setattr(walls, "fitted", lambda *_: replace(SECTIONS["pocket"], misfit=0.3))  # so it seems to the cells
    found = walls.drawn(images, None, None, prism, 0.0)
    assert found.section is not None
    assert np.abs(found.section.signed_distance(bore.border(100))).max() < 0.25
    blind = replace(stack, grey=np.full_like(stack.grey, 90.0))
    monkeypatch.setattr(walls, "rectify", lambda *_: blind)
    assert walls.drawn(images, None, None, prism, 0.0).section is None


@pytest.mark.parametrize(("told", "alike"), [(True, True), (False, False)])
def test_a_round_end_that_cells_draw_as_a_square_is_round_if_views_show_the_others_rim(told, alike):
    bore = Section(CENTER, 0.0, Rounded((8.4, 8.4), 8.4), misfit=0.05, at_rim=told)
    near = replace(prism_of(bore), section=bore)
    square = Section((CENTER[0] + 0.5, -1.0 - CENTER[1] - 0.6), 0.0, Rounded((7.4, 7.4), 0.0), misfit=0.1)
    far = replace(prism_of(square, flipped=True), section=square)
    one, other = agreed([near, far])
    assert one.section == bore
    assert (other.section.shape.radius == pytest.approx(8.4)) == alike


def test_the_ragged_mouth_of_a_hole_gets_the_walls_of_the_mouth_that_views_show():
    bore = Section(CENTER, 0.0, Rounded((11.4, 11.4), 11.4), at_rim=True)
    near = replace(prism_of(bore), section=bore)
    turn = np.arctan2(*np.moveaxis(GRID - np.array(CENTER), -1, 0))
    ragged = bore.signed_distance(GRID) < 1.8 * np.sin(5 * turn)
    assert bore.signed_distance(np.argwhere(ragged).astype(float)).max() > 1.2
    ragged |= raster(Section((CENTER[0] + 9.5, CENTER[1]), 0.0, Rounded((5.0, 5.0), 5.0)))  # and one corner too much
    assert agreed([near, far_end(near, ragged)])[1].section is not None
    blind = replace(far_end(near, ragged), through=False)  # it may be something else
    assert agreed([near, blind])[1].section is None
