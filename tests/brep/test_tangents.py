"""Walls beside rounder faces: moved to touch where the points allow, against the solid that they were made from."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.tangents import cleared, tangent_walls
from brepgaussian.geometry.surfaces import cylinder, plane

NOISE, RADIUS, REACH = 0.001, 0.2, 0.02
MIDDLE, AXIS = np.array([0.5, 0.5, 0.6]), np.array([0.0, 1.0, 0.0])


def patch(surface, xyz, normals, sigma):
    return Patch(surface, 0, xyz, normals, REACH, sigma)


def bearing(rng, lift=0.0, tilt=0.0, sigma=0.003, inside=False):
    """A half-round top (or the end of a slot), and a side wall below it whose fit is off by a distance and an angle."""
    side = -1.0 if inside else 1.0
    turn, along = rng.uniform(0, np.pi, 3000), rng.uniform(-0.2, 0.2, 3000)
    out = np.column_stack([np.cos(turn), np.zeros(3000), np.sin(turn)])
    top = patch(
        cylinder(MIDDLE, AXIS, RADIUS, inside), MIDDLE + RADIUS * out + along[:, None] * AXIS, side * out, NOISE
    )
    below = np.column_stack([np.full(800, RADIUS), rng.uniform(-0.2, 0.2, 800), rng.uniform(-0.25, -0.01, 800)])
    xyz = MIDDLE + below + lift * np.eye(3)[0] + rng.normal(0, sigma, (800, 1)) * np.eye(3)[0]
    normal = side * np.array([np.cos(tilt), 0.0, np.sin(tilt)])
    wall = patch(plane(xyz.mean(axis=0), normal), xyz, np.tile(side * np.eye(3)[0], (800, 1)), sigma)
    return [top, wall]


@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize(("lift", "tilt"), [(0.005, 0.0), (-0.004, 0.02), (0.0, -0.01)])
def test_a_wall_beside_a_round_face_touches_it(lift, tilt, inside):
    patches = bearing(np.random.default_rng(2), lift, tilt, inside=inside)
    top, wall = tangent_walls(patches, NOISE)
    assert top is patches[0]
    gap = (wall.surface.origin - MIDDLE) @ wall.surface.axis - (-RADIUS if inside else RADIUS)
    assert abs(gap) < 1e-12
    assert abs(float(wall.surface.axis @ AXIS)) < 1e-12
    assert wall.surface.rms(wall.xyz) == pytest.approx(wall.sigma)


@pytest.mark.parametrize(
    "change",
    [{"lift": 0.03}, {"sigma": 0.0005}, {"lift": 0.0, "tilt": 0.0}],
    ids=["it is another face", "its points know better", "it touches"],
)
def test_other_walls_stay(change):
    patches = bearing(np.random.default_rng(3), **change)
    if change.get("tilt") == 0.0:  # exactly
        patches[1] = replace(patches[1], surface=plane(MIDDLE + RADIUS * np.eye(3)[0], np.eye(3)[0]))
    assert tangent_walls(patches, NOISE)[1] is patches[1]


def test_a_short_wall_touches_a_round_face_though_its_few_points_fit_as_well():
    """What is left of a side between two round faces: its points are near it, and tell little of where it leads."""
    rng = np.random.default_rng(5)
    top, wall = bearing(rng, lift=0.001, sigma=0.0009)
    short = wall.xyz[:, 2] > wall.xyz[:, 2].max() - 0.03
    small = replace(wall, xyz=wall.xyz[short], normals=wall.normals[short])
    assert small.sigma < top.sigma
    found = tangent_walls([top, small], NOISE)[1].surface
    assert (found.origin - MIDDLE) @ found.axis == pytest.approx(RADIUS)


def test_an_opposite_wall_that_is_known_better_tells_the_direction():
    rng = np.random.default_rng(4)
    patches = bearing(rng, lift=0.004, tilt=0.03)
    far = np.column_stack([np.full(800, -RADIUS), rng.uniform(-0.2, 0.2, 800), rng.uniform(-0.25, -0.01, 800)])
    opposite = patch(
        plane(MIDDLE + far.mean(axis=0), -np.eye(3)[0]), MIDDLE + far, np.tile(-np.eye(3)[0], (800, 1)), 0.0005
    )
    found = tangent_walls([*patches, opposite], NOISE)[1].surface
    np.testing.assert_allclose(found.axis, [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(found.signed_distance(MIDDLE[None] + [[RADIUS, 0, 0]]), 0, atol=1e-12)


@pytest.mark.parametrize("lift", [-0.001, 0.0, 0.0004])
def test_a_flat_that_touches_a_rod_in_a_point_is_moved_clear_of_it(lift):
    rng = np.random.default_rng(4)
    turn, up = rng.uniform(0, 2 * np.pi, 4000), rng.uniform(0, 0.6, 4000)
    out = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(4000)])
    rod = patch(cylinder(np.zeros(3), np.eye(3)[2], RADIUS), RADIUS * out + up[:, None] * np.eye(3)[2], out, NOISE)
    far, about = 0.25 * np.sqrt(rng.uniform(0, 1, 3000)), rng.uniform(0, 2 * np.pi, 3000)
    disk = np.column_stack([np.full(3000, RADIUS + lift), far * np.cos(about), 0.85 + far * np.sin(about)])
    flat = patch(plane(disk.mean(axis=0), np.eye(3)[0]), disk, np.tile(np.eye(3)[0], (3000, 1)), NOISE)
    same, moved = cleared([rod, flat], NOISE)
    assert same is rod
    assert moved.surface.origin[0] == pytest.approx(RADIUS + 1e-4, abs=1e-9)


def test_a_wall_that_touches_a_round_face_all_along_stays():
    patches = bearing(np.random.default_rng(2))
    assert all(a is b for a, b in zip(cleared(patches, NOISE), patches, strict=True))
