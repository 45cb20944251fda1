"""Circles next to points, against circles that are known."""

import numpy as np
import pytest
from brepgaussian.geometry.circles import circle_next_to, circle_of_most, circle_through

MIDDLE, RADIUS = np.array([0.4, -1.2]), 0.7


def on_circle(rng, count=200, turn=2 * np.pi):
    angle = rng.uniform(0, turn, count)
    return MIDDLE + RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("turn", [2 * np.pi, 1.0])
def test_points_of_a_circle_give_it(seed, turn):
    points = on_circle(np.random.default_rng(seed), turn=turn)
    for middle, radius in (circle_next_to(points), circle_through(points), circle_of_most(points, 0.01)):
        np.testing.assert_allclose(middle, MIDDLE, atol=1e-9)
        assert radius == pytest.approx(RADIUS)


def test_points_without_weight_do_not_count():
    rng = np.random.default_rng(4)
    points = np.concatenate([on_circle(rng), rng.uniform(-3, 3, (200, 2))])
    middle, radius = circle_next_to(points, np.repeat([1.0, 0.0], 200))
    np.testing.assert_allclose(middle, MIDDLE, atol=1e-9)
    assert radius == pytest.approx(RADIUS)


@pytest.mark.parametrize("seed", range(3))
def test_strays_hardly_move_the_circle_of_most(seed):
    rng = np.random.default_rng(seed)
    points = np.concatenate([on_circle(rng) + 0.001 * rng.normal(size=(200, 2)), rng.uniform(-2, 2, (40, 2))])
    middle, radius = circle_of_most(points, 0.01)
    np.testing.assert_allclose(middle, MIDDLE, atol=0.004)
    assert radius == pytest.approx(RADIUS, abs=0.004)


def test_a_line_and_two_points_lie_on_no_circle():
    line = np.column_stack([np.arange(5.0), 2 * np.arange(5.0)])
    assert circle_through(line) is None
    assert circle_through(line[:2]) is None


@pytest.mark.parametrize("seed", range(3))
def test_a_skirt_on_one_side_hardly_moves_the_circle_of_most(seed):
    rng = np.random.default_rng(seed)
    ring = on_circle(rng, 300) + 0.003 * rng.normal(size=(300, 2))
    skirt = MIDDLE + (ring[:120] - MIDDLE) * rng.uniform(1.05, 1.3, (120, 1))
    middle, radius = circle_of_most(np.concatenate([ring, skirt]), 0.02)
    np.testing.assert_allclose(middle, MIDDLE, atol=0.003)
    assert radius == pytest.approx(RADIUS, abs=0.003)
