"""A fillet whose label was cut in two is one fillet again; chamfers that turn in steps stay what they are."""

import numpy as np
import pytest
from brepgaussian.artifacts.points import Points
from brepgaussian.primitives.stage import primitives_of
from brepgaussian.settings.primitives import PrimitivesSettings

RADIUS, SIGMA, WIDE, TALL = 0.1, 0.0012, 0.35, 0.2


def points_of(parts, rng):
    """Points of (label, xyz (N, 3), normals (N, 3)), noisy as reconstructed ones are."""
    xyz = np.concatenate([p for _, p, _ in parts])
    normals = np.concatenate([n for _, _, n in parts]) + 0.03 * rng.normal(size=xyz.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    label = np.repeat([k for k, _, _ in parts], [len(p) for _, p, _ in parts]).astype(np.int32)
    none, curve = np.zeros(len(label), np.float32), np.full(len(label), -1, np.int32)
    xyz = xyz + SIGMA * rng.normal(size=xyz.shape)
    return Points(xyz.astype(np.float32), normals.astype(np.float32), none, label, curve)


def flat(rng, label, start, along, normal, count=2500):
    """A rectangle from `start` (3,), as far as `along` (3,) and TALL up."""
    u, v = rng.uniform(0, 1, count), rng.uniform(0, TALL, count)
    xyz = np.array(start) + u[:, None] * np.array(along)
    return label, xyz + v[:, None] * [0, 0, 1], np.tile(np.array(normal, float), (count, 1))


def corner(rng, side, border):
    """Two walls with a fillet between them: convex or not by `side`; its label changes at `border` of its arc."""
    angle = rng.uniform(0, np.pi / 2, 1300)
    ring = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    around = RADIUS * ring + rng.uniform(0, TALL, (1300, 1)) * [0, 0, 1] + 0.5
    half = (angle > border * np.pi / 2).astype(int)
    walls = [
        flat(rng, 0, [0.5 + RADIUS, 0.5 - WIDE, 0.5], [0, WIDE, 0], [side, 0, 0]),
        flat(rng, 1, [0.5 - WIDE, 0.5 + RADIUS, 0.5], [WIDE, 0, 0], [0, side, 0]),
    ]
    return [*walls, *((2 + k, around[half == k], side * ring[half == k]) for k in (0, 1))]


@pytest.mark.parametrize("seed", [4, 5])
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("border", [0.4, 0.55])
def test_two_halves_are_one_fillet(seed, side, border):
    rng = np.random.default_rng(seed)
    found = primitives_of(points_of(corner(rng, side, border), rng), PrimitivesSettings(merge=False)).items
    assert sorted(p.surface.kind for p in found) == ["cylinder", "plane", "plane"]
    (fillet,) = [p.surface for p in found if p.surface.kind == "cylinder"]
    assert fillet.radius == pytest.approx(RADIUS, abs=0.004)
    assert fillet.flipped == (side < 0)


@pytest.mark.parametrize("seed", [4, 5])
def test_two_chamfers_in_a_row_stay_two_planes(seed):
    rng = np.random.default_rng(seed)
    wide = 0.12
    turns = np.radians([30, 60])
    first = np.array([-np.sin(turns[0]), np.cos(turns[0]), 0]) * wide
    second = np.array([-np.sin(turns[1]), np.cos(turns[1]), 0]) * wide
    start = np.array([0.7, 0.5, 0.5])
    end = start + first + second
    parts = [
        flat(rng, 0, start - [0, WIDE, 0], [0, WIDE, 0], [1, 0, 0]),
        flat(rng, 1, end - [WIDE, 0, 0], [WIDE, 0, 0], [0, 1, 0]),
        flat(rng, 2, start, first, [np.cos(turns[0]), np.sin(turns[0]), 0], 800),
        flat(rng, 3, start + first, second, [np.cos(turns[1]), np.sin(turns[1]), 0], 800),
    ]
    found = primitives_of(points_of(parts, rng), PrimitivesSettings()).items
    assert [p.surface.kind for p in found] == ["plane"] * 4
