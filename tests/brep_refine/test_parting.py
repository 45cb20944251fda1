"""Bores of one size that cross: a little apart the larger one goes through in one piece, which nobody means."""

import numpy as np
import pytest
from brepgaussian.brep.refine.constraints import Tie, value
from brepgaussian.brep.refine.regularity import crossings, parting
from brepgaussian.brep.structure import extract
from build123d import Box, Cylinder, Pos, Rot
from refine_support import surfaces_of, unit_solid


def crossed(radius=3.0, aside=0.0, turn=90.0, other=None):
    """A block with two bores, the second of another size, aside, or at another angle than square."""
    first = Rot(0, 90, 0) * Cylinder(3, 100)
    second = Pos(0, aside) * Rot(0, 90 - turn, 0) * Cylinder(radius, 100)
    return Box(40, 30, 20) - first - second - (other if other is not None else [])


def bores_of(surfaces):
    return [i for i, s in enumerate(surfaces) if s.kind == "cylinder"]


def structure_of(part):
    solid = unit_solid(part)
    surfaces = surfaces_of(solid)
    return extract(solid, surfaces), surfaces


@pytest.mark.parametrize(
    ("radius", "aside", "turn"), [(3.02, 0.0, 90.0), (2.98, 0.015, 90.0), (3.0, 0.02, 60.0), (2.99, -0.01, 120.0)]
)
def test_bores_that_nearly_part_each_other_do(radius, aside, turn):
    structure, surfaces = structure_of(crossed(radius, aside, turn))
    pair = tuple(bores_of(surfaces))
    assert {tie.members for tie in crossings(structure, surfaces)} == {pair}
    result = parting(structure, surfaces)
    for kind in ("equal_radius", "crossing"):
        assert abs(value(Tie(kind, pair), result)[0]) < 1e-15
    changed = [i for i, (a, b) in enumerate(zip(surfaces, result, strict=True)) if a is not b]
    assert len(changed) == 1  # the longer one stays
    moved, before = result[changed[0]], surfaces[changed[0]]
    assert moved.axis is before.axis
    assert np.linalg.norm(moved.origin - before.origin) == pytest.approx(abs(aside) / 40, abs=1e-9)


@pytest.mark.parametrize(("radius", "aside", "turn"), [(3.1, 0.0, 90.0), (3.0, 0.1, 90.0), (3.0, 0.0, 10.0)])
def test_other_bores_stay(radius, aside, turn):
    structure, surfaces = structure_of(crossed(radius, aside, turn))
    assert parting(structure, surfaces) == ()


def test_one_follows_another():
    """Three in a row: the last one meets the second as that was moved."""
    third = Pos(12, 0.02) * Cylinder(3.01, 100)
    structure, surfaces = structure_of(crossed(2.98, -0.015, other=third))
    pairs = {tie.members for tie in crossings(structure, surfaces)}
    assert len(pairs) == 2
    result = parting(structure, surfaces)
    for pair in pairs:
        assert abs(value(Tie("crossing", pair), result)[0]) < 1e-15
        assert abs(value(Tie("equal_radius", pair), result)[0]) < 1e-15
