"""Fillets between confirmed planar faces: radii against the solid that the images were made of."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.prism import Lattice, plane_axes
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.faces.confirm import Face
from brepgaussian.splatting.faces.fillets import Edge, Fillet, inner_edge, round_edges
from brepgaussian.splatting.faces.tie import tied
from poses import look_at

SIZE, FOCAL, SPACING = 300, 390.0, 1 / 96
LIGHT = np.array([0.5, 0.3, 0.81])
POINT = np.array([0.45, 0.5, 0.4])  # on the inner edge, which runs along y


def cameras_above(count):
    poses = []
    for k in range(count):
        angle = 2 * np.pi * k / count
        center = np.array([0.9 + 0.8 * np.cos(angle), 0.5 + 0.8 * np.sin(angle), 1.6 + 0.2 * (k % 3)])
        poses.append(look_at(center, POINT))
    return Cameras(np.tile([FOCAL, FOCAL, SIZE / 2, SIZE / 2], (count, 1)), np.array(poses), SIZE, SIZE)


def corner(angle):
    """The inner edge of a floor (normal z) and a wall whose normal makes an angle with it."""
    normals = np.array([[0, 0, 1.0], [np.sin(angle), 0, np.cos(angle)]])
    return Edge(POINT, np.array([0, -1.0, 0]), normals, (-0.3, 0.3), 0.4)


def block(edge, radius):
    """Two planes that meet, 0.6 wide, with a fillet (0 = sharp)."""
    grid = np.stack(np.meshgrid(*[SPACING * np.arange(97)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    inside = edge.filled(grid, radius) if radius else -edge.heights(grid).min(axis=1)
    inside = np.minimum.reduce([inside, 0.3 - np.abs(grid[:, 1] - 0.5), 0.45 - np.abs(grid - 0.5).max(axis=1)])
    return Volume(inside.reshape(97, 97, 97).astype(np.float32), np.zeros(3), SPACING)


def images_of(edge, radius, cameras, seed):
    """What a matt block under one light looks like, with half a grey level of noise."""
    scene, rng = block(edge, radius).scene(), np.random.default_rng(seed)
    columns, rows = np.meshgrid(np.arange(SIZE), np.arange(SIZE))
    pixels = np.column_stack([columns.ravel() + 0.5, rows.ravel() + 0.5])
    grey, alpha = np.zeros((len(cameras), SIZE * SIZE)), np.zeros((len(cameras), SIZE * SIZE), np.uint8)
    center = edge.point + radius * edge.normals.sum(axis=0) / (1 + edge.cosine)
    for view in range(len(cameras)):
        origin, ray = cameras.rays(view, pixels)
        distance, normal = scene.hits(np.broadcast_to(origin, ray.shape), ray)
        met = np.isfinite(distance)
        points, normal = origin + distance[met, None] * ray[met], normal[met].astype(float)
        off = (center - points) * [1, 0, 1]
        angles = edge.heights(points).min(axis=1)
        on = (angles > 0.01) & (np.linalg.norm(off, axis=1) < radius + 0.02) & (np.abs(points[:, 1] - 0.5) < 0.29)
        normal[on] = off[on] / np.linalg.norm(off[on], axis=1, keepdims=True)  # facets of the mesh would show
        grey[view, met] = 60 + 150 * np.clip(normal @ LIGHT, 0, 1) + rng.normal(0, 0.5, met.sum())
        alpha[view, met] = 255
    shape = (len(cameras), SIZE, SIZE)
    return Images(SimpleNamespace(alpha=alpha.reshape(shape), cameras=cameras), grey.reshape(shape), 1.5)


def faces_of(edge):
    """Both planes up to the edge, as masks that merge them with the fillet tell them."""
    faces = []
    for k in range(2):
        ahead = edge.normals[1 - k] - edge.cosine * edge.normals[k]
        first, second = plane_axes(edge.normals[k])
        across = np.abs([first @ edge.direction, second @ edge.direction])
        shape = tuple(60 if a > 0.5 else 38 for a in across)
        middle = edge.point + 0.19 * ahead / np.linalg.norm(ahead)
        origin = middle - 0.005 * (shape[0] * first + shape[1] * second)
        faces.append(Face(Lattice(origin, first, second, edge.normals[k], 0.01, shape), np.ones(shape, bool), 0.0, 0.0))
    return faces


@pytest.mark.parametrize(("angle", "radius", "seed"), [(90, 0.12, 1), (90, 0.2, 2), (70, 0.15, 3), (120, 0.12, 4)])
def test_a_cut_corner_gets_its_fillet_back(angle, radius, seed):
    edge = corner(np.radians(angle))
    cameras = cameras_above(12)
    images = images_of(edge, radius, cameras, seed)
    silhouettes, faces = block(edge, 0.5), faces_of(edge)
    hull, left, _ = round_edges(images, silhouettes, block(edge, 0), faces)
    vertices = hull.scene().vertices
    heights = edge.heights(vertices)
    within = (heights > 0.3 * radius * (1 - np.sqrt(0.5))).all(axis=1) & (np.abs(vertices[:, 1] - 0.5) < 0.28)
    assert within.sum() > 100
    assert np.abs(edge.filled(vertices[within], radius)).max() < 0.006  # half a voxel; .04-.08 before
    for before, after in zip(faces, left, strict=True):
        distance = np.linalg.norm((after.lattice.centers()[after.outline] - POINT) * [1, 0, 1], axis=1)
        assert distance.min() > 0.9 * edge.tangent_length(radius)
        assert after.outline.sum() > 0.3 * before.outline.sum()


@pytest.mark.parametrize("angle", [70, 90, 120])
def test_surfels_of_a_fillet_are_put_back_on_it_and_others_stay(angle):
    edge, radius, rng = corner(np.radians(angle)), 0.15, np.random.default_rng(angle)
    half = np.arccos(edge.cosine) / 2  # of the arc
    bisector = edge.normals.sum(axis=0) / np.linalg.norm(edge.normals.sum(axis=0))
    side = np.cross(edge.direction, bisector)
    axis = edge.point + radius * edge.normals.sum(axis=0) / (1 + edge.cosine)
    turn = rng.uniform(-0.9 * half, 0.9 * half, (500, 1))
    out = np.cos(turn) * bisector + np.sin(turn) * side
    along = rng.uniform(edge.span[0], edge.span[1], (500, 1)) * edge.direction
    true = axis - (axis @ edge.direction) * edge.direction + along - radius * out
    true += (edge.point @ edge.direction) * edge.direction
    drifted = true + rng.uniform(-0.015, 0.015, (500, 1)) * out
    leaning = out + 0.2 * rng.normal(size=out.shape)
    leaning /= np.linalg.norm(leaning, axis=1, keepdims=True)
    back = true - 0.01 * out  # of a thin wall's other side
    flat = edge.point + 0.4 * np.cross(edge.direction, edge.normals[0]) * np.sign(
        edge.normals[1] @ np.cross(edge.direction, edge.normals[0])
    )
    points = np.concatenate([drifted, back, flat[None]]).astype(np.float32)
    normals = np.concatenate([leaning, -out, edge.normals[:1]]).astype(np.float32)
    centers, facing = tied(points, normals, [Fillet(edge, radius)], SPACING)
    inside = ((along @ edge.direction) > edge.span[0]) & ((along @ edge.direction) < edge.span[1])
    assert np.abs(edge.filled(centers[:500].astype(float), radius)[inside]).max() < 1e-5
    assert (facing[:500] * out).sum(axis=1)[inside].min() > 0.999
    np.testing.assert_array_equal(centers[500:], points[500:])
    np.testing.assert_array_equal(facing[500:], normals[500:])


@pytest.mark.parametrize("angle", [70, 90, 120])
def test_a_sharp_corner_stays_sharp(angle):
    edge = corner(np.radians(angle))
    sharp, faces = block(edge, 0), faces_of(edge)
    hull, left, _ = round_edges(images_of(edge, 0, cameras_above(12), 7), block(edge, 0.5), sharp, faces)
    assert hull is sharp
    assert all(old is new for old, new in zip(faces, left, strict=True))


def test_only_faces_that_look_at_each_other_have_an_inner_edge():
    floor, wall = faces_of(corner(np.radians(90)))
    assert inner_edge(floor, wall, SPACING) is not None
    assert inner_edge(floor, floor, SPACING) is None
    below = Lattice(
        wall.lattice.origin - [0, 0, 0.5], *plane_axes(wall.lattice.normal), wall.lattice.normal, 0.01, (60, 38)
    )
    assert inner_edge(floor, Face(below, np.ones((60, 38), bool), 0.0, 0.0), SPACING) is None


@pytest.mark.parametrize("angle", [60, 90, 130])
def test_a_fillet_touches_both_planes(angle):
    edge = corner(np.radians(angle))
    length = edge.tangent_length(0.1)
    assert edge.radius(length) == pytest.approx(0.1)
    for k in range(2):
        ahead = edge.normals[1 - k] - edge.cosine * edge.normals[k]
        ahead /= np.linalg.norm(ahead)
        tangent = edge.point + length * ahead
        assert edge.filled(tangent[None], 0.1)[0] == pytest.approx(0, abs=1e-9)
        assert edge.filled((tangent + 0.001 * edge.normals[k] - 0.02 * ahead)[None], 0.1)[0] > 0  # below the fillet
        assert edge.filled((tangent + 0.001 * edge.normals[k] + 0.02 * ahead)[None], 0.1)[0] < 0  # past it


def test_planes_that_meet_inside_the_solid_or_in_nothing_are_left():
    edge = corner(np.radians(90))
    sharp, faces = block(edge, 0), faces_of(edge)
    images = images_of(edge, 0, cameras_above(3), 8)
    for value in (-1.0, 1.0):
        hull = sharp.with_field(np.where(np.abs(sharp.field) < 9, value, 0).astype(np.float32))
        hull.field[:2] = 1.0  # a surface elsewhere
        hull.field[2:4] = -1.0
        assert round_edges(images, hull, hull, faces)[0] is hull


def test_a_face_without_cells_has_no_edge():
    floor, wall = faces_of(corner(np.radians(90)))
    bare = replace(wall, outline=np.zeros_like(wall.outline))
    assert inner_edge(floor, bare, SPACING) is None
