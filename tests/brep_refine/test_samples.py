"""Samples: slaved points, apparent contours, and the residual's derivative against really moved surfaces."""

import numpy as np
import pytest
from brepgaussian.brep.refine.mesh import FaceMesh, follow, from_solid, merged, slave
from brepgaussian.brep.refine.parameters import derivative
from brepgaussian.brep.refine.samples import EdgeSamples, followed, project, see_contours, see_edges, settle
from brepgaussian.brep.structure import Face, Structure
from brepgaussian.geometry.surfaces import cylinder, plane, sphere, torus
from refine_support import look_at_cameras, perturbed


def test_three_planes_give_their_corner():
    planes = [plane(np.array([0.1, 0, 0]), [1, 0, 0]), plane([0, 0.2, 0], [0, 1, 0]), plane([0, 0, 0.3], [0.1, 0, 1])]
    point = slave(np.array([[0.12, 0.21, 0.28]]), np.array([[0, 1, 2]]), planes)[0]
    np.testing.assert_allclose(point, [0.1, 0.2, 0.29], atol=1e-9)


def test_missing_surfaces_are_ignored():
    ball = sphere(np.zeros(3), 0.5)
    point = slave(np.array([[0.3, 0.4, 0.1]]), np.array([[0, -1]]), [ball])[0]
    assert abs(np.linalg.norm(point) - 0.5) < 1e-12


def test_projection_derivative_equals_finite_differences():
    cameras, rng = look_at_cameras(5), np.random.default_rng(0)
    points, view = rng.uniform(0.2, 0.8, (20, 3)), rng.integers(0, 5, 20)
    pixel, jacobian = project(cameras, view, points)
    for k in range(3):
        step = 1e-6 * np.eye(3)[k]
        numeric = (project(cameras, view, points + step)[0] - project(cameras, view, points - step)[0]) / 2e-6
        np.testing.assert_allclose(jacobian[:, :, k], numeric, rtol=1e-5, atol=1e-4)
    np.testing.assert_allclose(pixel[0], cameras.project(int(view[0]), points[:1])[0][0])


def test_rays_follow_surfaces_that_move_a_little():
    ball, lid = sphere(np.full(3, 0.5), 0.3), plane([0.5, 0.5, 0.6], [0.2, 0.1, 1])
    moved = (sphere(np.array([0.5002, 0.4999, 0.5]), 0.3001), plane([0.5, 0.5, 0.6002], [0.2, 0.101, 1]))
    cameras, poses = look_at_cameras(6), np.zeros((6, 3))
    angle = np.linspace(0, 6, 9)
    start = np.column_stack([0.5 + 0.28 * np.cos(angle), 0.5 + 0.28 * np.sin(angle), np.full(9, 0.6)])
    samples = settle(EdgeSamples(start, np.tile([[0, 1]], (9, 1)), np.zeros(9, int)), (ball, lid))
    edges = see_edges(samples, (ball, lid), cameras, poses)
    mesh, structure = _mesh_of(ball, _sphere_grid(np.full(3, 0.5)))
    contours = see_contours(mesh, structure, (ball, lid), cameras, poses, 0.02)
    before = edges.joined(contours).turned(np.arange(len(edges.view) + len(contours.view)) % 2 == 0)
    rows, after = followed(before, moved, cameras, poses)
    anew = see_edges(settle(samples, moved), moved, cameras, poses)
    assert len(rows) == len(before.view)
    same = {(v, s): k for k, (v, s) in enumerate(zip(anew.view, anew.sample, strict=True))}
    for k in range(len(edges.view)):
        other = same[after.view[k], after.sample[k]]
        np.testing.assert_allclose(after.pixel[k], anew.pixel[other], atol=1e-6)
        np.testing.assert_allclose(np.abs(after.lever[k]), np.abs(anew.lever[other]), atol=1e-4)
    assert (np.einsum("ri,ri->r", after.normal, before.normal) > 0.99).all()
    sight = after.points - cameras.centers[after.view]
    outline = np.flatnonzero(after.sample < 0)
    assert len(outline) > 20
    normals = moved[0].normals(after.points[outline])
    assert np.abs(np.einsum("ri,ri->r", normals, sight[outline])).max() < 1e-6
    assert np.abs(moved[0].signed_distance(after.points[outline])).max() < 1e-9


