"""Patches carried by a part's symmetries to places that worse ones explain, on clouds of known surfaces."""

import numpy as np
import pytest
from brepgaussian.brep.job import Job
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.symmetry import carried, symmetric
from brepgaussian.geometry.fit_robust import fit_robust
from brepgaussian.geometry.surfaces import cylinder, plane
from brepgaussian.settings.brep import BrepSettings
from scipy.spatial.transform import Rotation

NOISE, REACH, SPACING = 0.001, 0.012, 0.008
UP = np.array([0, 0, 1.0])


def job_of(parts, turn, seed, noise=NOISE):
    """A job of (surface or kind to fit, xyz, normals), turned and noisy."""
    rng, patches = np.random.default_rng(seed), []
    for number, (surface, xyz, normals) in enumerate(parts):
        xyz = (xyz - 0.5) @ turn.T + 0.5 + noise * rng.normal(size=xyz.shape)
        normals = normals @ turn.T
        if isinstance(surface, str):
            found = fit_robust(surface, xyz, normals, NOISE, initial=None, rng=rng)[0]
        else:
            found = type(surface)(
                **vars(surface) | {"origin": turn @ (surface.origin - 0.5) + 0.5, "axis": turn @ surface.axis}
            )
        patches.append(Patch(found, number, xyz, normals, REACH, found.rms(xyz)))
    return Job(tuple(patches), (), np.zeros((0, 3)), (), None, BrepSettings())


def grid(u, v):
    """(N, 2) places SPACING apart."""
    steps = [np.arange(low + SPACING / 2, high, SPACING) for low, high in (u, v)]
    return np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 2)


def flat(normal, offset, axes, u, v):
    """A plane's surface, points and normals; axes are the unit vectors of u and v."""
    normal = np.asarray(normal, float)
    xyz = offset * normal + grid(u, v) @ np.asarray(axes, float)
    return plane(xyz.mean(axis=0), normal), xyz, np.tile(normal, (len(xyz), 1))


def hole(x, y, radius=0.06, depth=0.2):
    places = grid((0, 2 * np.pi * radius), (0.6 - depth, 0.6))
    angle = places[:, 0] / radius
    out = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))])
    xyz = np.array([x, y, 0]) + radius * out + places[:, 1:] * UP
    return cylinder(np.array([x, y, 0.5]), UP, radius, flipped=True), xyz, -out


def box():
    X, Y, Z = np.eye(3)
    low, high = (0.1, 0.9), (0.2, 0.8)
    return [
        flat(Z, 0.6, [X, Y], low, high), flat(-Z, -0.4, [X, Y], low, high),
        flat(X, 0.9, [Y, Z], high, (0.4, 0.6)), flat(-X, -0.1, [Y, Z], high, (0.4, 0.6)),
        flat(Y, 0.8, [X, Z], low, (0.4, 0.6)), flat(-Y, -0.2, [X, Z], low, (0.4, 0.6)),
    ]  # fmt: skip


def slot(x):
    """Walls and floor of a slot across the top at x."""
    X, Y, Z = np.eye(3)
    return [
        flat(X, x - 0.03, [Y, Z], (0.2, 0.8), (0.54, 0.6)), flat(-X, -x - 0.03, [Y, Z], (0.2, 0.8), (0.54, 0.6)),
        flat(Z, 0.54, [X, Y], (x - 0.03, x + 0.03), (0.2, 0.8)),
    ]  # fmt: skip


def merged(parts, kind):
    return kind, np.concatenate([p[1] for p in parts]), np.concatenate([p[2] for p in parts])


@pytest.mark.parametrize("seed", range(3))
def test_a_slot_under_one_label_is_like_the_one_across_the_mirror(seed):
    turn = Rotation.random(random_state=seed).as_matrix()
    job = job_of([*box(), *slot(0.25), merged(slot(0.75), "cylinder")], turn, seed)
    (found,) = symmetric(job)
    assert sorted(p.surface.kind for p in found.patches) == ["plane"] * 12
    mended = job_of([*slot(0.75)], turn, seed).patches
    for wall in mended:
        best = min(
            found.patches, key=lambda p: p.surface.rms(wall.xyz) - 0.01 * float(p.surface.axis @ wall.surface.axis)
        )
        assert best.surface.rms(wall.xyz) < 2 * NOISE
        assert best.surface.axis @ wall.surface.axis > 0.9999
    assert len({p.primitive for p in found.patches}) == 12


