"""Curves' ranges and corners from edge points, against analytic curves."""

from itertools import pairwise, product

import numpy as np
import pytest
from brepgaussian.artifacts.base import Provenance
from brepgaussian.artifacts.brep import Brep, read_brep
from brepgaussian.artifacts.points import Points
from brepgaussian.brep.carrier import carrier_of
from brepgaussian.brep.curves import wireframe
from brepgaussian.brep.edge_ranges import edge_points
from brepgaussian.brep.structure import Edge, Structure, Vertex
from brepgaussian.geometry.surfaces import cylinder, plane
from hypothesis import given, settings
from hypothesis import strategies as st

TURN = 2 * np.pi
SIZE = np.array([1.0, 0.8, 0.5])


def edge_cloud(xyz):
    """Points that are all edge points."""
    n = len(xyz)
    normals = np.tile(np.float32([0, 0, 1]), (n, 1))
    return Points(np.float32(xyz), normals, np.ones(n, np.float32), np.zeros(n, np.int32), np.zeros(n, np.int32))


def box():
    """Structure and planes of a box; plane 2 a + (side + 1) / 2 is x_a = .5 + side size_a / 2."""
    planes = []
    for axis, side in product(range(3), (-1, 1)):
        normal = side * np.eye(3)[axis]
        planes.append(plane(0.5 + 0.5 * SIZE[axis] * normal, normal))
    places = list(product((-1, 1), repeat=3))
    names = [tuple(2 * a + (p[a] + 1) // 2 for a in range(3)) for p in places]
    vertices = tuple(Vertex(0.5 + 0.5 * SIZE * p, n, n) for p, n in zip(places, names, strict=True))
    edges = []
    for i, j in product(range(8), range(8)):
        common = tuple(sorted(set(names[i]) & set(names[j])))
        if i < j and len(common) == 2:
            line = np.linspace(vertices[i].point, vertices[j].point, 30)
            length = np.linalg.norm(line[-1] - line[0])
            edges.append(Edge(common, common, "line", line, "convex", (i, j), (0.0, length), False))
    return Structure((), tuple(edges), vertices), planes


def rim(start, stop, vertices=(0, 1), radius=0.3):
    """An arc between a cylinder (0) and a plane (1)."""
    t = np.linspace(start, stop, 60)
    line = 0.5 + radius * np.column_stack([np.cos(t), np.sin(t), np.zeros(60)])
    closed = bool(np.isclose(stop - start, TURN))
    return Edge((0, 1), (0, 1), "circle", line, "convex", (0, 0) if closed else vertices, (start, stop), closed)


ROUND = [cylinder(np.full(3, 0.5), np.array([0, 0, 1.0]), 0.3), plane(np.full(3, 0.5), np.array([0, 0, 1.0]))]


@pytest.mark.parametrize(("sigma", "seed"), [(0.0005, 1), (0.002, 2), (0.004, 3)])
def test_noisy_edge_points_give_a_box_its_ranges_and_corners(sigma, seed):
    structure, planes = box()
    rng = np.random.default_rng(seed)
    ends = [(e.polyline[0], e.polyline[-1]) for e in structure.edges]
    xyz = np.concatenate([a + rng.random((150, 1)) * (b - a) for a, b in ends])
    points = edge_cloud(xyz + sigma * rng.normal(size=xyz.shape))
    found = wireframe(structure, planes, points)
    assert all(c.from_edge_points for c in found.curves)
    for curve, (a, b) in zip(found.curves, ends, strict=True):
        span = curve.frame[0] + np.outer(curve.t_edge, curve.frame[1])
        np.testing.assert_allclose(span, [a, b], atol=0.03 + 4 * sigma)  # as far as random points go
        trimmed = curve.frame[0] + np.outer(curve.t_range, curve.frame[1])
        np.testing.assert_allclose(trimmed, [a, b], atol=1e-5)  # up to the corners
        assert curve.t_solid == pytest.approx((0, np.linalg.norm(b - a)))
    assert sorted(c.vertex for c in found.clusters) == list(range(8))
    for corner in found.clusters:
        np.testing.assert_allclose(corner.point, found.corners[corner.vertex], atol=1e-5)
        assert corner.size >= 3
    assert found.report["curves_from_edge_points"] == 1
    assert found.report["corners_confirmed"] == 1


def test_a_range_is_what_the_points_span_not_what_the_solid_says():
    structure, planes = box()
    edge = structure.edges[0]
    a, b = edge.polyline[0], edge.polyline[-1]
    length = np.linalg.norm(b - a)
    xyz = a + np.linspace(0.2, 0.8, 200)[:, None] * (b - a)
    found = wireframe(structure, planes, edge_cloud(xyz))
    curve = found.curves[0]
    assert curve.from_edge_points
    np.testing.assert_allclose(curve.t_range, [0.2 * length, 0.8 * length], atol=1e-4)
    assert curve.coverage == pytest.approx(0.6, abs=0.05)
    assert [c.from_edge_points for c in found.curves[1:]] == [False] * 11
    assert all(c.t_range == c.t_solid for c in found.curves[1:])
    assert not found.clusters


@settings(max_examples=40, deadline=None)
@given(start=st.floats(0, TURN), sweep=st.floats(0.4, 5.5), solid=st.floats(-0.1, 0.1), seed=st.integers(0, 99))
def test_arcs_wherever_the_seam_is(start, sweep, solid, seed):
    edge = rim(start, start + sweep)
    rng = np.random.default_rng(seed)
    t = np.linspace(start + solid, start + sweep - solid, 300)
    xyz = 0.5 + 0.3 * np.column_stack([np.cos(t), np.sin(t), np.zeros(300)]) + 5e-4 * rng.normal(size=(300, 3))
    curve = wireframe(Structure((), (edge,), ()), ROUND, edge_cloud(xyz)).curves[0]
    assert curve.from_edge_points
    np.testing.assert_allclose(curve.t_solid, [0, sweep], atol=1e-9)
    np.testing.assert_allclose(curve.t_range, [solid, sweep - solid], atol=0.02)
    at = np.array(curve.t_range)[:, None]
    place = curve.frame[0] + curve.radii[0] * np.cos(at) * curve.frame[1] + curve.radii[1] * np.sin(at) * curve.frame[2]
    np.testing.assert_allclose(place, xyz[[0, -1]], atol=0.01)


@pytest.mark.parametrize("gap", [0.0, 1.0])
def test_a_whole_circle_and_one_with_a_gap_over_the_seam(gap):
    edge = rim(0, TURN)
    t = np.linspace(gap / 2, TURN - gap / 2, 400)  # the solid's seam is at t = 0
    t = np.roll(t, 123) + 2.0
    turned = rim(2.0, 2.0 + TURN)
    xyz = 0.5 + 0.3 * np.column_stack([np.cos(t), np.sin(t), np.zeros(400)])
    curve = wireframe(Structure((), (turned,), ()), ROUND, edge_cloud(xyz)).curves[0]
    assert np.diff(curve.t_edge)[0] == pytest.approx(TURN - gap, abs=0.02)
    assert curve.t_edge[0] % TURN == pytest.approx(gap / 2, abs=0.02)
    other = wireframe(Structure((), (edge,), ()), ROUND, edge_cloud(xyz)).curves[0]
    assert np.diff(other.t_edge)[0] == pytest.approx(TURN - gap, abs=0.02)  # across t = 0
    for found in (curve, other):  # it meets no other curve: it has no end
        assert found.from_edge_points
        assert found.t_range == (0.0, TURN)
        assert found.coverage == pytest.approx(1 - gap / TURN, abs=0.03)


def test_two_edges_on_one_line_keep_their_own_points():
    top, front = plane(np.zeros(3), np.array([0, 0, 1.0])), plane(np.zeros(3), np.array([0, -1.0, 0]))
    spans = [(0.0, 0.3), (0.36, 0.7)]
    edges = tuple(
        Edge(
            (0, 1),
            (2 * k, 1),
            "line",
            np.linspace([a, 0, 0], [b, 0, 0], 30),
            "convex",
            (2 * k, 2 * k + 1),
            (a, b),
            False,
        )
        for k, (a, b) in enumerate(spans)
    )
    x = np.concatenate([np.linspace(a, b, 60) for a, b in spans])
    points = edge_cloud(np.column_stack([x, 0 * x, 0 * x]))
    found = wireframe(Structure((), edges, ()), [top, front], points)
    for curve, (a, b) in zip(found.curves, spans, strict=True):
        np.testing.assert_allclose(curve.t_range, [0, b - a], atol=1e-3)


def ellipse(count=80, turn=5.0):
    t = np.linspace(0.7, 0.7 + turn, count)
    x, y = np.array([1.0, 0, 0]), np.array([0, 0.6, 0.8])
    return 0.4 + 0.3 * np.cos(t)[:, None] * x + 0.2 * np.sin(t)[:, None] * y


@pytest.mark.parametrize("polyline", [ellipse(), ellipse()[::-1], ellipse(turn=0.8), ellipse(turn=0.8)[::-1]])
def test_ellipses_keep_their_samples_and_their_direction(polyline):
    carrier = carrier_of("ellipse", polyline, [])
    assert carrier.kind == "ellipse"
    t = np.unwrap(carrier.parameters(polyline))
    assert (np.diff(t) > 0).all()
    np.testing.assert_allclose(carrier.evaluate(t), polyline, atol=1e-9)
    np.testing.assert_allclose(np.sort(carrier.radii), [0.2, 0.3], atol=1e-6)


def test_a_general_curve_is_walked_past_its_ends():
    surfaces = [cylinder(np.zeros(3), np.array([0, 0, 1.0]), 0.3), cylinder(np.zeros(3), np.array([1.0, 0, 0]), 0.4)]
    angle = np.linspace(0, np.pi, 200)
    curve = np.column_stack([0.3 * np.cos(angle), 0.3 * np.sin(angle), np.sqrt(0.16 - 0.09 * np.sin(angle) ** 2)])
    carrier = carrier_of("other", curve[40:160], surfaces)
    length = sum(np.linalg.norm(b - a) for a, b in pairwise(curve[40:160]))
    beyond = curve[32:36]
    assert (carrier.parameters(beyond) < 0).all()
    assert carrier.distance(beyond).max() < 1e-4
    np.testing.assert_allclose(carrier.parameters(curve[[40, 159]]), [0, 1], atol=1e-3)
    assert carrier.scale == pytest.approx(length)


def test_ranges_and_clusters_come_back_from_the_file(tmp_path):
    structure, planes = box()
    ends = [(e.polyline[0], e.polyline[-1]) for e in structure.edges]
    xyz = np.concatenate([np.linspace(a, b, 80) for a, b in ends])
    found = wireframe(structure, planes, edge_cloud(xyz))
    Brep(tuple(planes), found.curves, found.corners, {}, found.clusters).write(tmp_path / "brep.h5", Provenance())
    again = read_brep(tmp_path / "brep.h5")
    for a, b in zip(found.curves, again.curves, strict=True):
        assert (a.t_range, a.t_solid, a.t_edge, a.support) == (b.t_range, b.t_solid, b.t_edge, b.support)
        np.testing.assert_array_equal(a.frame, b.frame)
    assert [c.vertex for c in again.clusters] == [c.vertex for c in found.clusters]


def test_an_instance_that_bridges_a_gap_counts_only_beside_measured_points():
    line = np.linspace([0, 0, 0], [1, 0, 0], 401)
    measured = line[np.abs(line[:, 0] - 0.5) > 0.2]
    count = len(measured)
    points = edge_cloud(np.concatenate([measured, line]))
    points.curve[:count] = -1
    kept = edge_points(points)[count:]
    assert np.abs(kept[:, 0] - 0.5).min() == pytest.approx(0.18, abs=3e-3)
    assert len(edge_points(points, [line])) == count + 401
    points.edge[:count] = 0
    assert len(edge_points(points)) == 401
