"""Corners between ribs: a hull spans the ribs' edges with a lid; under it there are two floors."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.splatting.concave import Images, cleared, corners, rooms
from brepgaussian.splatting.concave.corners import Corner
from brepgaussian.splatting.concave.planes import Plane as Face
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.hull import carve
from build123d import Align, Box, Plane, Polyline, Pos, extrude, make_face
from rendered import rendered


def check_opened(views, truth, longest, inside, beyond):
    """Places (N, 3) inside a corner are closed in the hull that silhouettes leave; in the opened one they are free,
    and those beyond its floors are not."""
    distance = [
        Scene(hull.vertices, hull.triangles).signed_distance(truth.mesh_vertices.min(axis=0) + points / longest)
        for hull in (carve(views, 96, 1, False)[0], carve(views, 96, 1, True)[0])
        for points in (inside, beyond)
    ]
    assert (distance[0] < 0).all()  # silhouettes do not show it
    assert (distance[2] > 0).all()
    assert (distance[3] < 0).all()


@pytest.mark.parametrize("thick", [5, 12])
def test_the_corner_between_two_webs_is_opened_down_to_both_floors(tmp_path, thick):
    low = (Align.MIN, Align.MIN, Align.MIN)
    web = extrude(Plane.XZ * make_face(Polyline((5, 5), (28, 5), (5, 28), close=True)), amount=-thick)
    body = Box(34, 50, 6, align=low) + Box(6, 50, 34, align=low) + web + Pos(0, 50 - thick, 0) * web
    views, truth = rendered(tmp_path, body)
    near = 1.5  # of each floor, and of a web
    inside = np.array([[6 + near, 25, 15], [15, 25, 6 + near], [9, thick + near, 9]])
    beyond = np.array([[6 - near, 25, 15], [15, 25, 6 - near], [9, thick - near, 9]])
    check_opened(views, truth, 50, inside, beyond)


def test_corners_beside_one_web_are_opened_down_to_three_floors(tmp_path):
    """The lid spans the web's edge and the far ends of wall and base; no edge of two floors lies along it."""
    low = (Align.MIN, Align.MIN, Align.MIN)
    web = extrude(Plane.XZ * make_face(Polyline((5, 5), (28, 5), (5, 28), close=True)), amount=-6)
    body = Box(42, 40, 6, align=low) + Box(6, 40, 40, align=low) + Pos(0, 17, 0) * web
    views, truth = rendered(tmp_path, body)
    near = 1.5  # of each floor
    inside = np.array([[6 + near, y, z] for y in (17 - near, 23 + near) for z in (6 + near, 12)])
    beyond = np.array([[6 - near, 10, 15], [15, 10, 6 - near], [9, 17 + near, 9], [9, 23 - near, 9]])
    check_opened(views, truth, 42, inside, beyond)


def test_a_lid_over_three_floors_and_one_over_two():
    """The edge of two floors has to lie along the lid, that of three not."""
    floors = [corners._Floor(np.eye(3)[k], np.full(3, 0.5)) for k in range(3)]
    unseen = [replace(floor, seen=None) for floor in floors]
    slanted = SimpleNamespace(normal=np.ones(3) / np.sqrt(3), offset=1.0)
    along = SimpleNamespace(normal=np.array([1, 1, 0]) / np.sqrt(2), offset=1.0)
    assert corners._triples(slanted, floors) == [tuple(floors)]
    assert corners._triples(slanted, unseen) == [tuple(unseen)]
    assert corners._triples(along, floors) == []
    assert corners._pairs(slanted, floors) == []
    assert corners._pairs(along, floors) == [tuple(floors[:2])]
    cells = 0.6 + 0.2 * np.eye(3)
    started = list(corners._starts(slanted, [*floors[:2], unseen[2]], cells))
    assert len({c.offsets[2] for c in started}) == len(started) == 6
    assert all(c.floors == len(c.normals) == 3 and c.offsets[0] == c.offsets[1] == 0.5 for c in started)
    between = next(corners._starts(along, floors[:2], cells))
    assert (between.floors, len(between.normals)) == (2, 4)


