"""Skins over faces that 3D edges tell go; pads with edges of their own stay, and so does what no edges are around."""

import numpy as np
import pytest
from blocks import BLOCK, GRID
from brepgaussian.splatting.concave import Images, Plane, skins, without_skins
from brepgaussian.splatting.concave.prism import Lattice, plane_axes
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.evidence.edges import EdgeCloud
from build123d import Align, Box, Pos
from rendered import rendered

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
SIDE, WIDE, FLOOR = 40.0, 16.0, 0.5  # of a block with a slot along y
LEFT, RIGHT = 0.5 - WIDE / SIDE / 2, 0.5 + WIDE / SIDE / 2
FACES = [Plane(np.array([0, 0, 1.0]), 1.0), Plane(np.array([1.0, 0, 0]), 1.0), Plane(np.array([0, 1.0, 0]), 1.0)]


def box(*corners):
    """Signed distance to a box, positive inside."""
    low, high = np.array(corners)
    return np.minimum(GRID - low, high - GRID).min(axis=-1)


def lines(*ends):
    """Edges between pairs of points, a point every .002."""
    points, directions = [], []
    for start, end in np.array(ends, float):
        count = int(np.linalg.norm(end - start) / 0.002)
        points.append(start + np.linspace(0, 1, count)[:, None] * (end - start))
        directions.append(np.tile((end - start) / np.linalg.norm(end - start), (count, 1)))
    return cloud(np.concatenate(points), np.concatenate(directions))


def cloud(points, directions):
    return EdgeCloud(points.astype(np.float32), directions.astype(np.float32), np.full(len(points), 9, np.int16))


def outline(x0, y0, x1, y1, z):
    """The four sides of a rectangle at one height."""
    corners = [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]
    return list(zip(corners, corners[1:] + corners[:1], strict=True))


SLOT = [
    *(((x, y, FLOOR), (x, y, 1.0)) for x in (LEFT, RIGHT) for y in (0.0, 1.0)),
    *(((LEFT, y, FLOOR), (RIGHT, y, FLOOR)) for y in (0.0, 1.0)),
    *(((x, 0.0, 1.0), (x, 1.0, 1.0)) for x in (LEFT, RIGHT)),
    *(((x, 0.0, FLOOR), (x, 1.0, FLOOR)) for x in (LEFT, RIGHT)),
]


def slotted(*skins):
    """A block with a slot, and what a hull has left in that."""
    slot = box((LEFT, -1, FLOOR), (RIGHT, 2, 2))
    left = np.max([box(*skin) for skin in skins], axis=0) if skins else np.full(slot.shape, -1.0)
    return BLOCK.with_field(np.minimum(BLOCK.field, np.maximum(-slot, left)).astype(np.float32))


@pytest.fixture(scope="module")
def images(tmp_path_factory):
    part = Box(SIDE, SIDE, SIDE, align=LOW) - Pos(0, 0, SIDE * FLOOR) * Box(WIDE, 2 * SIDE, SIDE, align=LOW)
    return Images.of(rendered(tmp_path_factory.mktemp("slot"), part, 40)[0])


def fields(hull: Volume, places):
    return hull.scene().signed_distance(np.array(places))


def test_planes_are_told_by_edges_among_others():
    rng = np.random.default_rng(3)
    heights = [0.2, 0.43, 0.9]
    flat = np.column_stack([rng.random((600, 2)), np.repeat(heights, 200) + rng.normal(0, 0.0007, 600)])
    other = rng.random((800, 3))
    turned = rng.normal(size=(800, 3))
    along = np.column_stack([rng.normal(size=(600, 2)), np.zeros(600)])
    directions = np.concatenate([along, turned])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    found = list(skins._planes(cloud(np.concatenate([flat, other]), directions), np.array([0, 0, 1.0]), BLOCK))
    np.testing.assert_allclose(sorted(plane.offset for plane, _ in found), heights, atol=3e-4)
    assert all(sure for _, sure in found)


def test_few_edges_of_a_nook_tell_a_plane_beside_the_many_of_rims():
    rng = np.random.default_rng(5)
    heights = np.repeat([0.01, 0.99, 0.35], [9000, 9000, 100])
    points = np.column_stack([rng.random((18100, 2)), heights + rng.normal(0, 0.0007, 18100)])
    along = np.column_stack([rng.normal(size=(18100, 2)), np.zeros(18100)])
    directions = along / np.linalg.norm(along, axis=1, keepdims=True)
    found = {
        round(plane.offset, 2): sure
        for plane, sure in skins._planes(cloud(points, directions), np.array([0, 0, 1.0]), BLOCK)
    }
    assert found == {0.01: True, 0.99: True, 0.35: False}


