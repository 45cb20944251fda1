import numpy as np
import pytest
from brepgaussian.masks.steps import crop, half_disks, step_strength, without_shading
from brepgaussian.views.noise import fill_outside


def slow_step(grey, inside, radius, row, column):
    """The definition, pixel by pixel."""
    best = 0.0
    for halves in half_disks(radius):
        means = []
        for half in halves:
            values, total = [], half.sum()
            for dy, dx in np.argwhere(half > 0) - radius:
                y, x = row + dy, column + dx
                if 0 <= y < grey.shape[0] and 0 <= x < grey.shape[1] and inside[y, x]:
                    values.append(grey[y, x])
            means.append(np.mean(values) if len(values) >= 0.35 * total else None)
        if None not in means:
            best = max(best, abs(means[0] - means[1]))
    return best


def test_step_strength_equals_its_definition():
    rng = np.random.default_rng(5)
    grey = rng.uniform(0, 255, (24, 27)).astype(np.float32)
    inside = np.zeros(grey.shape, bool)
    inside[3:20, 5:24] = True
    strength, _ = step_strength(grey, inside, 3)
    for row, column in rng.integers([0, 0], grey.shape, (40, 2)):
        wanted = slow_step(grey, inside, 3, row, column) if inside[row, column] else 0
        assert strength[row, column] == pytest.approx(wanted, abs=1e-3)


def test_a_step_keeps_its_height_and_a_slope_has_none():
    inside = np.ones((60, 80), bool)
    step = np.zeros(inside.shape, np.float32)
    step[:, 40:] = 12
    slope = np.broadcast_to(np.arange(80, dtype=np.float32) * 1.5, inside.shape).copy()
    ridge = without_shading(step_strength(step + slope, inside, 3)[0], 3)
    assert ridge[30, 38:42].max() == pytest.approx(12, abs=1)
    assert ridge[10:50, 15:30].max() < 0.1


def test_direction_of_a_line():
    inside = np.ones((40, 40), bool)
    grey = np.zeros(inside.shape, np.float32)
    grey[20:] = 50  # a horizontal line
    assert step_strength(grey, inside, 3)[1][20, 20] == 0
    assert step_strength(grey.T.copy(), inside, 3)[1][20, 20] == 4


def test_crop_ignores_garbage_off_the_object():
    rng = np.random.default_rng(2)
    grey = rng.uniform(0, 255, (50, 60)).astype(np.float32)
    alpha = np.zeros(grey.shape, np.uint8)
    alpha[20:30, 10:40] = 255
    grey[20:30, 10:40] = 100
    cut = crop(grey, alpha)
    assert cut is not None
    assert (cut.grey == 100).all()
    pasted = cut.paste(cut.inside, grey.shape)
    assert np.array_equal(pasted, alpha > 0)
    assert crop(grey, np.zeros_like(alpha)) is None


def test_filled_pixels_take_the_nearest_value():
    grey = np.array([[1, 0, 0, 0, 9]], np.float32).repeat(3, 0)
    inside = np.array([[1, 0, 0, 0, 1]], bool).repeat(3, 0)
    filled = fill_outside(grey, inside)
    assert (filled[:, 1] == 1).all()
    assert (filled[:, 3] == 9).all()
