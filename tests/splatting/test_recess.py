"""Recesses that open at a face and at its edge, down to where views agree; and columns that end in a slope."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.splatting.concave import Images, recess, sweep
from brepgaussian.splatting.concave.agreement import rays_near
from brepgaussian.splatting.concave.gaps import gaps
from brepgaussian.splatting.concave.prism import Lattice, Prism
from brepgaussian.splatting.concave.recess import open_recesses
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.hull import hull_field, silhouette_distance
from build123d import Align, Box, Cylinder, Pos, Rot
from rendered import rendered

SPACING = 1 / 100
X, Y, Z = np.moveaxis(np.stack(np.meshgrid(*[SPACING * np.arange(101)] * 3, indexing="ij"), axis=-1), -1, 0)
BLOCK = np.minimum.reduce([0.4 - np.abs(X - 0.5), 0.3 - np.abs(Y - 0.5), 0.3 - np.abs(Z - 0.5)])
TOP, BOTTOM = 0.8, 0.2
LOW = (Align.CENTER, Align.CENTER, Align.MIN)
SHAFT = Prism(Lattice(np.array([0.4, 0.4, TOP]), *np.eye(3), 0.01, (20, 20)), np.ones((20, 20), bool), 0.6, False, 0)


def solid(*cut):
    return Volume(np.minimum.reduce([BLOCK, *(-c for c in cut)]).astype(np.float32), np.zeros(3), SPACING)


def face_at(height, up=1.0, without=None):
    """The block's face across z at a height, but for some of its cells."""
    lattice = Lattice(np.array([0.1, 0.5 - 0.3 * up, height]), *(np.eye(3) * [[1.0], [up], [up]]), 0.01, (80, 60))
    centers = lattice.centers()
    outline = np.ones((80, 60), bool)
    return lattice, outline if without is None else outline & ~without(centers[..., 0], centers[..., 1])


def slot(depth, rise=0.0):
    """Of a slot in the block's top, .2 wide, open at x = .1, as long as .3; its far end and its floor rise inwards."""
    floor = TOP - depth + rise * np.maximum(X - 0.1, 0)
    return np.minimum.reduce([0.1 - np.abs(Y - 0.5), 0.4 - X, Z - floor])


def within_slot(x, y):
    return (np.abs(y - 0.5) < 0.1) & (x < 0.4)


def test_the_section_of_a_recess_is_what_is_empty_at_a_face_and_full_below():
    face = face_at(TOP, without=within_slot)
    ((prism, voxels),) = recess._sections(solid(slot(0.3, rise=0.8)), face, [face])
    assert prism.area == pytest.approx(0.2 * 0.3, rel=0.15)
    assert prism.depth > 0.55
    np.testing.assert_allclose(prism.lattice.centers()[prism.outline].mean(axis=0), [0.25, 0.5, TOP], atol=0.02)
    assert voxels > 1000


@pytest.mark.parametrize("beside", ["a boss", "a step"])
def test_what_lies_beside_a_boss_or_before_a_wall_is_no_recess(beside):
    around = np.hypot(X - 0.5, Y - 0.5) - 0.12 if beside == "a boss" else 0.45 - X
    face = face_at(TOP, without=lambda x, y: (np.hypot(x - 0.5, y - 0.5) > 0.12) if beside == "a boss" else x < 0.45)
    assert not list(recess._sections(solid(np.minimum(around, Z - 0.6)), face, [face]))


def test_a_recess_ends_above_a_face_that_stands_in_it():
    mouth = face_at(TOP, without=within_slot)
    floor = face_at(0.6, without=lambda x, y: ~within_slot(x, y))
    ((prism, _),) = recess._sections(solid(slot(0.3, rise=0.8)), mouth, [mouth, floor])
    assert prism.depth == pytest.approx(0.2, abs=1e-6)


def across(depth):
    """Of a groove all across the block's top, .1 wide, with a hole in its middle; its floor rises inwards."""
    floor = np.minimum(TOP - depth + 0.6 * np.minimum(X - 0.1, 0.9 - X), TOP - 0.01)
    groove = np.minimum(0.05 - np.abs(Y - 0.5), Z - floor)
    return np.maximum(groove, 0.12 - np.hypot(X - 0.5, Y - 0.5))


