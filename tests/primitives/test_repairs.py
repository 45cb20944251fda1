"""Rounded-off edges, families of pieces, guided surfaces."""

import numpy as np
import pytest
from brepgaussian.artifacts.points import Points
from brepgaussian.geometry.surfaces import cone, cylinder, plane
from brepgaussian.primitives.absorbing import rank_correlation
from brepgaussian.primitives.stage import primitives_of
from brepgaussian.settings.primitives import PrimitivesSettings
from sampled_surfaces import noisy, sample
from scipy.stats import spearmanr

DEFAULT = PrimitivesSettings()
X, Y, Z = np.eye(3)


def cloud(pieces, rng, sigma=0.002, turn=0.05):
    """Points of (points, normals, edge) pieces, one label each."""
    xyz, normals = noisy(
        np.concatenate([p[0] for p in pieces]), np.concatenate([p[1] for p in pieces]), sigma, rng, turn
    )
    edge = np.concatenate([p[2] if len(p) > 2 else np.zeros(len(p[0])) for p in pieces])
    label = np.repeat(np.arange(len(pieces), dtype=np.int32), [len(p[0]) for p in pieces])
    return Points(
        xyz.astype(np.float32),
        normals.astype(np.float32),
        edge.astype(np.float32),
        label,
        np.full(len(label), -1, np.int32),
    )


def two_walls(rng, cut):
    """Two perpendicular walls of a block with an edge along y, `cut` off where they meet."""

    def wall(across, up):
        run, along = rng.uniform(cut, 0.5, 2500), rng.uniform(0, 0.6, 2500)
        return -run[:, None] * across + along[:, None] * Y, np.tile(up, (2500, 1))

    return [wall(X, Z), wall(Z, X)]


def strip(rng, size, kind):
    """The strip between the walls: a quarter round or a chamfer that cuts `size` off; with its edge values."""
    count = 400
    along = rng.uniform(0, 0.6, count)[:, None] * Y
    at = rng.uniform(0, 1, count)
    if kind == "chamfer":
        points = -size * (at[:, None] * X + (1 - at)[:, None] * Z) + along
        normals = np.tile((X + Z) / np.sqrt(2), (count, 1))
    else:
        turn = at * np.pi / 2
        normals = np.cos(turn)[:, None] * X + np.sin(turn)[:, None] * Z
        points = -size * (X + Z) + size * normals + along
    middle = 1 - np.abs(2 * at - 1)
    return points, normals, middle if kind == "rounded" else 1 - middle


@pytest.mark.parametrize(("kind", "size", "kept"), [("rounded", 0.015, 0), ("fillet", 0.06, 1), ("chamfer", 0.03, 1)])
def test_a_rounded_edge_is_no_face_but_a_fillet_or_chamfer_is(kind, size, kept):
    rng = np.random.default_rng(0)
    points = cloud([*two_walls(rng, size), strip(rng, size, kind)], rng)
    result = primitives_of(points, DEFAULT)
    assert len(result.items) == 2 + kept
    if kind == "fillet":
        assert result.items[2].surface.kind == "cylinder"
        assert abs(result.items[2].surface.radius - size) < 0.01
    if kind == "chamfer":
        assert result.items[2].surface.kind == "plane"


def test_edge_values_decide_where_geometry_cannot():
    """The same strip, once with the edge in its middle and once at its borders."""
    kept = {}
    for kind in ("rounded", "fillet"):
        rng = np.random.default_rng(1)
        points = cloud([*two_walls(rng, 0.028), strip(rng, 0.028, kind)], rng)
        kept[kind] = len(primitives_of(points, DEFAULT).items)
    assert kept == {"rounded": 2, "fillet": 3}


@pytest.mark.parametrize("seed", range(3))
def test_the_straight_end_of_a_bent_pipe_is_no_strip_between_bend_and_flange(seed):
    """The bend explains half of it, and edges show where it is turned most: at its other end."""
    rng = np.random.default_rng(seed)
    bend, tube, length = 0.43, 0.2, 0.11

    def ring(count):
        turn = rng.uniform(0, 2 * np.pi, count)[:, None]
        return np.cos(turn) * X + np.sin(turn) * Y

    around, at = ring(9000), rng.uniform(0, np.pi / 2, 9000)[:, None]
    inward = np.cos(at) * X - np.sin(at) * Z  # from the middle of the pipe towards the bend's axis
    out = around[:, :1] * inward + around[:, 1:2] * Y
    torus = bend * X - bend * inward + tube * out + 0.2 * Z, out, np.zeros(9000)
    around, up = ring(1600), rng.uniform(0, length, 1600)
    straight = tube * around + (0.2 - length + up)[:, None] * Z, around, np.clip(1 - up / 0.03, 0, 1)
    flange = (tube + rng.uniform(0, 0.2, 4000))[:, None] * ring(4000) + (0.2 - length) * Z, np.tile(Z, (4000, 1))
    found = [p.surface for p in primitives_of(cloud([torus, straight, flange], rng, sigma=0.001), DEFAULT).items]
    assert [s.kind for s in found] == ["torus", "cylinder", "plane"]
    assert found[1].radius == pytest.approx(tube, abs=0.003)


@pytest.mark.parametrize("seed", range(3))
def test_a_large_fillet_is_a_face_whatever_edges_the_images_show(seed):
    rng = np.random.default_rng(seed)
    points = cloud([*two_walls(rng, 0.07), strip(rng, 0.07, "rounded")], rng, sigma=0.001)
    found = [p.surface for p in primitives_of(points, DEFAULT).items]
    assert [s.kind for s in found] == ["plane", "plane", "cylinder"]
    assert found[2].radius == pytest.approx(0.07, abs=0.01)


