"""Depths by parallax: synthetic places of known depth and radiance, and solids that lack a fillet."""

import numpy as np
import pytest
from brepgaussian.brep.refine.parallax import displaced
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.splatting.parallax import Looks, depths
from build123d import Axis, fillet
from hypothesis import given
from hypothesis import strategies as st
from refine_support import asked_of, views_of

PIXEL = 0.002


def rays_at(height, gradient, noise, seed):
    """Rays at the plane z = 0 that show the radiance of a plane `height` px above it."""
    rng = np.random.default_rng(seed)
    turn, slope = rng.uniform(0, 2 * np.pi, 4000), rng.uniform(0, 1.2, 4000)
    directions = np.column_stack([slope * np.cos(turn), slope * np.sin(turn), -np.ones(4000)])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    points = np.column_stack([rng.uniform(0.0002, 0.0398, (4000, 2)), np.zeros(4000)])  # four by four places
    shown = points + height * PIXEL * directions / directions[:, 2:]
    grey = 120 + shown[:, :2] @ gradient / PIXEL + noise * rng.normal(size=4000)
    return Looks(np.zeros(4000, np.int64), points, np.tile([0.0, 0, 1], (4000, 1)), directions, grey)


@given(height=st.floats(-3, 3), strong=st.floats(0.5, 3), turn=st.floats(0, 6.3), seed=st.integers(0, 99))
def test_depths_are_those_that_the_radiance_was_made_with(height, strong, turn, seed):
    gradient = strong * np.array([np.cos(turn), np.sin(turn)])
    found = depths(rays_at(height, gradient, 0.5, seed), PIXEL, 1.5)
    assert found.told.all()
    assert np.abs(found.depth + height).max() < 6 * found.sigma.max() + 0.02
    assert found.off.all() == (abs(height) > 1.5) or abs(height) < 1.5 + 6 * found.sigma.max()


def test_where_the_radiance_is_even_nothing_is_told():
    assert not depths(rays_at(2.0, np.zeros(2), 0.5, 1), PIXEL, 1.5).told.any()


def test_depths_scatter_as_their_errors_say():
    found = depths(rays_at(0.0, np.array([1.0, 0.5]), 1.0, 3), PIXEL, 3.0)
    assert 0.6 < np.std(found.depth / found.sigma) < 1.6


@pytest.mark.parametrize(("missing", "off"), [(False, False), (True, True)])
def test_a_fillet_of_an_inner_corner_that_a_solid_lacks_is_seen(tmp_path, missing, off):
    from build123d import Box, Pos

    angle = Box(40, 30, 40) - Pos(8, 0, 8) * Box(40, 30, 40)
    inner = [
        e for e in angle.edges().filter_by(Axis.Y) if abs(e.center().X + 12) < 1e-6 and abs(e.center().Z + 12) < 1e-6
    ]
    rounded = fillet(inner, 6)
    views = views_of(rounded, tmp_path)
    area = displaced(*asked_of(angle if missing else rounded, views)).area
    assert (area > BrepSettings().accept_displaced) == off