def test_lever_predicts_how_an_edge_moves_in_the_image():
    surfaces = (cylinder([0.5, 0.5, 0.5], [0, 0, 1], 0.3), plane([0.5, 0.5, 0.6], [0.2, 0.1, 1]))
    angle = np.linspace(0, 6, 15)
    start = np.column_stack([0.5 + 0.3 * np.cos(angle), 0.5 + 0.3 * np.sin(angle), np.full(15, 0.6)])
    table = np.tile([[0, 1]], (15, 1))
    cameras, poses = look_at_cameras(6), np.zeros((6, 3))
    samples = settle(EdgeSamples(start, table, np.zeros(15, int)), surfaces)
    rays = see_edges(samples, surfaces, cameras, poses)
    rng = np.random.default_rng(1)
    deltas = [2e-5 * rng.normal(size=5), 2e-5 * rng.normal(size=3)]
    from brepgaussian.brep.refine.parameters import update

    moved = tuple(update(s, d) for s, d in zip(surfaces, deltas, strict=True))
    # The moved edge is dense enough to measure distances to it along the image normals.
    fine = np.linspace(0, 2 * np.pi, 20001)
    curve = np.column_stack([0.5 + 0.3 * np.cos(fine), 0.5 + 0.3 * np.sin(fine), np.full(len(fine), 0.6)])
    curve = slave(curve, np.tile([[0, 1]], (len(fine), 1)), moved)
    predicted = -sum(rays.lever[:, k] * (derivative(surfaces[k], rays.points) @ deltas[k]) for k in range(2))
    for row in range(0, len(rays.view), 7):
        pixels, _ = cameras.project(int(rays.view[row]), curve)
        away = pixels - rays.pixel[row]
        along = away @ np.array([-rays.normal[row, 1], rays.normal[row, 0]])
        across = away @ rays.normal[row]
        near = np.flatnonzero((np.abs(across) < 1.0) & (np.abs(along) < 1.0))
        line = np.polynomial.Polynomial.fit(along[near], across[near], 2)
        measured = line(0.0)
        assert predicted[row] == pytest.approx(measured, abs=1e-3)


def _mesh_of(surface, grid):
    nodes, triangles = grid
    mesh = merged(surface.project(nodes), triangles, np.zeros(len(triangles), int))
    return mesh, Structure((Face(0, 1.0, nodes[0]),), (), ())


def _sphere_grid(center):
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3)
    return 0.3 * np.asarray(ball.vertices) + center, np.asarray(ball.faces)


def test_contour_of_a_sphere_is_a_circle_around_the_line_of_sight():
    center = np.array([0.5, 0.45, 0.55])
    ball = sphere(center, 0.3)
    mesh, structure = _mesh_of(ball, _sphere_grid(center))
    cameras = look_at_cameras(4)
    rays = see_contours(mesh, structure, (ball,), cameras, np.zeros((4, 3)), 0.01)
    eye = cameras.centers[rays.view]
    sight = rays.points - eye
    np.testing.assert_allclose(np.linalg.norm(rays.points - center, axis=1), 0.3, atol=1e-9)
    np.testing.assert_allclose(np.einsum("ri,ri->r", sight, rays.points - center), 0, atol=1e-8)
    for view in range(4):
        distance = np.linalg.norm(cameras.centers[view] - center)
        around = 2 * np.pi * 0.3 * np.sqrt(1 - (0.3 / distance) ** 2)
        assert (rays.view == view).sum() == pytest.approx(around / 0.01, rel=0.03)


def test_contour_normal_and_lever_of_a_growing_torus():
    ring = torus([0.5, 0.5, 0.5], [0.2, -0.1, 1], 0.3, 0.1)
    import trimesh

    body = trimesh.creation.torus(0.3, 0.1, major_sections=64, minor_sections=32)
    turn = np.column_stack(ring.frame())
    mesh, structure = _mesh_of(ring, (np.asarray(body.vertices) @ turn.T + 0.5, np.asarray(body.faces)))
    cameras, poses = look_at_cameras(3), np.zeros((3, 3))
    rays = see_contours(mesh, structure, (ring,), cameras, poses, 0.01)
    normals = ring.normals(rays.points)
    # A tube thicker by h moves its contour by h along the surface normal, which lies across the line of sight.
    moved, _ = project(cameras, rays.view, rays.points + 1e-5 * normals)
    shift = np.einsum("ri,ri->r", moved - rays.pixel, rays.normal)
    np.testing.assert_allclose(shift, 1e-5 * rays.lever[:, 0], rtol=1e-3, atol=1e-7)
    sideways = np.column_stack([-rays.normal[:, 1], rays.normal[:, 0]])
    assert np.abs(np.einsum("ri,ri->r", moved - rays.pixel, sideways)).max() < 1e-3


def test_mesh_follows_and_stays_closed():
    build123d = pytest.importorskip("build123d")
    from brepgaussian.brep.structure import extract
    from refine_support import surfaces_of, unit_solid

    solid = unit_solid(build123d.Solid.make_box(1, 0.7, 0.5) - build123d.Pos(0.5, 0.35, 0) * build123d.Cylinder(0.2, 2))
    surfaces = surfaces_of(solid)
    mesh, structure = from_solid(solid), extract(solid, surfaces)
    moved = perturbed(surfaces, 3, 0.5, 0.003)
    after: FaceMesh = follow(mesh, structure, moved)
    owner = np.array([f.surface for f in structure.faces])[after.face]
    for index, surface in enumerate(moved):
        used = np.unique(after.triangles[owner == index])
        assert np.abs(surface.signed_distance(after.vertices[used])).max() < 1e-7
    edges = np.sort(after.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