def beside_groove(side):
    """The block's top on one side of that groove, and of the hole."""
    return face_at(TOP, without=lambda x, y: ((y - 0.5) * side < 0.05) | (np.hypot(x - 0.5, y - 0.5) < 0.12))


@pytest.mark.parametrize("rib", [False, True])
def test_faces_of_one_plane_leave_the_groove_between_them(rib):
    faces = [beside_groove(side) for side in (1, -1)]
    hull = solid(across(0.1))
    if rib:
        hull = hull.with_field(np.maximum(hull.field, np.minimum(0.04 - np.abs(Y - 0.5), 0.1 - np.abs(Z - TOP))))
    found = list(gaps(hull, faces[0], faces))
    assert len(found) == (not rib)
    for gap in found:
        x, y, height = np.moveaxis(gap.lattice.centers()[gap.outline], -1, 0)
        assert gap.area == pytest.approx(0.1 * (0.8 - 0.24), rel=0.1)  # clear of the hole
        assert np.quantile(np.abs(y - 0.5), 0.9) < 0.06  # but around the hole
        assert [x.min(), x.max()] == pytest.approx([0.1, 0.9], abs=0.02)
        assert height == pytest.approx(TOP)
        assert gap.depth == pytest.approx(TOP - BOTTOM, abs=0.02)
    assert not list(gaps(hull, face_at(BOTTOM, -1.0), [face_at(BOTTOM, -1.0)]))  # nothing lies beside it
    assert not list(gaps(hull, faces[0], faces[:1]))  # nor between one face and itself


def test_a_groove_across_a_round_plate_is_carved_to_its_floor(tmp_path):
    """No face lies at its ends, and no camera looks along it."""
    plate = Cylinder(30, 12, align=LOW) - Cylinder(12, 50) - Rot(0, 0, 20) * Pos(0, 0, 8) * Box(80, 6, 10, align=LOW)
    views, truth = rendered(tmp_path, plate, 40, 500)
    hull, images = Volume(*_field(views)), Images.of(views, 0.0)
    scale = float(np.ptp(truth.mesh_vertices, axis=0).max()) / 60
    low, high = truth.mesh_vertices.min(axis=0), truth.mesh_vertices.max(axis=0)
    middle = np.array([*((low + high) / 2)[:2], high[2]])
    faces = []
    for side in (1, -1):
        lattice = Lattice(middle - 31 * scale * np.array([1, 1, 0]), *np.eye(3), scale / 2, (124, 124))
        x, y = np.moveaxis((lattice.centers() - middle)[..., :2] / scale, -1, 0)
        turned = -np.sin(np.radians(20)) * x + np.cos(np.radians(20)) * y
        faces.append((lattice, (np.hypot(x, y) < 30) & (np.hypot(x, y) > 12) & (side * turned > 3)))
    opened, (groove,) = open_recesses(images, hull, faces)
    assert groove.depth == pytest.approx(4 * scale, abs=0.004)
    along = scale * np.array([np.cos(np.radians(20)), np.sin(np.radians(20)), 0])
    deep, shallow = middle - [0, 0, 5 * scale], middle - [0, 0, 3.2 * scale]
    inside = np.array([shallow + k * along for k in (-24, -18, 18, 24)])
    assert (opened.scene().signed_distance(inside) > 0).all()
    assert (hull.scene().signed_distance(inside) < 0).any()
    assert (opened.scene().signed_distance(inside - shallow + deep) < 0).all()


@pytest.mark.parametrize("deepest", [0.04, 0.3, 0.99])
def test_depths_are_tried_down_to_a_few_voxels(deepest):
    """A slot in the end of a long pin is shallow for the pin: a start lies within half of it and twice as deep."""
    spacing = 0.006
    depths = np.array(recess._depths(deepest, spacing))
    assert (depths > 0).all()
    assert depths.max() == pytest.approx(deepest)
    for true in np.geomspace(min(6 * spacing, deepest), deepest, 50):
        assert ((depths <= true * 1.001) & (depths > 0.49 * true)).any()


