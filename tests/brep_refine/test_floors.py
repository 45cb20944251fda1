"""Floors of pockets and holes, rendered with their walls' light: which of them views tell."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.brep import occ
from brepgaussian.brep.job import Attempt
from brepgaussian.brep.ladder import _untold
from brepgaussian.brep.refine.floors import untold_floors
from brepgaussian.brep.refine.pits import floors
from brepgaussian.brep.verdict import Verdict
from brepgaussian.brep.worker import Worker
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.views.truth import transformed
from build123d import Align, Box, Cone, Cylinder, Pos
from refine_support import asked_of, surfaces_of, views_of

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
HIGH = 20


def block():
    return Box(50, 40, HIGH, align=LOW)


def bore(radius, depth):
    return Pos(0, 0, HIGH - depth) * Cylinder(radius, depth, align=LOW)


def drilled(radius, depth):
    tip = radius / np.tan(np.radians(59.0))
    return bore(radius, depth) + Pos(0, 0, HIGH - depth - tip) * Cone(0, radius, tip, align=LOW)


def untold(solid, part, tmp_path, **settings):
    """Areas of the floors of a solid that views of a part do not tell, unit frame."""
    views = views_of(part, tmp_path, **settings)
    scene, structure, _, _ = asked_of(solid, views)
    return sorted(structure.faces[k].area for k in untold_floors(scene, structure, views))


@pytest.mark.parametrize("settings", [{}, {"noise": 5.0}])
@pytest.mark.parametrize("hole", [Pos(0, 0, HIGH - 8) * Box(24, 16, 8, align=LOW), bore(9, 8), bore(5, 3)])
def test_floors_that_many_views_see_are_told(tmp_path, hole, settings):
    part = block() - hole
    assert untold(part, part, tmp_path, **settings) == []


@pytest.mark.parametrize(("solid", "part"), [(bore(2.5, 12), bore(2.5, 12)), (bore(2.5, 9), drilled(2.5, 12))])
def test_a_deep_narrow_hole_may_as_well_be_deeper(tmp_path, solid, part):
    assert len(untold(block() - solid, block() - part, tmp_path)) == 1


def test_one_of_two_floors_is_told(tmp_path):
    part = block() - Pos(12, 0, 0) * bore(8, 6) - Pos(-12, 0, 0) * bore(2, 14)
    (area,) = untold(part, part, tmp_path)
    wide = block() - Pos(12, 0, 0) * bore(8, 6)
    assert untold(wide, wide, tmp_path) == []
    assert area < 0.01


def test_a_pocket_whose_floor_lies_too_high_is_not_told(tmp_path):
    part, solid = (block() - Pos(0, 0, HIGH - deep) * Box(24, 16, deep, align=LOW) for deep in (9, 6))
    assert len(untold(solid, part, tmp_path)) == 1


def test_a_solid_without_pockets_has_no_floors(tmp_path):
    part = block() - Pos(0, 0, HIGH - 5) * Box(60, 10, 5, align=LOW)  # a channel is open at its ends
    assert untold(part, part, tmp_path) == []


def test_the_ladder_asks_of_the_published_solid(tmp_path):
    part = block() - bore(2.5, 12)
    views = views_of(part, tmp_path)
    solid = transformed(part.wrapped, np.linalg.inv(views.world_from_unit))
    attempt = Attempt("support", occ.to_bytes(solid), Verdict(()), surfaces=tuple(surfaces_of(solid)))
    with Worker() as worker:
        (floor,) = _untold(worker, attempt, views, BrepSettings())
        structure, _ = worker.call("assemble:inspect", (attempt.shape, attempt.surfaces), 60.0)
        assert structure.faces[floor].area == min(f.area for f in structure.faces)
        assert _untold(worker, replace(attempt, shape=b"none"), views, BrepSettings()) == []


def test_necks_and_undercut_walls_are_no_floors(tmp_path):
    """A neck between two flanges has concave edges only; it faces all around, a dome one way."""
    neck = Cylinder(14, 5, align=LOW) + Cylinder(7, 20, align=LOW) + Pos(0, 0, 15) * Cylinder(14, 5, align=LOW)
    scene, structure, _, _ = asked_of(neck, views_of(neck, tmp_path))
    assert floors(scene.mesh, structure) == []
    well = block() - drilled(4, 8)
    scene, structure, _, _ = asked_of(well, views_of(well, tmp_path))
    assert len(floors(scene.mesh, structure)) == 1