@pytest.mark.parametrize(
    ("lean", "seen", "paired"), [(8, True, True), (8, False, False), (20, False, True), (3, True, False)]
)
def test_a_lid_may_be_nearly_parallel_to_a_floor_that_is_seen(lean, seen, paired):
    """What other cuts have left of a room is flat, and over its floor; of one that is not seen that tells nothing."""
    floors = [corners._Floor(np.eye(3)[k], np.full(3, 0.5) if seen else None) for k in (0, 2)]
    lid = SimpleNamespace(normal=np.array([np.sin(np.radians(lean)), 0, np.cos(np.radians(lean))]), offset=1.0)
    assert corners._pairs(lid, floors) == ([tuple(floors)] if paired else [])


def test_floors_lie_on_known_faces_that_are_near():
    """Rays tell a wall less exactly than the masks of a face; what is farther off, or leans, is another one."""
    lid = np.array([1.0, 0, 1]) / np.sqrt(2)
    corner = Corner(
        (lid, 1.0), np.array([[1.0, 0, 0], [0, 0, 1], [0, 1, 0], [0, -1, 0]]), np.array([0.4, 0.3, 0.2, -0.7])
    )
    turned = np.array([np.cos(0.01), np.sin(0.01), 0])
    planes = [Face(turned, 0.41), Face(turned, 0.43), Face(np.eye(3)[2], 0.35), Face(np.eye(3)[1], 0.201)]
    found = cleared.on_known(corner, planes, 0.02)
    np.testing.assert_array_equal(found.offsets, [0.41, 0.3, 0.2, -0.7])
    np.testing.assert_array_equal(found.normals, [turned, *corner.normals[1:]])


@pytest.mark.parametrize("walls", [(), (2,), (3,), (2, 3)])
def test_a_corner_goes_on_past_ends_at_which_views_see_no_rib(monkeypatch, walls):
    normals = np.array([[1.0, 0, 0], [0, 0, 1], [0, 1, 0], [0, -1, 0]])
    corner = Corner((normals[1], 1.0), normals, np.array([0.4, 0.3, 0.4, -0.6]))
    full = Volume(np.full((41, 41, 41), 0.1, np.float32), np.zeros(3), 1 / 40)
    y = np.arange(41)[None, :, None] / 40
    beyond = {2: y < 0.4, 3: y > 0.6}

    def agree(_, before, after, *__):
        return not any(((after.field < before.field) & beyond[k]).any() for k in walls)

    monkeypatch.setattr(Volume, "scene", lambda self: self)
    monkeypatch.setattr(cleared, "_agreeable", agree)
    opened = corner.cut_out(full, 0.0)
    longer, hull, scene = cleared._without_ends(None, opened, opened, corner)
    assert scene is hull
    assert [k for k in (2, 3) if np.isfinite(longer.offsets[k])] == list(walls)
    empty = (hull.field < 0).any(axis=(0, 2))
    assert (empty[:16].any(), empty[25:].any()) == (2 not in walls, 3 not in walls)
    assert empty[17:24].all()


@pytest.mark.parametrize("found", [0, 1, 2, 9])
def test_corners_are_looked_for_again_in_what_one_has_left(monkeypatch, found):
    hulls = [object() for _ in range(10)]
    monkeypatch.setattr(corners, "_open_corners", lambda _, hull, __: hulls[min(hulls.index(hull) + 1, found)])
    assert corners.open_corners(None, hulls[0], []) is hulls[min(found, corners._ROUNDS)]


def test_directions_are_told_once():
    turned = np.array([np.sin(0.03), 0, np.cos(0.03)])
    kept = corners._distinct([np.eye(3)[2], turned, -turned, np.eye(3)[0]])
    np.testing.assert_array_equal(kept, [np.eye(3)[2], -turned, np.eye(3)[0]])


def test_a_long_strip_of_one_cell_is_no_lid(tmp_path, monkeypatch):
    """Along a straight edge, triangles that marching cubes cut off it are as large as a lid, and a cell wide."""
    views, _ = rendered(tmp_path, Box(40, 24, 16))
    lattice_over = corners.lattice_over
    monkeypatch.setattr(corners, "lattice_over", lambda *at: replace(lattice_over(*at), shape=(1, 60)))
    inside = 0.3 - np.abs(np.indices((41, 41, 41)) / 40 - 0.5).max(axis=0)
    volume = Volume(inside.astype(np.float32), np.zeros(3), 1 / 40)
    assert corners.open_corners(Images.of(views, 0.0), volume, []) is volume


