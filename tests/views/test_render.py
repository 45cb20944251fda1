"""Renderings and truths against exact geometry."""

import dataclasses
import math

import numpy as np
import pytest
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.lighting import display
from brepgaussian.views.mesh import FaceMesh, mesh_solid, weld
from brepgaussian.views.parts import build_part
from brepgaussian.views.refine import split_long_edges
from brepgaussian.views.render import _pattern, render
from brepgaussian.views.rig import rig
from brepgaussian.views.truth import transformed, truth_of_solid, unit_from_world
from scipy import ndimage

SMALL = ViewsSettings(rendered_views=12, image_size=160, truth_points=2000, mesh_deflection=2e-4, subsamples=4)


def unit_solid(name):
    solid = build_part(name).wrapped
    return transformed(solid, unit_from_world(solid))


@pytest.mark.parametrize("name", ["block_hole", "ball_pin", "ring_groove", "cup", "stepped_shaft"])
def test_the_truth_lies_in_the_unit_frame_on_its_surfaces(name):
    truth, mesh = truth_of_solid(unit_solid(name), SMALL)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    np.testing.assert_allclose((low + high) / 2, 0.5, atol=2e-4)
    assert (high - low).max() == pytest.approx(1, abs=4e-4)
    assert mesh.volume() == pytest.approx(truth.volume, rel=2e-3)
    np.testing.assert_allclose(np.linalg.norm(truth.normals, axis=1), 1, atol=1e-9)
    for face, surface in enumerate(mesh.surfaces):
        mine = truth.point_face == face
        assert np.abs(surface.signed_distance(truth.points[mine])).max() < 1e-9
        np.testing.assert_allclose(surface.normals(truth.points[mine]), truth.normals[mine], atol=1e-6)


def test_points_are_uniform_by_area():
    truth, mesh = truth_of_solid(unit_solid("block_hole"), SMALL)
    share = np.bincount(mesh.triangle_face, mesh.areas()) / mesh.areas().sum()
    counts = np.bincount(truth.point_face, minlength=len(share))
    assert np.abs(counts - share * SMALL.truth_points).max() < 2


def test_the_mesh_is_watertight():
    import trimesh

    mesh = mesh_solid(unit_solid("hex_nut"), 1e-4, 5)
    assert trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False).is_watertight


@pytest.mark.parametrize("outline", ["ellipse", "spline"])
def test_extruded_curves_are_meshed(outline):
    """The quick triangulation of the kernel leaves them out; volumes by hand, and by the kernel's own integrals."""
    import trimesh
    from build123d import Ellipse, Line, Spline, extrude, make_face

    curve = Spline((0, 0), (0.3, 0.2), (0.7, 0.1), (1, 0.3))
    closed = make_face([curve, Line((1, 0.3), (1, -0.4)), Line((1, -0.4), (0, 0))])
    solid = extrude(Ellipse(0.5, 0.3) if outline == "ellipse" else closed, 0.4)
    mesh = mesh_solid(solid.wrapped, 1e-4, 4)
    assert set(mesh.triangle_face) == set(range(len(solid.faces())))
    assert trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False).is_watertight
    expected = np.pi * 0.5 * 0.3 * 0.4 if outline == "ellipse" else solid.volume
    assert mesh.volume() == pytest.approx(expected, rel=2e-3)


def test_welding_keeps_positions():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1e-9, 0, 0], [2, 0, 0]])
    kept, index = weld(points)
    assert len(kept) == 3
    np.testing.assert_allclose(kept[index], points, atol=1e-8)


def test_splitting_keeps_the_surface_and_shortens_edges():
    mesh = mesh_solid(unit_solid("block_hole"), 1e-3, 10)
    fine = split_long_edges(mesh, 0.1)
    ends = np.roll(fine.triangles, -1, axis=1)
    assert np.linalg.norm(fine.vertices[fine.triangles] - fine.vertices[ends], axis=2).max() <= 0.1
    assert fine.volume() == pytest.approx(mesh.volume(), rel=1e-12)
    assert np.bincount(fine.triangle_face, fine.areas()) == pytest.approx(
        np.bincount(mesh.triangle_face, mesh.areas()), rel=1e-9
    )
    import trimesh

    assert trimesh.Trimesh(fine.vertices, fine.triangles, process=False).is_watertight


def test_the_filter_pattern_is_centred_and_within_its_width():
    offsets = _pattern(36)
    np.testing.assert_allclose(offsets.mean(axis=0), 0, atol=1e-12)
    assert np.abs(offsets).max() < 1.5


def test_grey_is_the_same_from_everywhere(bracket):
    """View-independent light: a plane's point has one grey level in all views that see it."""
    views, truth = bracket.views, bracket.truth
    levels = [[] for _ in truth.points]
    for view in range(len(views.names)):
        pixels, _ = views.cameras.project(view, truth.points)
        column, row = np.floor(pixels).astype(int).T
        inner = ndimage.minimum_filter(truth.face_ids[view], 5) == ndimage.maximum_filter(truth.face_ids[view], 5)
        seen = inner[row, column] & (truth.face_ids[view][row, column] == truth.point_face)
        for i in np.flatnonzero(seen):
            levels[i].append(int(views.rgb[view, row[i], column[i], 0]))
    spans = [max(values) - min(values) for values in levels if len(values) > 2]
    assert len(spans) > 300
    assert np.percentile(spans, 90) <= 3  # a pixel of 160 is wide: light varies within it