@pytest.mark.parametrize(
    ("part", "length", "depth"),
    [("slot", 10.0, 12.0), ("solid", 0.0, 0.0)],
)
def test_a_slot_that_is_open_at_two_sides_is_carved_to_its_inner_corner(tmp_path, part, length, depth):
    """Its hull has no planar lid there; without a face nothing is sought."""
    block = Box(60, 28, 32, align=Align.MIN)
    if part == "slot":
        block -= Pos(0, 9, 0) * Box(length, 10, depth, align=Align.MIN)
    views, truth = rendered(tmp_path, block, 40, 500)
    hull = Volume(*_field(views))
    images = Images.of(views, 0.0)
    corner = truth.mesh_vertices.min(axis=0)
    scale = float(np.ptp(truth.mesh_vertices, axis=0).max()) / 60
    axes = np.array([[1.0, 0, 0], [0, -1.0, 0], [0, 0, -1.0]])
    lattice = Lattice(corner - 28 * scale * axes[1], *axes, scale / 2, (120, 56))
    x, y = np.moveaxis((lattice.centers() - corner)[..., :2] / scale, -1, 0)
    outline = ~((x < length) & (np.abs(y - 14) < 5))
    opened, found = open_recesses(images, hull, [(lattice, outline)])
    assert not open_recesses(images, hull, [])[1]
    assert len(found) == (part == "slot")
    if found:
        assert found[0].depth == pytest.approx(depth * scale, abs=0.004)
        inner = corner + scale * np.array(
            [[length - 1.5, 14, depth - 1.5], [length - 1.5, 11, 2], [1, 17, depth - 1.5]]
        )
        beyond = corner + scale * np.array([[length + 1, 14, 5], [5, 14, depth + 1], [5, 7.5, 5]])
        assert (opened.scene().signed_distance(inner) > 0).all()
        assert every_pixel_is_asked(images, inner)
        leads_on, blind = replace(found[0], through=True), found[0]  # a hole into another one has no floor there
        assert not open_recesses(images, hull, [(lattice, outline)], [leads_on])[1]
        assert len(open_recesses(images, hull, [(lattice, outline)], [blind])[1]) == 1
        assert (opened.scene().signed_distance(beyond) < 0).all()


def every_pixel_is_asked(images, places):
    """Whether around a few places all pixels that show the object have rays."""
    cameras = images.views.cameras
    count = 0
    for view in range(len(cameras)):
        pixels = np.round(cameras.project(view, places)[0]).astype(int)
        (left, top), (right, bottom) = pixels.min(axis=0), pixels.max(axis=0)
        count += int((images.views.alpha[view, top:bottom, left:right] > 250).sum())
    return len(rays_near(images, places).grey) == count


def test_faces_on_one_plane_show_the_same_sections():
    faces = [face_at(TOP), face_at(TOP + SPACING / 4), face_at(BOTTOM, -1.0), face_at(TOP - 0.1)]
    kept = recess._planes(faces, SPACING)
    assert [lattice.offset for lattice, _ in kept] == [faces[k][0].offset for k in (0, 2, 3)]


def _field(views):
    """The hull's field, origin and spacing."""
    alpha = np.stack([np.clip(silhouette_distance(a) * 32, -32000, 32000).astype(np.int16) for a in views.alpha])
    return hull_field(alpha, views.cameras, 160, 1)


@pytest.mark.parametrize(("across", "holed", "shut"), [(True, False, True), (True, True, False), (False, False, False)])
def test_a_channel_does_not_go_through_a_face(across, holed, shut):
    """Unless the hull is open on both sides of it: a hole's mouth may have the face's grey."""
    hole = (lambda x, y: np.maximum(np.abs(x - 0.5), np.abs(y - 0.5)) < 0.1) if holed else None
    assert sweep._is_shut(SHAFT, [face_at(BOTTOM, -1.0, hole)], SPACING, across) == shut


@pytest.mark.parametrize(("lean", "shut"), [(0.5, True), (0.0, False)])
def test_a_channel_that_leaves_by_a_slope_is_not_open_at_both_ends(lean, shut):
    """Past the slope every column is empty."""
    normal = np.array([-np.sin(lean), 0, -np.cos(lean)])
    first = np.array([np.cos(lean), 0, -np.sin(lean)])
    second = np.cross(normal, first)
    middle = np.array([0.5, 0.5, 0.4])
    lattice = Lattice(middle - 0.3 * first - 0.3 * second, first, second, normal, 0.01, (60, 60))
    assert sweep._is_shut(SHAFT, [(lattice, np.ones((60, 60), bool))], SPACING, across=False) == shut
