"""Corners of four planes: the smallest shifts that make them hold, against a pyramid cut at its top."""

from itertools import combinations

import numpy as np
import pytest
from brepgaussian.artifacts.points import Points
from brepgaussian.artifacts.primitives import Relation
from brepgaussian.geometry.surfaces import plane
from brepgaussian.primitives.corners import meet
from brepgaussian.primitives.patches import Noise, Patch, make_cloud

NOISE = Noise(0.001, 0.05)
APEX = np.array([0.5, 0.5, 0.8])
LEAN = np.radians(35.0)


def pyramid(errors, seed=4):
    """Four sides of a pyramid with a square foot, each shifted by an error; their points meet at the apex."""
    rng = np.random.default_rng(seed)
    clouds, normals = [], []
    for k in range(4):
        out = np.array([np.cos(k * np.pi / 2), np.sin(k * np.pi / 2), 0])
        across = np.array([-out[1], out[0], 0])
        down = np.sqrt(rng.random((2500, 1))) * 0.4
        wide = rng.uniform(-1, 1, (2500, 1)) * down * np.tan(LEAN)
        clouds.append(APEX - down * np.array([0, 0, 1.0]) + down * np.tan(LEAN) * out + wide * across)
        normals.append(np.cos(LEAN) * out + np.sin(LEAN) * np.array([0, 0, 1.0]))
    xyz = np.concatenate(clouds)
    label = np.repeat(np.arange(4), 2500).astype(np.int32)
    own = np.repeat(normals, 2500, axis=0)
    none = np.zeros(len(xyz), np.float32)
    cloud = make_cloud(Points(xyz.astype(np.float32), own.astype(np.float32), none, label, label * 0 - 1), 10)
    members = [np.flatnonzero(label == k) for k in range(4)]
    patches = [
        Patch((k,), m, plane(APEX + e * n, n), abs(e), 0.01)
        for k, (m, n, e) in enumerate(zip(members, normals, errors, strict=True))
    ]
    return patches, cloud


def apexes(patches):
    """The points in which any three of the planes meet."""
    planes = [(p.surface.axis, p.surface.axis @ p.surface.origin) for p in patches]
    return np.array(
        [np.linalg.solve([planes[i][0] for i in c], [planes[i][1] for i in c]) for c in combinations(range(4), 3)]
    )


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_four_planes_get_one_point_by_the_smallest_shifts(seed):
    errors = 0.0003 * np.random.default_rng(seed).uniform(-1, 1, 4)
    patches, cloud = pyramid(errors)
    moved, corners = meet(patches, (), cloud, NOISE)
    assert corners == [(0, 1, 2, 3)]
    assert np.ptp(apexes(moved), axis=0).max() < 1e-10
    assert np.ptp(apexes(patches), axis=0).max() > 1e-5
    shifts = [
        float((b.surface.origin - a.surface.origin) @ a.surface.axis) for a, b in zip(patches, moved, strict=True)
    ]
    # the offsets of opposite sides have equal sums on a pyramid: each moves by a quarter of what these differ by
    quarter = (errors[0] + errors[2] - errors[1] - errors[3]) / 4
    np.testing.assert_allclose(shifts, quarter * np.array([-1, 1, -1, 1]), atol=1e-10)


def test_a_ridge_longer_than_the_noise_stays():
    patches, cloud = pyramid([0.004, 0.0, 0.004, 0.0])
    moved, corners = meet(patches, (), cloud, NOISE)
    assert corners == []
    assert [a.surface is b.surface for a, b in zip(patches, moved, strict=True)] == [True] * 4


def test_what_touches_a_curved_face_stays():
    patches, cloud = pyramid([0.0005, -0.0003, 0.0002, 0.0004])
    moved, corners = meet(patches, (Relation("tangent", 0, 7, 0.0),), cloud, NOISE)
    assert corners
    assert np.abs(moved[0].surface.origin - patches[0].surface.origin).max() < 1e-12
    assert np.ptp(apexes(moved), axis=0).max() < 1e-8
