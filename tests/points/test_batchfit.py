"""Cones that two strips of planes pass for."""

import numpy as np
import pytest
from brepgaussian.points import batchfit
from brepgaussian.points.batch_rows import evaluate, new_rows
from brepgaussian.points.batchfit import Noise, Sets

NOISE = Noise(0.0015, np.radians(2.5))


def sets_of(points, normals):
    return Sets(points[None], normals[None], np.full((1, len(points), 3), np.nan), np.ones((1, len(points))))


def mean_cost(kind, sets):
    return float(batchfit.costs(kind, batchfit.fit(kind, sets, NOISE), sets, NOISE).mean())


def test_the_sides_of_a_thin_plates_corner_are_no_cone():
    rng = np.random.default_rng(3)
    along, high = rng.uniform(0.02, 1, 400), rng.uniform(-0.035, 0.035, 400)
    first = np.arange(400) < 200
    zero = np.zeros(400)
    points = np.where(first[:, None], np.column_stack([along, zero, high]), np.column_stack([zero, along, high]))
    normals = np.where(first[:, None], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0])
    points += rng.normal(0, NOISE.distance, points.shape) * np.abs(normals)
    cone = new_rows(1, np.zeros(3), np.array([1.0, 1, 0]) / np.sqrt(2))
    cone[:, 8] = np.pi / 4  # passes within the noise, but for the corner
    assert np.sqrt(np.mean(evaluate("cone", cone, points[None])[0] ** 2)) < 2 * NOISE.distance
    assert batchfit.folded(cone, sets_of(points, normals), NOISE).all()
    assert mean_cost("cone", sets_of(points, normals)) > 4.0
    for side in (first, ~first):
        assert mean_cost("plane", sets_of(points[side], normals[side])) < 2.0


@pytest.mark.parametrize("arc", [2 * np.pi, np.pi, np.radians(100), np.radians(50)])
@pytest.mark.parametrize("start", [0.0, 0.1])
def test_pieces_of_a_cone_are(arc, start):
    """Its tip, too."""
    rng = np.random.default_rng(4)
    turn, slant, angle = rng.uniform(-arc / 2, arc / 2, 400), rng.uniform(start, 0.3, 400), np.radians(40)
    out = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(400)])
    points = np.sin(angle) * slant[:, None] * out + np.cos(angle) * slant[:, None] * [0, 0, 1]
    normals = np.cos(angle) * out - np.sin(angle) * np.array([0, 0, 1.0])
    points += rng.normal(0, NOISE.distance, (400, 1)) * normals
    assert mean_cost("cone", sets_of(points, normals)) < 2.0


def test_a_cone_with_two_slots_is_one():
    rng = np.random.default_rng(5)
    turn = rng.uniform(-np.radians(60), np.radians(60), 400) + np.where(np.arange(400) % 2, np.pi, 0)
    slant, angle = rng.uniform(0.0, 0.3, 400), np.radians(50)
    out = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(400)])
    points = np.sin(angle) * slant[:, None] * out + np.cos(angle) * slant[:, None] * [0, 0, 1]
    normals = np.cos(angle) * out - np.sin(angle) * np.array([0, 0, 1.0])
    assert mean_cost("cone", sets_of(points, normals)) < 2.0