@pytest.mark.parametrize("seed", range(3))
def test_a_hole_in_two_pieces_is_like_the_others_of_its_ring(seed):
    turn = Rotation.random(random_state=seed + 10).as_matrix()
    angles = np.arange(6) * np.pi / 3
    disc = flat(UP, 0.6, np.eye(3)[:2], (0.1, 0.9), (0.1, 0.9))
    keep = np.hypot(*(disc[1][:, :2] - 0.5).T) < 0.4
    top = disc[0], disc[1][keep], disc[2][keep]
    below = plane(np.array([0.5, 0.5, 0.4]), -UP), top[1] - 0.2 * UP, -top[2]
    rim = hole(0.5, 0.5, radius=0.4)
    rim = cylinder(np.array([0.5, 0.5, 0.5]), UP, 0.4), rim[1], -rim[2]
    holes = [hole(0.5 + 0.28 * np.cos(a), 0.5 + 0.28 * np.sin(a)) for a in angles]
    _, xyz, normals = holes[2]
    half = normals[:, 0] > 0
    pieces = [("plane", xyz[k], normals[k]) for k in (half, ~half)]
    job = job_of([top, below, rim, *holes[:2], *holes[3:], *pieces], turn, seed)
    (found,) = symmetric(job)
    kinds = sorted(p.surface.kind for p in found.patches)
    assert kinds == ["cylinder"] * 7 + ["plane"] * 2
    (wall,) = job_of([holes[2]], turn, seed).patches
    assert min(p.surface.rms(wall.xyz) for p in found.patches) < 2 * NOISE


@pytest.mark.parametrize("seed", range(3))
def test_a_slot_of_a_row_is_like_the_next_one(seed):
    """No mirror carries it onto another one."""
    turn = Rotation.random(random_state=seed + 30).as_matrix()
    row = [wall for x in (0.22, 0.36, 0.5) for wall in slot(x)]
    job = job_of([*box(), *row, merged(slot(0.64), "cylinder")], turn, seed)
    (found,) = symmetric(job)
    assert sorted(p.surface.kind for p in found.patches) == ["plane"] * 18
    for wall in job_of([*slot(0.64)], turn, seed).patches:
        alike = [p.surface for p in found.patches if p.surface.axis @ wall.surface.axis > 0.9999]
        assert min(s.rms(wall.xyz) for s in alike) < 2 * NOISE


def test_every_place_is_a_change_of_its_own():
    turn = Rotation.random(random_state=40).as_matrix()
    parts = [*box(), *slot(0.25), merged(slot(0.75), "cylinder"), hole(0.5, 0.35, 0.05), hole(0.5, 0.65, 0.05)]
    _, xyz, normals = parts[-1]
    pieces = [("plane", xyz[k], normals[k]) for k in (normals[:, 0] > 0, normals[:, 0] <= 0)]
    both, *single = carried(job_of([*parts[:-1], *pieces], turn, 0).patches)
    assert len(both.gone) == 3
    assert sorted(c.gone for c in single) == [(9,), (11, 12)]
    assert sorted(p.primitive for c in single for p in c.new if p.surface.kind == "cylinder") == [11]


@pytest.mark.parametrize("seed", range(2))
def test_holes_apart_by_another_step_than_the_corners_stay(seed):
    """Four holes and, nearly as far apart, four rounded corners: the corners' step is none of the holes."""
    turn = Rotation.random(random_state=seed + 50).as_matrix()
    holes = [hole(x, y) for x in (0.2, 0.8) for y in (0.3, 0.7)]
    pegs = [hole(x, y, 0.05) for x in (0.35, 0.65) for y in (0.3, 0.708)]
    assert carried(job_of([*box(), *holes, *pegs], turn, seed).patches) == []


@pytest.mark.parametrize("seed", range(2))
def test_what_is_right_or_is_not_symmetric_stays(seed):
    turn = Rotation.random(random_state=seed + 20).as_matrix()
    assert list(symmetric(job_of([*box(), *slot(0.25), *slot(0.75)], turn, seed))) == []
    assert list(symmetric(job_of([*box(), hole(0.3, 0.35), hole(0.6, 0.6, 0.05)], turn, seed))) == []


def test_points_without_noise_are_no_fault():
    assert list(symmetric(job_of([*box(), *slot(0.25), *slot(0.75)], np.eye(3), 0, noise=0.0))) == []
