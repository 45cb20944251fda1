"""Labels that end in the middle of a fillet: the face and the whole fillet are proposed in their place."""

import numpy as np
import pytest
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.regroup import regrouped
from brepgaussian.geometry.fit_robust import fit_robust
from brepgaussian.geometry.surfaces import cylinder, plane, torus

AXIS, MIDDLE = np.array([0.0, 0.0, 1.0]), np.array([0.5, 0.5, 0.4])
RADIUS, TUBE, SIGMA = 0.2, 0.06, 0.0008


def on(surface, rng, radius, height, count):
    """Points with noise on a surface of revolution about z, in ranges of radius and height, and exact normals."""
    turn, t = rng.uniform(0, 2 * np.pi, count), rng.uniform(0, 1, count)
    r, z = (low + (high - low) * t for low, high in (radius, height))
    xyz = surface.project(MIDDLE + np.column_stack([r * np.cos(turn), r * np.sin(turn), z]))
    return xyz + SIGMA * rng.normal(size=xyz.shape), surface.normals(xyz)


def fitted(kind, number, *parts):
    """One patch of several pieces, with the surface of a kind that fits them best."""
    xyz, normals = (np.concatenate([p[k] for p in parts]) for k in (0, 1))
    surface = fit_robust(kind, xyz, normals, SIGMA)[0]
    return Patch(surface, number, xyz, normals, 0.02, surface.rms(xyz))


def shoulder(rng, share):
    """A shaft, its rim, and a shoulder one of whose two labels runs over a share of the fillet."""
    fillet = torus(MIDDLE + TUBE * AXIS, AXIS, RADIUS + TUBE, TUBE, True)
    ring, angle = RADIUS + TUBE, share * np.pi / 2
    border = ring - TUBE * np.sin(angle), TUBE * (1 - np.cos(angle))  # radius and height
    near = on(fillet, rng, (border[0], RADIUS), (border[1], TUBE), 1200)
    far = on(fillet, rng, (ring, border[0]), (0, border[1]), int(2500 * share))
    flat = on(plane(MIDDLE, AXIS), rng, (ring, ring + 0.05), (0, 0), 1300)
    return [
        fitted("cylinder", 0, on(cylinder(MIDDLE, AXIS, RADIUS), rng, (RADIUS, RADIUS), (TUBE, 0.3), 2500)),
        fitted("torus", 1, near),
        fitted("cone", 2, far, flat),
    ]


@pytest.mark.parametrize("seed", range(4))
def test_a_shoulder_that_shares_a_label_with_half_of_its_fillet_is_a_plane(seed):
    rng = np.random.default_rng(seed)
    patches = shoulder(rng, rng.uniform(0.4, 0.6))
    (change,) = regrouped(patches, SIGMA, rng)
    assert set(change.gone) == {1, 2}
    face, larger = change.new
    assert face.surface.kind == "plane"
    assert abs(face.surface.axis @ larger.surface.axis) == pytest.approx(1)
    assert np.abs(face.surface.signed_distance(MIDDLE[None])) < 0.002
    assert larger.surface.minor == pytest.approx(TUBE, abs=0.008)
    wall = patches[0].surface  # the fillet touches both faces
    assert larger.surface.radius - larger.surface.minor == pytest.approx(wall.radius, abs=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_a_true_cone_beside_a_fillet_stays(seed):
    rng = np.random.default_rng(seed)
    patches = shoulder(rng, 0.02)
    fillet = torus(MIDDLE + TUBE * AXIS, AXIS, RADIUS + TUBE, TUBE, True)
    ring = RADIUS + TUBE
    slope = np.tan(np.radians(35.0))
    turn, radius = rng.uniform(0, 2 * np.pi, 2000), rng.uniform(ring, ring + 0.15, 2000)
    xyz = MIDDLE + np.column_stack([radius * np.cos(turn), radius * np.sin(turn), -slope * (radius - ring)])
    out = np.column_stack([slope * np.cos(turn), slope * np.sin(turn), np.ones(2000)]) / np.hypot(1, slope)
    whole = fitted("torus", 1, on(fillet, rng, (ring, RADIUS), (0, TUBE), 1500))
    patches = [patches[0], whole, fitted("cone", 2, (xyz + SIGMA * rng.normal(size=xyz.shape), out))]
    assert not list(regrouped(patches, SIGMA, rng))


def rounded_end(rng, share):
    """A flat end between two fillets; the label of the end runs over a share of one of them."""
    sides, height = 0.1, (0.0, 0.3)

    def arc(sign, low, high, count):
        turn, z = rng.uniform(low, high, count) * np.pi / 2, rng.uniform(*height, count)
        out = np.column_stack([np.cos(turn), sign * np.sin(turn), np.zeros(count)])
        xyz = np.array([0, sign * sides, 0]) + 0.1 * out + z[:, None] * AXIS
        return xyz + SIGMA * rng.normal(size=xyz.shape), out

    flat = np.column_stack([np.full(1200, 0.1), rng.uniform(-sides, sides, 1200), rng.uniform(*height, 1200)])
    end = flat + SIGMA * rng.normal(size=flat.shape), np.tile([1.0, 0, 0], (1200, 1))
    wall = np.column_stack([rng.uniform(-0.5, 0, 1200), np.full(1200, -0.2), rng.uniform(*height, 1200)])
    return [
        fitted("cylinder", 0, end, arc(-1, 0, share, int(1000 * share))),
        fitted("cylinder", 1, arc(-1, share, 1, int(1000 * (1 - share)))),
        fitted("cylinder", 2, arc(1, 0, 1, 1000)),
        fitted("plane", 3, (wall + SIGMA * rng.normal(size=wall.shape), np.tile([0, -1.0, 0], (1200, 1)))),
    ]


@pytest.mark.parametrize("seed", range(4))
def test_a_flat_end_that_shares_a_label_with_a_piece_of_its_fillet_is_a_plane(seed):
    rng = np.random.default_rng(seed)
    changes = list(regrouped(rounded_end(rng, rng.uniform(0.35, 0.5)), SIGMA, rng))
    (change,) = [c for c in changes if set(c.gone) == {0, 1}]
    face, larger = change.new
    assert face.surface.kind == "plane"
    assert abs(face.surface.axis[0]) == pytest.approx(1, abs=1e-3)
    assert larger.surface.radius == pytest.approx(0.1, abs=0.01)
