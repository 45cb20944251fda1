"""The compiled costs of rays through an opening against slow, plain NumPy."""

import numpy as np
import pytest
from brepgaussian.splatting.concave.prism import signed_outline
from brepgaussian.splatting.concave.radiance import _CAP, _RIDGE, LEAST_PASSING, differences, disagreement
from brepgaussian.splatting.concave.rays import Rays, exits, exits_of_dome
from scipy import ndimage

TOLERANCE = 2.0


def random_rays(rng, count, crossings=3):
    depths = np.sort(rng.uniform(0, 40, (count, crossings)), axis=1)
    depths[rng.random((count, crossings)) < 0.3] = np.inf
    grey = np.where(rng.random(count) < 0.2, -1.0, rng.uniform(90, 110, count))
    return Rays(
        rng.uniform(-3, 60, (count, 2)),
        rng.normal(0, 0.5, (count, 2)),
        grey,
        np.zeros(count, np.int64),
        np.sort(depths, axis=1),
        rng.random(count) < 0.6,
        rng.uniform(0, 2, count),
    )


def fitted_slowly(place, local, grey, tolerance):
    """A weighted least-squares fit for each place, one by one."""
    terms = 1 + local.shape[1]
    difference, enough = np.full(len(grey), _CAP), np.zeros(len(grey), bool)
    for key in np.unique(place, axis=0):
        rows = np.flatnonzero((place == key).all(axis=1))
        if len(rows) < (3 if terms == 1 else 8):
            continue
        design = np.column_stack([np.ones(len(rows)), local[rows]])
        weight = np.ones(len(rows))
        for _ in range(3):
            ridged = np.vstack([design * np.sqrt(weight)[:, None], np.diag(np.sqrt(_RIDGE[:terms]))])
            target = np.append(grey[rows] * np.sqrt(weight), np.zeros(terms))
            off = (grey[rows] - design @ np.linalg.lstsq(ridged, target, rcond=None)[0]) / tolerance
            weight = 1 / (1 + (off / _CAP) ** 2)
        difference[rows], enough[rows] = np.minimum(np.abs(off), _CAP), True
    return difference, enough


@pytest.mark.parametrize("terms", [1, 4])
@pytest.mark.parametrize(("count", "sides"), [(4000, 5), (300, 12), (7, 1), (1, 1), (0, 1)])
def test_differences_are_those_of_a_fit_to_each_place(count, sides, terms):
    rng = np.random.default_rng(count + terms)
    place = rng.integers(-sides, sides, (count, 4)) * [1, 1, 1, 0]
    local, grey = rng.uniform(-0.5, 0.5, (count, terms - 1)), rng.normal(100, 3, count)
    difference, enough = differences(place, local, grey, TOLERANCE)
    expected, told = fitted_slowly(place, local, grey, TOLERANCE)
    np.testing.assert_array_equal(enough, told)
    np.testing.assert_allclose(difference, expected, atol=1e-9)


def met_slowly(crossings, inside, depth, free):
    """Where one ray meets the hull that is free down to a depth."""
    ahead = [c for c in crossings if c >= depth] + [np.inf, np.inf]
    within = (len(crossings) - (len(ahead) - 2) + inside) % 2 == 1
    if within and not free:
        return depth
    return ahead[1] if within else ahead[0]