def test_colour_is_black_outside_and_alpha_agrees_with_the_face_ids(bracket):
    views, truth = bracket.views, bracket.truth
    assert (views.rgb[views.alpha == 0] == 0).all()
    covered, seen = views.alpha >= 128, truth.face_ids >= 0
    assert (covered & seen).sum() / (covered | seen).sum() > 0.999


def test_edges_of_the_truth_fall_on_edges_of_the_images(bracket):
    """Silhouettes of convex outer edges: every projected sample of a visible curve is within a pixel of a border."""
    views, truth = bracket.views, bracket.truth
    near = []
    for view in range(len(views.names)):
        ids = truth.face_ids[view]
        border = ndimage.minimum_filter(ids, 3) != ndimage.maximum_filter(ids, 3)
        distance = ndimage.distance_transform_edt(~border)
        pixels, _ = views.cameras.project(view, truth.curve_points)
        column, row = np.floor(pixels).astype(int).T
        near.append(distance[row, column] <= 1)
    assert np.mean(np.any(near, axis=0)) == 1  # each sample is on an edge of some image
    assert np.mean(near) > 0.5


def test_coverage_of_a_sphere_is_its_projected_area():
    from build123d import Sphere

    solid = Sphere(7).solids()[0].wrapped
    solid = transformed(solid, unit_from_world(solid))
    settings = dataclasses.replace(SMALL, interreflection=0.0)
    fine = mesh_solid(solid, 2e-5, 5)
    cameras = rig(settings)
    pictures = render(fine, fine, cameras, settings, 1, range(2))
    for view in range(2):
        distance = np.linalg.norm(cameras.centers[view] - 0.5)
        tangent = 0.5 / math.sqrt(distance**2 - 0.25) * cameras.intrinsics[view, 0]
        area = pictures.alpha[view].sum() / 255
        assert area == pytest.approx(math.pi * tangent**2, rel=2e-3)


def test_an_apex_has_finite_normals():
    from build123d import Cone

    solid = Cone(5, 0, 8).solids()[0].wrapped
    mesh = mesh_solid(transformed(solid, unit_from_world(solid)), 1e-3, 10)
    np.testing.assert_allclose(np.linalg.norm(mesh.corner_normals, axis=2), 1, atol=1e-6)


def test_light_between_faces_brightens_hollows_only():
    solid = unit_solid("counterbore")
    fine = mesh_solid(solid, 1e-3, 10)
    cameras = rig(SMALL)
    pictures = {
        strength: render(fine, fine, cameras, dataclasses.replace(SMALL, interreflection=strength), 1, range(3))
        for strength in (0.0, 0.8)
    }
    gain = pictures[0.8].rgb.astype(int) - pictures[0.0].rgb
    ids = pictures[0.0].face_ids
    inner = np.stack([ndimage.minimum_filter(i, 5) == ndimage.maximum_filter(i, 5) for i in ids]) & (ids >= 0)
    hollow = np.array([s.kind == "cylinder" for s in fine.surfaces])
    assert gain[inner & hollow[ids]].mean() > 8
    outer = [i for i, s in enumerate(fine.surfaces) if s.kind == "plane" and abs(s.axis[2]) < 0.5]
    assert np.abs(gain[inner & np.isin(ids, outer)]).max() == 0


def test_display_is_monotone_and_ends_at_white():
    levels = display(np.linspace(0, 3, 500))
    assert (np.diff(levels) >= 0).all()
    assert levels[0] == 0
    assert levels[-1] <= 255


def test_noise_and_jpeg_are_asked_for():
    solid = unit_solid("block_hole")
    mesh = mesh_solid(solid, 1e-3, 10)
    cameras = rig(SMALL)
    plain = dataclasses.replace(SMALL, interreflection=0.0)
    clean = render(mesh, mesh, cameras, plain, 1, range(1))
    noisy = render(mesh, mesh, cameras, dataclasses.replace(plain, noise=5.0), 1, range(1))
    inside = clean.alpha[0] == 255
    difference = (noisy.rgb[0].astype(float) - clean.rgb[0])[inside]
    assert difference.std() == pytest.approx(5, rel=0.1)
    coded = render(mesh, mesh, cameras, dataclasses.replace(plain, jpeg_quality=60), 1, range(1))
    assert 0 < np.abs(coded.rgb[0].astype(int) - clean.rgb[0])[inside].mean() < 5
    assert (noisy.alpha == clean.alpha).all()


def test_cameras_surround_the_object_and_look_at_it():
    cameras = rig(ViewsSettings())
    np.testing.assert_allclose(np.linalg.norm(cameras.centers, axis=1), 4)
    assert (cameras.centers[:, 2] < -1).sum() > 10
    for view in range(len(cameras)):
        pixel, depth = cameras.project(view, np.full((1, 3), 0.5))
        np.testing.assert_allclose(pixel, 400)
        assert depth > 3
        assert np.linalg.det(cameras.cam_from_unit[view, :3, :3]) == pytest.approx(1)


def test_normals_of_a_face_without_analytic_surface_are_interpolated():
    normals = np.array([[[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]])
    mesh = FaceMesh(np.eye(3), np.array([[0, 1, 2]], np.int32), np.zeros(1, np.int32), normals, (None,))
    _, found = mesh.points_at(np.zeros(1, int), np.full((1, 3), 1 / 3))
    np.testing.assert_allclose(found, np.full((1, 3), 1 / math.sqrt(3)))
