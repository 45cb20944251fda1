"""Pockets of which some corners are rounded: the others are proposed rounded, too."""

import numpy as np
import pytest
from brepgaussian.brep.judgement import as_good
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.refine.mesh import from_solid
from brepgaussian.brep.rounds import completed
from brepgaussian.brep.structure import extract
from brepgaussian.settings.brep import BrepSettings
from build123d import Align, Axis, Box, Pos, fillet
from refine_support import on_triangles, surfaces_of, unit_solid

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
RADIUS = 3


def solid_with(rounded, outside=False):
    """A block with a pocket, `rounded` of whose four corners are; or a block with corners like that."""
    body = Pos(0, 0, 12) * Box(24, 16, 8, align=LOW)
    edges = body.edges().filter_by(Axis.Z).sort_by(Axis.X)[:rounded]
    body = fillet(edges, RADIUS) if rounded else body
    return unit_solid(body if outside else Box(40, 30, 20, align=LOW) - body)


def asked(solid):
    surfaces = surfaces_of(solid)
    structure, mesh = extract(solid, surfaces), from_solid(solid)
    rng, patches = np.random.default_rng(0), []
    owner = np.array([face.surface for face in structure.faces])[mesh.face]
    for k, surface in enumerate(surfaces):
        xyz = surface.project(on_triangles(mesh.vertices[mesh.triangles[owner == k]], 2000, rng))
        patches.append(Patch(surface, k, xyz, surface.normals(xyz), 0.02, 1e-3))
    return completed(structure, surfaces, patches)


@pytest.mark.parametrize(("rounded", "missing"), [(0, 0), (1, 3), (2, 2), (4, 0)])
def test_the_sharp_corners_of_a_pocket_get_the_radius_of_the_others(rounded, missing):
    found = asked(solid_with(rounded))
    assert len(found) == bool(missing)
    for change in found:
        new = [p for p in change.new if p.surface.kind == "cylinder"]
        assert len(new) == missing
        assert all(p.surface.flipped and p.surface.radius == pytest.approx(RADIUS / 40, abs=1e-3) for p in new)


def test_the_outside_of_a_part_may_have_sharp_corners_beside_rounded_ones():
    assert asked(solid_with(2, outside=True)) == []


def test_another_window_is_no_part_of_a_rounded_one():
    round_one = fillet(Box(8, 12, 30, align=LOW).edges().filter_by(Axis.Z).sort_by(Axis.X)[:3], RADIUS)
    plate = Box(40, 30, 20, align=LOW) - Pos(-10, 0, 0) * round_one - Pos(10, 0, 0) * Box(10, 12, 30, align=LOW)
    (change,) = asked(unit_solid(plate))
    assert sum(p.surface.kind == "cylinder" for p in change.new) == 1


@pytest.mark.parametrize(("accepted", "px", "good"), [(True, 0.03, True), (True, 0.05, False), (False, 0.02, False)])
def test_what_the_images_bear(accepted, px, good):
    old = {"accepted": True, "silhouette_px": 0.03, "mask_iou": 0.9999}
    assert as_good(old | {"accepted": accepted, "silhouette_px": px}, old, BrepSettings()) == good