def test_skins_below_what_no_views_agree_about_are_those_that_halve_it():
    good = [skins._is_better(said) for said in ((2.0, 0.8, 500), (2.0, 1.1, 500), (0.9, 0.55, 500), (2.0, 0.8, 5))]
    assert good == [True, False, True, False]


def test_directions_are_those_of_faces_and_square_to_two():
    slope = np.array([0.6, 0, 0.8])
    up, along = np.array([0, 0, 1.0]), np.array([0, 1.0, 0])
    ways = skins._ways([Plane(normal, 0.0) for normal in (up, -up, along, slope)])
    expected = np.array([[0, 0, 1], [0, 1, 0], slope, [1, 0, 0], [-0.8, 0, 0.6]])
    assert len(ways) == len(expected)
    assert (np.abs(expected @ np.array(ways).T).max(axis=1) > 0.9999).all()


def test_skins_on_a_wall_and_a_floor_go(images):
    wall = (LEFT - 0.1, 0.15, FLOOR - 0.1), (LEFT + 0.04, 0.85, 0.8)
    floor = (LEFT + 0.1, 0.2, FLOOR - 0.1), (RIGHT - 0.1, 0.8, FLOOR + 0.03)
    hull = slotted(wall, floor)
    bare = without_skins(images, hull, lines(*SLOT), FACES)
    in_skins = [(LEFT + 0.02, 0.5, 0.65), (0.5, 0.5, FLOOR + 0.015)]
    assert (fields(hull, in_skins) < 0).all()
    assert (fields(bare, in_skins) > 0).all()
    beside = [(LEFT - 0.012, 0.5, 0.65), (0.5, 0.5, FLOOR - 0.012), (RIGHT + 0.012, 0.5, 0.65)]
    assert (fields(bare, beside) < 0).all()


def test_without_edges_around_it_a_skin_stays(images):
    hull = slotted(((LEFT - 0.1, 0.15, FLOOR - 0.1), (LEFT + 0.04, 0.85, 0.8)))
    other = lines(*[ends for ends in SLOT if ends[0][0] == ends[1][0] == RIGHT])
    assert without_skins(images, hull, other, FACES) is hull
    none = cloud(np.zeros((0, 3)), np.zeros((0, 3)))
    assert without_skins(images, hull, none, FACES) is hull


def test_what_contours_need_or_views_like_stays(images, monkeypatch):
    hull = slotted(((LEFT - 0.1, 0.15, FLOOR - 0.1), (LEFT + 0.04, 0.85, 0.8)))
    for said in ((0.2, 0.4, 100), (1.3, 0.9, 100), (1.3, 0.7, 100), (0.3, 0.0, 10)):
        monkeypatch.setattr(skins, "disagreements", lambda *_, said=said: said)
        assert without_skins(images, hull, lines(*SLOT), FACES) is hull
    monkeypatch.setattr(skins, "disagreements", lambda *_: (0.3, 0.1, 100))
    assert without_skins(images, hull, lines(*SLOT), FACES) is not hull
    monkeypatch.setattr(skins, "lost_share", lambda *_: 0.05)
    assert without_skins(images, hull, lines(*SLOT), FACES) is hull


@pytest.mark.parametrize("edged", [True, False])
def test_a_pad_with_edges_of_its_own_is_no_skin(monkeypatch, edged):
    """A low step on a face: its top is as parallel to that as it is, and edges lie around it."""
    field = np.maximum(np.minimum(BLOCK.field, 0.9 - GRID[..., 2]), box((0.3, 0.3, 0.5), (0.7, 0.7, 0.94)))
    hull = BLOCK.with_field(field.astype(np.float32))
    around = outline(0, 0, 1, 1, 0.9) + outline(0.3, 0.3, 0.7, 0.7, 0.9)
    edges = lines(*around, *(outline(0.3, 0.3, 0.7, 0.7, 0.94) if edged else []))
    cut = []
    monkeypatch.setattr(skins, "_cut", lambda seen, lattice, skin, high: cut.append(skin) or seen)
    monkeypatch.setattr(skins, "rays_at_object", lambda images: None)
    monkeypatch.setattr(skins, "lattice_of", lambda images, hull, plane, most: _lattice(plane))
    without_skins(None, hull, edges, FACES)
    assert bool(cut) != edged


def _lattice(plane):
    first, second = plane_axes(plane.normal)
    corners = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
    low = np.array([(corners @ first).min(), (corners @ second).min()])
    origin = low[0] * first + low[1] * second + plane.offset * plane.normal
    return Lattice(origin, first, second, plane.normal, 1 / 90, (90, 90))
