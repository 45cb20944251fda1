"""Curved patches that are planes in the section, against keyways and cylinders made by hand."""

import numpy as np
import pytest
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.sections import angular
from brepgaussian.geometry.fit_robust import fit_robust
from brepgaussian.geometry.surfaces import plane
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

NOISE, TILT = 0.0015, 0.08


def blurred(xyz, normals, rng):
    """Points and normals with noise: (N, 3) each."""
    normals = normals + TILT * rng.normal(size=normals.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return xyz + NOISE * rng.normal(size=xyz.shape), normals


def keyway(width, depth, lean, turn, rng, count=150):
    """Walls and floor of a groove along an axis, under one label; walls lean apart by an angle on either side."""
    along, up, side = turn.as_matrix().T
    parts = []
    for sign in (-1.0, 0.0, 1.0):
        where = rng.uniform(0, 1, count)[:, None]
        if sign:
            normal = -sign * np.cos(lean) * side + np.sin(lean) * up
            place = sign * (width / 2) * side + depth * where * (up + sign * np.tan(lean) * side)
        else:
            normal, place = up, width * (where - 0.5) * side
        place = place + rng.uniform(0, 0.2, count)[:, None] * along + 0.5
        parts.append((place, np.broadcast_to(normal, place.shape)))
    return [np.concatenate(rows) for rows in zip(*parts, strict=True)], (along, up, side)


def patch_of(kind, xyz, normals, rng, number=3):
    surface = fit_robust(kind, xyz, normals, NOISE, initial=None, rng=rng)[0]
    return Patch(surface, number, xyz, normals, 0.01, surface.rms(xyz))


def block(along, up):
    """A patch of the face that the groove is cut into, and of one across it."""
    rng = np.random.default_rng(0)
    found = []
    for normal in (up, along):
        xyz = 0.5 + 0.3 * normal + rng.uniform(-0.2, 0.2, (50, 3)) @ (np.eye(3) - np.outer(normal, normal))
        surface = plane(xyz.mean(axis=0), normal)
        found.append(Patch(surface, len(found), xyz, np.tile(normal, (50, 1)), 0.01, 0.0))
    return found


@settings(max_examples=15, deadline=None)
@given(
    turn=st.integers(0, 2**16).map(lambda seed: Rotation.random(random_state=seed)),
    lean=st.floats(0, np.radians(14)),
    seed=st.integers(0, 2**16),
)
def test_a_keyway_under_one_label_is_three_planes(turn, lean, seed):
    rng = np.random.default_rng(seed)
    points, (along, up, side) = keyway(0.08, 0.05, lean, turn, rng)
    patch = patch_of("cylinder", *blurred(*points, rng), rng)
    (change,) = angular([*block(along, up), patch], square=True)
    normals = sorted((p.surface.axis for p in change.new), key=lambda n: float(n @ side))
    assert change.gone == (2,)
    np.testing.assert_allclose(normals, [-side, up, side], atol=1e-6)
    (change,) = angular([*block(along, up), patch], square=False)
    for found in change.new:
        assert abs(found.surface.axis @ along) < 1e-6
        assert found.sigma < 1.5 * NOISE + 0.01 * lean
    assert len({p.primitive for p in change.new} | {0, 1}) == 5


@pytest.mark.parametrize("span", [90, 180, 270])
@pytest.mark.parametrize("seed", range(4))
def test_a_cylinder_stays_one(span, seed):
    rng = np.random.default_rng(seed)
    angle = np.radians(span) * rng.uniform(0, 1, 400)
    normals = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(400)])
    xyz = 0.5 + 0.06 * normals + rng.uniform(0, 0.2, (400, 1)) * [0, 0, 1.0]
    patch = patch_of("cylinder", *blurred(xyz, -normals, rng), rng)
    assert angular([*block(np.array([0, 0, 1.0]), np.array([1.0, 0, 0])), patch], square=False) == []
    assert angular([*block(np.array([0, 0, 1.0]), np.array([1.0, 0, 0])), patch], square=True) == []


def test_a_bulging_wall_is_no_corner():
    rng = np.random.default_rng(5)
    angle = np.radians(20) * rng.uniform(-1, 1, 300)
    normals = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(300)])
    xyz = 0.3 * normals + rng.uniform(0, 0.2, (300, 1)) * [0, 0, 1.0]
    assert angular([patch_of("cylinder", *blurred(xyz, normals, rng), rng)], square=True) == []