@pytest.mark.parametrize("through", [False, True])
@pytest.mark.parametrize("even", [False, True])
def test_disagreement_is_that_of_what_each_ray_meets(through, even):
    rng = np.random.default_rng(11)
    rays, depth, side = random_rays(rng, 6000), 12.0, 6.0
    ends = np.where(rng.random(len(rays)) < 0.2, -1.0, rng.uniform(0, 30, len(rays)))
    against, told = disagreement(rays, ends, depth, TOLERANCE, through, side, even)
    kind = np.where(ends < 0, 0, np.where(ends < depth, 1, 2))
    sunk = np.empty(len(rays))
    for i, (end, what) in enumerate(zip(ends, kind.copy(), strict=True)):
        walls = min(max(end, 0), depth)
        sunk[i] = met_slowly(rays.crossings[i], rays.inside[i], walls, what == 2 and through)
        sunk[i] = rays.entry[i] if what == 0 else sunk[i]
        kind[i] = 3 if what and sunk[i] > walls else what
    empty, background = np.isinf(sunk), rays.grey < 0
    expected = np.where(empty & background, 0.0, _CAP)
    surface = ~(empty | background)
    at = np.column_stack([rays.start + sunk[:, None] * rays.sideways, sunk])[surface]
    place = np.column_stack([np.floor(at / side), kind[surface]]).astype(int)
    local = at / side - place[:, :3] - 0.5
    fits = fitted_slowly(place, local[:, : 0 if even else 3], rays.grey[surface], TOLERANCE)
    expected[surface] = fits[0]
    known = empty | background
    known[surface] = fits[1]
    np.testing.assert_array_equal(told, known)
    np.testing.assert_allclose(against, expected, atol=1e-9)


def test_a_hole_through_which_no_ray_shows_anything_tells_nothing():
    rng = np.random.default_rng(5)
    rays = random_rays(rng, LEAST_PASSING - 1)
    against, told = disagreement(rays, np.full(len(rays), 50.0), 12.0, TOLERANCE, True)
    assert (against == _CAP).all()
    assert told.all()


def traced_slowly(rays, i, room, walls):
    """One ray's way to the wall, in steps that cannot pass it."""
    speed = max(np.linalg.norm(rays.sideways[i]), 1e-3) + walls.get("draft", 0.0)
    depth = rays.entry[i]
    for _ in range(256):
        left = room(i, np.array([depth]))[0]
        if left <= 0.05 or depth >= 40:
            break
        depth += left / speed
    return min(depth, 40)


@pytest.mark.parametrize("walls", [{}, {"grow": 1.5}, {"draft": 0.2}, {"draft": 0.5, "sink": 3.0}])
def test_exits_are_where_rays_cross_the_outline(walls):
    rng = np.random.default_rng(8)
    rows, columns = np.mgrid[:60, :50]
    outline = (rows - 30) ** 2 + (columns - 25) ** 2 < 300
    rays = random_rays(rng, 1500)
    found = exits(rays, outline, 40.0, **walls)
    clear = walls.get("grow", 0.0) - signed_outline(outline)

    def room(i, depth):
        position = rays.start[i] + depth[:, None] * rays.sideways[i]
        shrunk = np.minimum(walls.get("draft", 0.0) * depth, walls.get("sink", np.inf))
        return ndimage.map_coordinates(clear, position.T, order=1, mode="nearest") - shrunk

    for i, end in enumerate(found):
        start = room(i, rays.entry[[i]])[0]
        assert (end < 0) == (start < 0)
        if start < 0:
            continue
        assert room(i, np.linspace(rays.entry[i], end, 50)).min() > -0.3  # no wall is passed: its staircase is smoothed
        assert end == pytest.approx(traced_slowly(rays, i, room, walls), abs=1e-9)


@pytest.mark.parametrize(("top", "depth"), [(0.0, 6.0), (0.0, 30.0), (4.0, 15.0)])
def test_rays_meet_a_dome_where_small_steps_leave_it(top, depth):
    rays, center, radius = random_rays(np.random.default_rng(7), 2000), np.array([28.0, 31.0]), 20.0
    rows, columns = np.mgrid[:60, :60]
    outline = np.hypot(rows - center[0], columns - center[1]) < radius
    straight = exits(rays, outline, 60.0)
    found = exits_of_dome(rays, straight, center, top, radius, depth)
    high = min(depth - top, radius)
    sphere = (radius**2 + high**2) / (2 * high)
    for start, side, wall, met in list(zip(rays.start, rays.sideways, straight, found, strict=True))[::7]:
        if wall < 0:
            assert met < 0
            continue
        steps = np.arange(depth - high, depth, 0.01)
        away = np.linalg.norm(start + steps[:, None] * side - center, axis=1)
        left = steps[np.hypot(away, steps - depth + sphere) > sphere]
        expected = min(wall, left[0] if len(left) else depth)
        assert met == pytest.approx(expected, abs=0.6)  # the wall is a staircase of cells
