"""Floors of pockets whose depth is off, rendered with their walls' light: how deep all rays place them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.brep.patches import Patch, with_floor
from brepgaussian.brep.refine import from_solid, refine
from brepgaussian.brep.refine.observe import prepare, whole_images
from brepgaussian.brep.refine.parallax import Displaced
from brepgaussian.brep.refine.pits import floors, pit_of
from brepgaussian.brep.refine.plumb import deeper, plumbed
from brepgaussian.brep.refine.refinement import _more_amiss
from brepgaussian.brep.structure import extract
from brepgaussian.geometry.surfaces import cylinder, plane
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.views.truth import transformed
from build123d import Align, Box, Cylinder, Pos, Rot
from refine_support import asked_of, start_of, surfaces_of, views_of

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
    (floor,) = found.values()
    height = (floor.places - pit.floor.vertices[pit.floor.triangles[0, 0]]) @ pit.normal
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
    assert not found


@pytest.mark.parametrize(("radius", "deep", "too_deep"), [(7.0, 10, 16), (6.0, 8, 16), (8.0, 16, 18)])
def test_a_floor_far_too_deep_goes_up_to_where_views_begin_to_disagree(tmp_path, radius, deep, too_deep):
    """Walls and floor of a socket look alike: below its floor, all depths explain the images nearly as well."""
    tall = Box(LONG, 40, 40, align=LOW)

    def socket(deep):
        return Pos(0, 0, 40 - deep) * Cylinder(radius, deep, align=LOW)

    (pit,), found, footprint = pits(tall - socket(deep + too_deep), tall - socket(deep), tmp_path)
    (floor,) = found.values()
    assert floor.move @ pit.normal == pytest.approx(too_deep / LONG, abs=1.5 * footprint)


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


def test_floors_are_asked_only_where_nothing_else_lies_elsewhere():
    solid = block() - pocket(DEEP)
    structure, mesh, _, _ = start_of(solid.wrapped, surfaces_of(solid.wrapped), 3)
    (floor,), settings = floors(mesh, structure), BrepSettings()
    run = SimpleNamespace(mesh=mesh, structure=structure)
    for face in range(len(structure.faces)):
        areas = np.where(np.arange(len(structure.faces)) == face, 2 * settings.accept_displaced, 0.0)
        assert _more_amiss(run, Displaced(areas, None), settings) == (face != floor)
        assert not _more_amiss(run, Displaced(areas / 4, None), settings)


def test_the_walls_of_a_floor_that_is_moved_up_end_there():
    """Else they would count as surface that the solid leaves out."""
    turn, height = (
        a.ravel() for a in np.meshgrid(np.linspace(0, 2 * np.pi, 40, endpoint=False), np.linspace(0, 1, 41))
    )
    wall = np.column_stack([0.2 * np.cos(turn), 0.2 * np.sin(turn), height])
    grid = np.stack(np.meshgrid(*[np.linspace(-0.2, 0.2, 21)] * 2), axis=-1).reshape(-1, 2)
    disc = np.column_stack([grid[np.hypot(*grid.T) < 0.19], np.zeros((np.hypot(*grid.T) < 0.19).sum())])
    bore = cylinder(np.zeros(3), np.array([0.0, 0, 1]), 0.2, flipped=True)
    old, new = (plane(np.array([0.0, 0, z]), np.array([0.0, 0, 1])) for z in (0.0, 0.4))
    patches = [Patch(s, k, x, s.normals(x), 0.02, 0.0) for k, (s, x) in enumerate([(bore, wall), (new, disc)])]
    other = Patch(new, 2, disc + np.array([2.0, 0, 0.2]), new.normals(disc), 0.02, 0.0)  # far away, of that height
    found = list(with_floor([*patches, other], 1, replace(patches[1], surface=old)))
    assert found[0].xyz[:, 2].min() == pytest.approx(0.4, abs=0.03)
    np.testing.assert_allclose(found[1].xyz[:, 2], 0.4)
    assert found[2] is other


def _corners(mesh, face):
    return mesh.vertices[np.unique(mesh.triangles[mesh.face == face])]