def test_a_corner_is_cut_out_of_what_lies_over_its_floors_and_under_its_lid():
    slanted = np.array([1.0, 0, 1]) / np.sqrt(2)
    normals = np.array([[1.0, 0, 0], [0, 0, 1], [0, 1, 0], [0, -1, 0]])
    corner = Corner((slanted, 1.0), normals, np.array([0.4, 0.3, 0.2, -0.7]))
    spacing = 1 / 40
    full = Volume(np.full((41, 41, 41), 0.1, np.float32), np.zeros(3), spacing)
    x, y, z = np.stack(np.meshgrid(*[spacing * np.arange(41)] * 3, indexing="ij"))
    under = (x + z) / np.sqrt(2) < 1.0 + spacing
    inside = (x > 0.4) & (z > 0.3) & (y > 0.2) & (y < 0.7)
    left = corner.cut_out(full, spacing)
    assert np.array_equal((left.field < 0)[1:-1, 1:-1, 1:-1], (under & inside)[1:-1, 1:-1, 1:-1])
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    assert np.array_equal(corner.contains(points), inside.ravel())


@pytest.mark.parametrize("wall", [0.62, 0.7, 0.8])
def test_an_end_is_moved_no_farther_than_rays_tell(monkeypatch, wall):
    """Rays tell an end that is nearer than the wall; of one that is in it, or past it, they tell nothing."""
    normals = np.array([[1.0, 0, 0], [0, 0, 1], [0, 1, 0], [0, -1, 0]])
    first = Corner((normals[1], 1.0), normals, np.array([0.4, 0.3, -0.2, -0.6]))
    moved = replace(first, offsets=np.array([0.4, 0.3, -0.2, -1.0]))
    sought = object.__new__(rooms.Sought)
    sought.rays = None
    monkeypatch.setattr(rooms.Sought, "costs", lambda _, corner: -corner.offsets[3])
    monkeypatch.setattr(rooms, "units_of", lambda _: None)
    monkeypatch.setattr(rooms, "advantage", lambda _, nearer, best: 2 * rooms.SURE * (nearer < min(wall, best)))
    found = sought.shortened(moved, first)
    assert wall <= -found.offsets[3] <= wall + 0.05 + 1e-9  # an eighth of the way
    np.testing.assert_array_equal(found.offsets[:3], first.offsets[:3])


@pytest.mark.parametrize(("reach", "good"), [(0.5, True), (2.0, False)])
def test_views_judge_all_that_a_corner_cuts_not_its_lid_only(tmp_path, monkeypatch, reach, good):
    """Of a step filled up, a corner may take the filling, not the face at the step's end as well."""
    low = (Align.MIN, Align.MIN, Align.MIN)
    views, truth = rendered(tmp_path, Box(40, 24, 20, align=low) - Pos(0, 0, 10) * Box(20, 24, 10, align=low))
    images = Images.of(views, 0.0)
    spacing = 1 / 80
    lowest = truth.mesh_vertices.min(axis=0)
    grid = np.stack(np.meshgrid(*[spacing * np.arange(81)] * 3, indexing="ij"), axis=-1)
    half = np.array([0.5, 0.3, 0.25])
    full = Volume((half - np.abs(grid - lowest - half)).min(axis=-1).astype(np.float32), np.zeros(3), spacing)
    normals = np.array([[-1.0, 0, 0], [0, 0, 1], [0, 1, 0], [0, -1, 0]])
    room = Corner((np.array([0, 0, 1.0]), lowest[2] + 0.5), normals, [-(lowest[0] + reach), lowest[2] + 0.25, -1, -1])
    monkeypatch.setattr(corners, "_measured", lambda *_: room)
    monkeypatch.setattr(corners, "_wide_openings", lambda stack, _: [stack.domain])
    monkeypatch.setattr(corners, "_pairs", lambda *_: [()])
    monkeypatch.setattr(corners, "_starts", lambda *_: [])
    opened = corners.open_corners(images, full, [])
    assert (opened is not full) == good
