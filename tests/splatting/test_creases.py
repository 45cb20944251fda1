"""Edges at which surfels bend, against corners and shoulders whose edges are known."""

import numpy as np
import pytest
from brepgaussian.splatting.evidence.creases import creases
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

SPACING = 0.016  # of the surfels of a bundled part


def jittered(u, v, rng):
    """(N, 2) points about `SPACING` apart on a rectangle given by two ranges."""
    grid = np.stack(np.meshgrid(np.arange(*u, SPACING), np.arange(*v, SPACING), indexing="ij"), -1).reshape(-1, 2)
    return grid + rng.uniform(-0.3, 0.3, grid.shape) * SPACING


def corner(rng, turn=np.pi / 2, noise=0.0003):
    """Surfels of two planes that meet in the y axis, rounded off by a thousandth or two beside it."""
    centers, normals = [], []
    for angle, sign in ((0.0, 1), (turn, -1)):
        place = jittered((0.4 * SPACING, 0.2), (0, 0.4), rng)
        normal = sign * np.array([-np.sin(angle), 0, np.cos(angle)])
        lift = 0.002 * np.clip(1 - place[:, 0] / 0.02, 0, 1) + noise * rng.standard_normal(len(place))
        centers.append(place[:, :1] * [np.cos(angle), 0, np.sin(angle)] + place[:, 1:] * [0, 1, 0])
        centers[-1] += lift[:, None] * normal
        normals.append(np.broadcast_to(normal, centers[-1].shape))
    return np.concatenate(centers), np.concatenate(normals)


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), turn=st.floats(0.7, 2.4))
def test_the_edge_of_two_planes_is_found(seed, turn):
    rng = np.random.default_rng(seed)
    centers, normals = corner(rng, turn)
    rotation, shift = Rotation.random(random_state=seed % 1000).as_matrix(), rng.uniform(-1, 1, 3)
    points, directions = creases(centers @ rotation.T + shift, normals @ rotation.T)
    points, directions = (points - shift) @ rotation, directions @ rotation
    assert np.linalg.norm(points[:, [0, 2]], axis=1).max() < 0.007  # the roundness pulls by .002 and more
    assert np.abs(directions[:, 1]).min() > 0.95
    along = np.arange(0.03, 0.37, 0.002)
    edge = np.stack([0 * along, along, 0 * along], 1)
    assert (cKDTree(points).query(edge)[0] < 0.007).mean() > 0.85


def test_a_shoulder_of_a_shaft_is_a_circle():
    rng = np.random.default_rng(11)
    radius = 0.12
    around = jittered((0, 2 * np.pi * radius), (0.3 * SPACING, 0.2), rng)
    angle = around[:, 0] / radius
    out = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    flat = jittered((-0.25, 0.25), (-0.25, 0.25), rng)
    flat = flat[np.linalg.norm(flat, axis=1) > radius + 0.3 * SPACING]
    centers = np.concatenate([radius * out + around[:, 1:] * [0, 0, 1], np.column_stack([flat, 0 * flat[:, 0]])])
    normals = np.concatenate([out, np.broadcast_to([0, 0, 1.0], (len(flat), 3))])
    points, _ = creases(centers, normals)
    off = np.hypot(np.linalg.norm(points[:, :2], axis=1) - radius, points[:, 2])
    assert np.median(off) < 0.002
    assert off.max() < 0.006
    assert len(np.unique(np.arctan2(points[:, 1], points[:, 0]) // 0.2)) >= 31  # no gap around


@pytest.mark.parametrize("radius", [0.03, 0.05, 0.1, 0.3])
def test_a_cylinder_has_no_edges(radius):
    rng = np.random.default_rng(3)
    around = jittered((0, 2 * np.pi * radius), (0, 0.5), rng)
    angle = around[:, 0] / radius
    normals = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    centers = (radius + 0.0004 * rng.standard_normal((len(angle), 1))) * normals + around[:, 1:] * [0, 0, 1]
    points, _ = creases(centers, normals)
    assert len(points) <= 0.05 * len(centers)  # twelve surfels go around the narrowest


def test_planes_and_too_few_surfels_have_none():
    rng = np.random.default_rng(4)
    place = jittered((0, 0.5), (0, 0.5), rng)
    centers = np.column_stack([place, 0.0005 * rng.standard_normal(len(place))])
    up = np.broadcast_to([0, 0, 1.0], centers.shape)
    assert len(creases(centers, up)[0]) == 0
    assert len(creases(centers[:10], up[:10])[0]) == 0
    assert len(creases(np.zeros((200, 3)), np.broadcast_to([0, 0, 1.0], (200, 3)))[0]) == 0
