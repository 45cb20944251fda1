"""Curves for brep.h5: pieces of one curve are joined, corners and edge points counted."""

import numpy as np
import pytest
from brepgaussian.brep.curves import corners_of, joined, support_by_edge_points, wireframe
from brepgaussian.brep.structure import Edge, Face, Structure, Vertex


def arc(start, end, vertices, radius=0.3, turned=False):
    t = np.linspace(start, end, 20)
    line = 0.5 + radius * np.column_stack([np.cos(t), np.sin(t), np.zeros(20)])
    if turned:
        line, vertices = line[::-1], vertices[::-1]
    return Edge((0, 1), (0, 1), "circle", line, "convex", vertices, (start, end), False)


@pytest.mark.parametrize("turned", [(False, False, False), (False, True, False), (True, False, True)])
def test_three_arcs_are_one_circle(turned, kit):
    ends = [0.0, 2.0, 4.0, 2 * np.pi]
    pieces = [arc(ends[k], ends[k + 1], (k, (k + 1) % 3), turned=turned[k]) for k in range(3)]
    faces = tuple(Face(k, 1.0, np.zeros(3)) for k in range(2))
    vertices = tuple(Vertex(np.zeros(3), (0, 1), (0, 1)) for _ in range(3))
    structure = Structure(faces, tuple(pieces), vertices)
    edges = joined(structure)
    assert len(edges) == 1
    assert edges[0].closed
    np.testing.assert_allclose(edges[0].polyline[0], edges[0].polyline[-1], atol=1e-12)
    steps = np.linalg.norm(np.diff(edges[0].polyline, axis=0), axis=1)
    assert steps.sum() == pytest.approx(2 * np.pi * 0.3, rel=1e-3)
    assert np.ptp(edges[0].t_range) == pytest.approx(2 * np.pi)
    assert len(corners_of(structure)) == 0
    planes = kit.box_planes(np.ones(3))[:2]
    none = kit.make_points(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    curve = wireframe(structure, planes, none).curves[0]
    assert curve.kind == "circle"
    assert curve.t_range == curve.t_solid
    assert not curve.from_edge_points


def test_pieces_of_different_faces_stay_apart():
    first, second = arc(0, 1, (0, 1)), arc(1, 2, (1, 2))
    other = Edge((0, 2), (0, 2), second.kind, second.polyline, "convex", (1, 2), second.t_range, False)
    assert len(joined(Structure((), (first, other), ()))) == 2


def test_edge_points_confirm_edges(kit):
    edge = arc(0, 3, (0, 1))
    structure = Structure((), (edge,), ())
    near = edge.polyline[:10]
    xyz = np.concatenate([near, np.full((10, 3), 0.9)])
    points = kit.make_points(xyz, np.tile([0, 0, 1.0], (20, 1)), np.zeros(20))
    assert support_by_edge_points(structure, points)["edges_confirmed"] is None
    points.curve[:] = 0
    found = support_by_edge_points(structure, points)
    assert found["edge_points_explained"] == 0.5
    assert found["edges_confirmed"] == 0.5
