"""Counts of faces, edges and vertices against hand counts, wherever the kernel puts its seams."""

import math

import numpy as np
import pytest
from brepgaussian.geometry.chains import EdgeEnds, join
from brepgaussian.geometry.kernel import face_surface, faces_of
from brepgaussian.geometry.topology import count_topology, sharp_curves

build123d = pytest.importorskip("build123d")
from build123d import Axis, Box, Cone, Cylinder, Pos, Rot, Solid, Sphere, Torus, fillet  # noqa: E402


def shape(part):
    return part.solids()[0].wrapped


BOX = Box(4, 3, 2)
CASES = {
    "box": (BOX, 6, 12, 8, 12),
    "block with a through hole": (BOX - Cylinder(0.5, 9), 7, 14, 8, 14),
    "cylinder": (Cylinder(1, 2), 3, 2, 0, 2),
    "cone with an apex": (Cone(1, 0, 2), 2, 1, 0, 1),
    "sphere": (Sphere(1), 1, 0, 0, 0),
    "torus": (Torus(2, 0.5), 1, 0, 0, 0),
    "half a cylinder": (Cylinder(1, 2) - Pos(1, 0, 0) * Box(2, 4, 4), 4, 6, 4, 5),
    "one edge rounded": (fillet(BOX.edges().filter_by(Axis.Z)[:1], 0.4), 7, 15, 10, 15),
}


@pytest.mark.parametrize("name", CASES)
def test_hand_counts(name):
    part, faces, edges, vertices, pairs = CASES[name]
    found = count_topology(shape(part))
    assert (len(found.face_types), found.edge_count, found.vertex_count) == (faces, edges, vertices)
    assert len(found.face_pairs) == pairs


@pytest.mark.parametrize("turn", [0, 17, 90, 133, 180, 270])
def test_the_seam_may_lie_anywhere(turn):
    hub = Rot(0, 0, turn) * Cylinder(1, 2) + Pos(0, 0, 1.5) * Box(3, 3, 1)
    hole = hub - Rot(0, 90, turn / 2) * Cylinder(0.3, 9) - Rot(0, 0, -turn) * Cylinder(0.6, 9)
    found = count_topology(shape(hole))
    reference = count_topology(shape(Cylinder(1, 2) + Pos(0, 0, 1.5) * Box(3, 3, 1)))
    assert reference.vertex_count == 8
    assert found.vertex_count == 8


def test_a_curve_split_by_a_foreign_seam_counts_once():
    """Two crossing cylinders: the kernel splits their intersection at the seams, a user sees closed curves."""
    counts = set()
    for turn in (0, 30, 75, 180):
        tee = Rot(0, 90, 0) * Cylinder(1, 6) + Rot(0, 0, turn) * Pos(0, 0, 1.5) * Cylinder(0.6, 3)
        found = count_topology(shape(tee))
        counts.add((len(found.face_types), found.edge_count, found.vertex_count))
    assert counts == {(5, 4, 0)}


def test_adjacent_faces_of_a_box_share_no_parallel_pair():
    solid = shape(BOX)
    surfaces = [face_surface(face) for face in faces_of(solid)]
    for a, b in count_topology(solid).face_pairs:
        assert abs(surfaces[a].axis @ surfaces[b].axis) < 1e-9
        assert a < b


def test_smooth_edges_are_adjacent_but_not_sharp():
    rounded = shape(CASES["one edge rounded"][0])
    assert count_topology(rounded).edge_count == 15
    assert len(sharp_curves(rounded, 0.1).types) == 13


def test_sharp_samples_lie_on_their_circle_at_the_spacing():
    curves = sharp_curves(shape(Cylinder(1, 2)), 0.01)
    assert curves.types == ("circle", "circle")
    first = curves.points[curves.curve_id == 0]
    np.testing.assert_allclose(np.hypot(first[:, 0], first[:, 1]), 1, atol=1e-12)
    assert np.linalg.norm(np.diff(first, axis=0), axis=1).max() <= 0.01
    assert len(first) == math.ceil(2 * math.pi / 0.01) + 1


def test_outward_normals():
    hollow = shape(Sphere(2) - Sphere(1))
    signs = {surface.radius: surface.flipped for surface in map(face_surface, faces_of(hollow))}
    assert signs == {2.0: False, 1.0: True}
    drilled = [face_surface(f) for f in faces_of(shape(BOX - Cylinder(0.5, 9)))]
    center = np.zeros(3)
    for surface in drilled:
        outside = surface.signed_distance(center[None])[0]
        assert (outside > 0) == (surface.kind == "cylinder")


def test_a_cone_that_narrows_keeps_its_nappe():
    solid = shape(Cone(2, 0.5, 3))
    (surface,) = [s for s in map(face_surface, faces_of(solid)) if s.kind == "cone"]
    ring = np.array([[2, 0, -1.5], [0, 0.5, 1.5]])
    np.testing.assert_allclose(surface.signed_distance(ring), 0, atol=1e-12)
    assert (surface.normals(ring)[:, 2] > 0).all()


def test_a_spline_that_is_a_plane_is_recognised():
    nurbs = pytest.importorskip("OCP.BRepBuilderAPI").BRepBuilderAPI_NurbsConvert(shape(BOX - Cylinder(0.5, 9)), True)
    found = count_topology(Solid(nurbs.Shape()).wrapped)
    assert sorted(found.face_types) == ["cylinder"] + ["plane"] * 6
    assert (found.edge_count, found.vertex_count) == (14, 8)


def test_corners_bend_and_hidden_vertices_do_not():
    straight = np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    bent = np.array([[0, 1.0, 0], [-1.0, 0, 0]])
    chain = [EdgeEnds((1, 2), straight, (0, 1)), EdgeEnds((2, 3), straight, (0, 1)), EdgeEnds((3, 4), bent, (0, 1))]
    curves, corners = join(chain)
    assert curves.tolist() == [0, 0, 1]
    assert corners == 3
    other_faces = [EdgeEnds((1, 2), straight, (0, 1)), EdgeEnds((2, 3), straight, (0, 2))]
    assert join(other_faces)[1] == 3
