"""The kernel for depths by parallax, against the same fits by numpy, place by place."""

import numpy as np
import pytest
from brepgaussian.splatting import parallax
from brepgaussian.splatting.parallax import Looks, depths

PIXEL, TOLERANCE = 0.004, 1.5


def scene(seed, count=4000):
    """Rays at two bent faces, some of the greys wrong."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(0, 0.1, (count, 3)) * [1, 1, 0.02]
    normals = np.array([0, 0, 1.0]) + 0.05 * rng.normal(size=(count, 3))
    directions = rng.normal(size=(count, 3)) - [0, 0, 2.0]
    directions[:, 2] = -np.abs(directions[:, 2]) - 0.3
    grey = 100 + 900 * points[:, 0] + 3 * directions[:, 1] + rng.normal(size=count)
    grey[::17] += 30
    normals, directions = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (normals, directions))
    return Looks(rng.integers(0, 2, count), points, normals, directions, grey)


def fitted(design, grey, weights):
    for _ in range(parallax._REWEIGHTINGS):
        gram = (design.T * weights) @ design + parallax._DAMPING * np.eye(design.shape[1])
        solution = np.linalg.solve(gram, design.T @ (weights * grey))
        weights = 1 / (1 + ((grey - design @ solution) / TOLERANCE) ** 2)
    return solution, weights


def depth_of(points, normals, directions, grey):
    """Depth, its error and the least facing of the rays of one place."""
    up = normals.sum(axis=0)
    up /= np.linalg.norm(up)
    first = np.cross(up, [1.0, 0, 0] if abs(up[0]) < 0.9 else [0, 1.0, 0])
    axes = np.array([first / np.linalg.norm(first), np.cross(up, first / np.linalg.norm(first))])
    flat = np.column_stack([np.ones(len(grey)), (points - points.mean(axis=0)) @ axes.T / PIXEL])
    slant = directions @ axes.T / -np.einsum("ij,ij->i", normals, directions)[:, None]
    solution, weights = fitted(flat, grey, np.ones(len(grey)))
    for _ in range(parallax._ROUNDS):
        shift = slant @ solution[1:3]
        design = np.column_stack([flat, shift - np.average(shift, weights=weights)])
        solution, weights = fitted(design, grey, weights)
    spread = max(np.sqrt(np.average((grey - design @ solution) ** 2, weights=weights)), parallax._ROUNDING * TOLERANCE)
    gram = (design.T * weights) @ design + parallax._DAMPING * np.eye(4)
    return solution[3], spread * np.sqrt(np.linalg.inv(gram)[3, 3]), (normals @ up).min()


@pytest.mark.parametrize("seed", range(3))
def test_the_kernel_fits_as_numpy_does(seed):
    seen = scene(seed)
    found, rows = depths(seen, PIXEL, TOLERANCE), seen.places(parallax.PLACE_PX * PIXEL)
    assert len(found.places) == len(np.unique(rows, axis=0))
    for place, depth, sigma, told in zip(found.places, found.depth, found.sigma, found.told, strict=True):
        mine = (rows == place).all(axis=1)
        parts = (seen.points[mine], seen.normals[mine], seen.directions[mine], seen.grey[mine])
        if mine.sum() < parallax._LEAST_RAYS:
            assert not told
            continue
        wanted, error, facing = depth_of(*parts)
        assert depth == pytest.approx(wanted, abs=1e-8)
        assert sigma == pytest.approx(error, rel=1e-8)
        assert told == (facing > parallax._FLAT and error < parallax._SURE_PX)
    assert found.told.any()


def test_no_rays_have_no_places():
    none = np.zeros((0, 3))
    found = depths(Looks(np.zeros(0, np.int64), none, none, none, np.zeros(0)), PIXEL, TOLERANCE)
    assert len(found.places) == 0
    assert not found.told.any()