def test_chamfer_pieces_of_one_cone_become_one_primitive():
    rng = np.random.default_rng(2)
    whole = cone(np.full(3, 0.5), Z, 0.45, np.pi / 4)
    pieces = [sample(plane(np.array([0.5, 0.5, 0.4]), -Z), 2000, rng, height=0.6)]
    x, y, _ = whole.frame()
    for k in range(6):
        turn = rng.uniform(-0.35, 0.35, 150) + k * np.pi / 3
        radial = np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * y
        up = rng.uniform(-0.025, 0.025, 150)[:, None]
        points = whole.origin + (whole.radius + up) * radial + up * Z
        pieces.append((points, whole.normals(points)))
    result = primitives_of(cloud(pieces, rng), DEFAULT)
    assert sorted(p.surface.kind for p in result.items) == ["cone", "plane"]
    found = next(p for p in result.items if p.surface.kind == "cone")
    assert len(found.support) > 850
    assert np.abs(found.surface.signed_distance(np.concatenate([p[0] for p in pieces[1:]]))).mean() < 0.001
    assert np.degrees(found.surface.angle) == pytest.approx(45, abs=0.5)


@pytest.mark.parametrize("seed", range(3))
def test_pieces_too_short_to_show_their_bend_join_the_cone_of_the_others(seed):
    """Inside of their rounded borders a nut's chamfers turn by 6 to 9 degrees, as a plane that bulges may."""
    rng = np.random.default_rng(seed)
    whole = cone(np.full(3, 0.5), Z, 0.45, np.pi / 4)
    top = sample(plane(np.array([0.5, 0.5, 0.55]), Z), 2000, rng, height=0.6)
    pieces = [
        (*top, np.zeros(2000)),
        (*sample(cylinder(np.full(3, 0.5), Z, 0.2, flipped=True), 1500, rng), np.zeros(1500)),
    ]
    x, y, _ = whole.frame()
    for k in range(6):
        wide = 0.13 if k % 3 == 0 else 0.28
        turn = rng.uniform(-wide, wide, 250)
        radial = np.cos(turn + k * np.pi / 3)[:, None] * x + np.sin(turn + k * np.pi / 3)[:, None] * y
        up = rng.uniform(-0.025, 0.025, 250)[:, None]
        points = whole.origin + (whole.radius + up) * radial + up * Z
        pieces.append((points, whole.normals(points), np.clip(3 * np.abs(turn) / wide - 1.5, 0, 1)))
    result = primitives_of(cloud(pieces, rng, sigma=0.0007, turn=0.03), DEFAULT)
    assert sorted(p.surface.kind for p in result.items) == ["cone", "cylinder", "plane"]
    found = next(p.surface for p in result.items if p.surface.kind == "cone")
    assert np.degrees(found.angle) == pytest.approx(45, abs=0.5)


def test_two_holes_of_one_size_stay_two():
    rng = np.random.default_rng(3)
    pieces = [sample(plane(np.array([0.5, 0.5, 0.65]), Z), 3000, rng, height=0.9)]
    pieces += [sample(cylinder([x, 0.5, 0.5], Z, 0.1, flipped=True), 800, rng) for x in (0.3, 0.7)]
    result = primitives_of(cloud(pieces, rng), DEFAULT)
    assert [p.surface.kind for p in result.items] == ["plane", "cylinder", "cylinder"]
    assert all(p.surface.flipped for p in result.items[1:])
    assert result.items[1].surface.radius == pytest.approx(result.items[2].surface.radius, abs=1e-6)


def test_a_known_direction_guides_a_badly_seen_bore():
    """A bore whose wall bulges smoothly by several noises stays a cylinder along the plate's normal."""
    rng = np.random.default_rng(4)
    bore = cylinder(np.full(3, 0.5), Z, 0.2, flipped=True)
    points, normals = sample(bore, 1500, rng)
    bulge = 0.008 * np.sin(np.pi * (points[:, 2] - 0.35) / 0.3)
    top = sample(plane(np.array([0.5, 0.5, 0.65]), Z), 3000, rng, height=0.9)
    side = sample(plane(np.array([0.95, 0.5, 0.5]), X), 3000, rng, height=0.9)
    result = primitives_of(cloud([top, side, (points + bulge[:, None] * normals, normals)], rng), DEFAULT)
    found = result.items[2].surface
    assert found.kind == "cylinder"
    assert abs(found.axis @ Z) > np.cos(np.radians(0.5))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_floor_of_a_recess_in_a_shaft_is_a_plane_though_points_are_noisy(seed):
    """A flat .1 wide in a shaft: a cylinder about the shaft's axis has fewer parameters, but its normals differ."""
    rng = np.random.default_rng(seed)
    shaft = sample(cylinder(np.full(3, 0.5), Z, 0.3), 4000, rng)
    end = sample(plane(np.array([0.5, 0.5, 0.8]), Z), 2000, rng)
    flat = np.column_stack([np.full(160, 0.75), 0.45 + 0.1 * rng.random(160), 0.4 + 0.2 * rng.random(160)])
    pieces = [shaft, end, (flat, np.tile(X, (160, 1)))]
    result = primitives_of(cloud(pieces, rng, sigma=0.005, turn=0.2), DEFAULT)
    assert [p.surface.kind for p in result.items if 2 in (p.label,)] == ["plane"]


def test_rank_correlation_agrees_with_scipy():
    rng = np.random.default_rng(5)
    first, second = rng.normal(size=50).round(1), rng.normal(size=50).round(1)
    assert rank_correlation(first, second) == pytest.approx(spearmanr(first, second)[0])
    assert rank_correlation(np.ones(5), np.arange(5.0)) == 0
