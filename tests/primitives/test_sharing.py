"""A label that runs over a tangent border: the border is found, and both faces get their own surface."""

import numpy as np
import pytest
from brepgaussian.artifacts.points import Points
from brepgaussian.primitives.stage import primitives_of
from brepgaussian.settings.primitives import PrimitivesSettings

RADIUS, FILLET, RIM, SIGMA = 0.2, 0.06, 0.32, 0.0008


def turned(rng, count, profile):
    """Points and normals of a surface of revolution about z; `profile` maps (N,) in 0..1 to r, z, n_r, n_z."""
    r, z, along, up = profile(rng.uniform(0, 1, count))
    angle = rng.uniform(0, 2 * np.pi, count)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.column_stack([ring * r[:, None], z]), np.column_stack([ring * along[:, None], up])


def fillet(rng, count, low, high):
    """The inner fillet between a shaft and its shoulder at z = 0; 0 is the shoulder's end, 1 the shaft's."""

    def profile(t):
        angle = (low + (high - low) * t) * np.pi / 2
        centre = RADIUS + FILLET
        return centre - FILLET * np.sin(angle), FILLET * (1 - np.cos(angle)), np.sin(angle), np.cos(angle)

    return turned(rng, count, profile)


@pytest.mark.parametrize("share", [0.5, 0.6])
def test_a_shoulder_with_a_piece_of_its_fillet_is_a_plane(share):
    rng = np.random.default_rng(2)
    one, flat = np.ones_like, np.zeros_like
    ring = RADIUS + FILLET
    parts = [
        (0, turned(rng, 4000, lambda t: (one(t) * RADIUS, FILLET + 0.4 * t, one(t), flat(t)))),
        (1, fillet(rng, 1500, share, 1)),
        (2, fillet(rng, 800, 0, share)),
        (2, turned(rng, 1500, lambda t: (ring + (RIM - ring) * t, flat(t), flat(t), one(t)))),
        (3, turned(rng, 4000, lambda t: (one(t) * RIM, -0.3 * t, one(t), flat(t)))),
    ]
    xyz = np.concatenate([p for _, (p, _) in parts]) + 0.5
    xyz += SIGMA * rng.normal(size=xyz.shape)
    normals = np.concatenate([n for _, (_, n) in parts]) + 0.02 * rng.normal(size=xyz.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    label = np.repeat([k for k, _ in parts], [len(p) for _, (p, _) in parts]).astype(np.int32)
    none, curve = np.zeros(len(label), np.float32), np.full(len(label), -1, np.int32)
    points = Points(xyz.astype(np.float32), normals.astype(np.float32), none, label, curve)
    found = primitives_of(points, PrimitivesSettings()).items
    assert [p.surface.kind for p in found] == ["cylinder", "torus", "plane", "cylinder"]
    assert found[1].surface.minor == pytest.approx(FILLET, abs=0.003)
    whole = primitives_of(points, PrimitivesSettings(split=False)).items
    assert (whole[2].surface.kind == "plane") == (share < 0.6)  # more of the fillet makes another kind of the whole
