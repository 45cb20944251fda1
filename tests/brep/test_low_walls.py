"""Strips of a low round wall, against pads whose walls are known."""

import itertools

import numpy as np
import pytest
from brepgaussian.brep.low_walls import low_walls
from brepgaussian.brep.patches import Patch
from brepgaussian.geometry.surfaces import cone, cylinder, plane

RADIUS, REACH = 0.3, 0.014
UP = np.array([0.0, 0.0, 1.0])


def patch(number, surface, points, normals=None):
    normals = surface.normals(points) if normals is None else normals
    return Patch(surface, number, points, normals, REACH, surface.rms(points))


def pad(rng, high=0.035, turns=(0, 2 * np.pi), flipped=False, middle=(0.1, -0.2), one=False):
    """A base, a round top `high` above it, and strips of the wall between, with a skirt around its foot."""
    base = np.column_stack([rng.uniform(-1, 1, (8000, 2)), np.zeros(8000)])
    flat = rng.uniform(-RADIUS, RADIUS, (3000, 2))
    top = np.column_stack(
        [flat[np.hypot(*flat.T) < RADIUS] + middle, np.full((np.hypot(*flat.T) < RADIUS).sum(), high)]
    )
    made = [patch(0, plane([0, 0, 0], UP), base), patch(1, plane([0, 0, high], UP), top)]
    edges = np.linspace(*turns, 8)
    for k, (first, last) in enumerate(itertools.pairwise(edges)):
        angle, height = rng.uniform(first, last, 60), rng.uniform(0, high, 60)
        out = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(60)])
        away = RADIUS + np.abs(rng.normal(size=60)) * 0.006 * (1 - height / high)
        points = away[:, None] * out + [*middle, 0] + height[:, None] * UP
        flat_one = plane(points.mean(axis=0), out.mean(axis=0) / np.linalg.norm(out.mean(axis=0)))
        surface = flat_one if k % 2 else cone(points.mean(axis=0), UP, 0.5, 0.5)
        made.append(patch(2 + k, surface, points, -out if flipped else out))
    if one:
        whole = np.concatenate([p.xyz for p in made[2:]])
        made = [*made[:2], patch(2, cylinder([*middle, 0], UP, RADIUS), whole), patch(3, made[2].surface, made[2].xyz)]
    return made


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("flipped", [False, True])
def test_strips_all_around_are_one_wall(seed, flipped):
    (change,) = low_walls(pad(np.random.default_rng(seed), flipped=flipped))
    assert change.gone == tuple(range(2, 9))
    (wall,) = change.new
    assert wall.surface.kind == "cylinder"
    assert wall.surface.flipped == flipped
    assert wall.surface.radius == pytest.approx(RADIUS, abs=0.004)
    assert np.linalg.norm(wall.surface.origin[:2] - [0.1, -0.2]) < 0.004
    assert len(wall.xyz) == 7 * 60


def test_strips_around_most_of_it_are_one_wall():
    (change,) = low_walls(pad(np.random.default_rng(4), turns=(0, 1.4 * np.pi)))
    assert change.new[0].surface.radius == pytest.approx(RADIUS, abs=0.006)


@pytest.mark.parametrize("case", [{"high": 0.2}, {"turns": (0, np.pi)}, {"one": True}])
def test_a_high_wall_an_arc_and_one_that_is_known_stay(case):
    assert low_walls(pad(np.random.default_rng(5), **case)) == []


def test_the_walls_of_a_square_pad_stay():
    rng, high, half = np.random.default_rng(6), 0.035, 0.25
    made = pad(rng)[:2]
    for k, (axis, way) in enumerate(((0, 1), (0, -1), (1, 1), (1, -1))):
        points = np.empty((120, 3))
        points[:, axis], points[:, 1 - axis] = way * half, rng.uniform(-half, half, 120)
        points[:, 2] = rng.uniform(0, high, 120)
        made.append(patch(2 + k, plane(points[0], way * np.eye(3)[axis]), points))
    assert low_walls(made) == []
