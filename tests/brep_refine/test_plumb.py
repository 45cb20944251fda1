"""Floors of pockets whose depth is off, rendered with their walls' light: how deep all rays place them."""

import numpy as np
import pytest
from brepgaussian.brep.refine import from_solid, refine
from brepgaussian.brep.refine.observe import prepare, whole_images
from brepgaussian.brep.refine.pits import floors, pit_of
from brepgaussian.brep.refine.plumb import deeper, plumbed
from brepgaussian.brep.structure import extract
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.views.truth import transformed
from build123d import Align, Box, Cylinder, Pos, Rot
from refine_support import asked_of, surfaces_of, views_of

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
HIGH, LONG, DEEP = 20, 50, 8


def block():
    return Box(LONG, 40, HIGH, align=LOW)


def pocket(deep):
    return Pos(0, 0, HIGH - deep) * Box(24, 16, deep, align=LOW)


def bore(deep):
    return Pos(0, 0, HIGH - deep) * Cylinder(9, deep, align=LOW)


def pits(solid, part, tmp_path, **settings):
    views = views_of(part, tmp_path, **settings)
    scene, structure, _, _ = asked_of(solid, views)
    shown, noise, poses = whole_images(views), prepare(views).noise, np.zeros((len(views.cameras), 3))
    found = [pit_of(scene, structure, shown, noise, poses, face, 16.0) for face in floors(scene.mesh, structure)]
    return found, plumbed(scene, structure, shown, noise, poses), views.cameras.footprint()


@pytest.mark.parametrize(("hole", "off"), [(pocket, -0.5), (bore, 0.05), (pocket, 0.8)])  # of 50: .25 to 4 pixels
def test_floors_go_to_where_rays_place_them(tmp_path, hole, off):
    (pit,), found, footprint = pits(block() - hole(DEEP - off), block() - hole(DEEP), tmp_path)
    assert deeper(pit) == pytest.approx(off / LONG, abs=0.2 * footprint)
    # all that the surface is asked to pass through lies there
    height = (found.points - pit.floor.vertices[pit.floor.triangles[0, 0]]) @ pit.normal
    np.testing.assert_allclose(height, -deeper(pit), atol=1e-9)


@pytest.mark.parametrize(("hole", "settings"), [(pocket, {}), (bore, {"noise": 5.0})])
def test_floors_that_are_right_stay(tmp_path, hole, settings):
    (pit,), _, footprint = pits(block() - hole(DEEP), block() - hole(DEEP), tmp_path, **settings)
    off = deeper(pit)
    assert off is None or abs(off) < 0.2 * footprint


@pytest.mark.parametrize("seed", [1, 2])
def test_noise_tells_no_depth(tmp_path, seed):
    """A hole so deep and narrow that its floor is not told stays as it is, whatever noise says."""
    hole = Pos(0, 0, HIGH - 14) * Cylinder(2, 14, align=LOW)
    turned = Rot(0, 0, 17 * seed) * (block() - hole)
    (pit,), found, _ = pits(turned, turned, tmp_path, noise=5.0)
    assert deeper(pit) is None
    assert found is None


def test_a_floor_below_which_the_solid_ends_is_not_asked_for_below(tmp_path):
    thin = block() - pocket(HIGH - 0.5)
    (pit,), _, _ = pits(thin, thin, tmp_path)
    assert pit.room < 0.5 / LONG
    off = deeper(pit)
    assert off is None or off < pit.room


def test_the_refinement_moves_a_floor_there(tmp_path):
    part = block() - bore(DEEP)
    views = views_of(part, tmp_path)
    solid = transformed((block() - bore(DEEP - 0.3)).wrapped, np.linalg.inv(views.world_from_unit))
    surfaces = surfaces_of(solid)
    structure = extract(solid, surfaces)
    result = refine(structure, from_solid(solid), surfaces, views, BrepSettings())
    (floor,) = floors(result.mesh, result.structure)
    truth = transformed(part.wrapped, np.linalg.inv(views.world_from_unit))
    level = min(surfaces_of(truth), key=lambda s: np.abs(s.signed_distance(_corners(result.mesh, floor))).max())
    assert result.accepted
    assert np.abs(level.signed_distance(_corners(result.mesh, floor))).max() < 0.2 * views.cameras.footprint()


def _corners(mesh, face):
    return mesh.vertices[np.unique(mesh.triangles[mesh.face == face])]
