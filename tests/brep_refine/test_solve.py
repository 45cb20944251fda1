"""Robust weights against a plain reference, and how far edges are trusted by the angle between their faces."""

from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.brep.refine.solve import _biases, _medians
from brepgaussian.brep.refine.visibility import CREASE, OCCLUDING, SILHOUETTE
from brepgaussian.brep.structure import CONCAVE, CONVEX
from brepgaussian.geometry.surfaces import cone, cylinder, plane


@pytest.mark.parametrize("count", [1, 2, 7, 5000])
def test_medians_of_groups_are_those_of_numpy(count: int) -> None:
    rng = np.random.default_rng(count)
    values, group = rng.random(count), 3 * rng.integers(0, max(1, count // 4), count)
    expected = np.array([np.median(values[group == k]) for k in group])
    np.testing.assert_array_equal(_medians(values, group), expected)


LINE = np.column_stack([np.zeros(9), np.linspace(-1, 1, 9), np.zeros(9)])
TURN = np.linspace(0, 2 * np.pi, 40)
CIRCLE = np.column_stack([np.cos(TURN), np.sin(TURN), 0 * TURN])


@pytest.mark.parametrize("degrees", [90.0, 45.0, 13.0])
def test_a_crease_is_trusted_the_less_the_lower_its_step_is(degrees: float) -> None:
    """By the sine of the angle: as high as a step of light is. Silhouettes and valleys are what they are."""
    angle = np.radians(degrees)
    surfaces = (
        plane(np.zeros(3), [0, 0, 1]),
        plane(np.zeros(3), [np.sin(angle), 0, np.cos(angle)]),
        cylinder(np.zeros(3), [0, 0, 1], 1.0),
        cone(np.zeros(3), [0, 0, 1], 1.0, angle),
    )
    lines = [(LINE, (0, 1), CONVEX), (LINE, (0, 1), CONCAVE), (CIRCLE, (2, 3), CONVEX), (LINE, (0, -1), CONVEX)]
    edges = [SimpleNamespace(polyline=line, surfaces=pair, convexity=kind) for line, pair, kind in lines]
    structure = SimpleNamespace(edges=edges, faces=[None])
    kind = np.repeat([CREASE, SILHOUETTE, OCCLUDING], 5)
    seen = SimpleNamespace(kind=kind, rays=SimpleNamespace(group=np.tile(np.arange(5), 3)))
    creases, silhouettes, occluding = _biases(seen, structure, surfaces).reshape(3, 5)
    low = 0.02 / np.sin(angle)
    np.testing.assert_allclose(creases, [low, 0.4, low, 0.02, 0.02])
    np.testing.assert_allclose(silhouettes, 0.002)
    np.testing.assert_allclose(occluding, [0.05, 0.4, 0.05, 0.05, 0.05])
