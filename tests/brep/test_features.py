"""Chamfers proposed on edges that the images place elsewhere."""

import numpy as np
import pytest
from brep_support import patches_of
from brepgaussian.brep.features import WIDTHS, apart, chamfers
from brepgaussian.brep.structure import Edge, Structure
from brepgaussian.geometry.surfaces import cylinder, plane

HEIGHT, RADIUS = 0.7, 0.3
UP = np.array([0, 0, 1.0])


def rim(convexity="convex"):
    t = np.linspace(0, 2 * np.pi, 190)
    line = np.column_stack([0.5 + RADIUS * np.cos(t), 0.5 + RADIUS * np.sin(t), np.full(190, HEIGHT)])
    return Edge((0, 1), (0, 1), "circle", line, convexity, (0, 0), (0, 2 * np.pi), True)


def round_case(hole):
    """A plane and a cylinder that meet in a circle, with their points."""
    rng = np.random.default_rng(1)
    angle = rng.random(4000) * 2 * np.pi
    wall = np.column_stack([np.cos(angle) * RADIUS, np.sin(angle) * RADIUS, rng.random(4000) * 0.4 - 0.2]) + 0.5
    rho = RADIUS * (1 + 0.6 * rng.random(4000)) if hole else RADIUS * np.sqrt(rng.random(4000))
    top = np.column_stack([0.5 + np.cos(angle) * rho, 0.5 + np.sin(angle) * rho, np.full(4000, HEIGHT)])
    surfaces = [cylinder(np.full(3, 0.5), UP, RADIUS, flipped=hole), plane(np.array([0.5, 0.5, HEIGHT]), UP)]
    return surfaces, patches_of(surfaces, [wall, top])


def table(px, name="edge 0"):
    return [{"name": name, "silhouette_px": px, "interior_px": None}]


@pytest.mark.parametrize("hole", [False, True])
def test_a_rim_gets_cones_that_meet_both_neighbours(hole):
    surfaces, patches = round_case(hole)
    found = chamfers(Structure((), (rim(),), ()), surfaces, patches, table(4.0))
    assert len(found) == len(WIDTHS)
    for width, change in zip(WIDTHS, found, strict=True):
        assert change.gone == (0, 1)
        wall, top, band = change.new
        sign = 1 if hole else -1
        ends = 0.5 + np.array([[RADIUS, 0, HEIGHT - 0.5 - width], [RADIUS + sign * width, 0, HEIGHT - 0.5]])
        np.testing.assert_allclose(band.surface.signed_distance(ends), 0, atol=1e-12)
        inside = ends.mean(axis=0) - 0.01 * np.array([-sign, 0, 1.0])
        assert (band.surface.normals(ends) @ [-sign, 0, 1.0] > 0.9).all()  # out of the material
        assert band.surface.signed_distance(inside[None])[0] < 0
        rho = np.hypot(*(band.xyz[:, :2] - 0.5).T)
        assert np.abs(rho - RADIUS).max() <= width + 1e-9
        assert band.xyz[:, 2].min() > HEIGHT - width - 1e-9
        assert wall.xyz[:, 2].max() < HEIGHT - 0.9 * width
        assert len(top.xyz) < len(patches[1].xyz)


def test_an_edge_between_planes_gets_a_plane():
    surfaces = [plane(np.array([0.5, 0.5, 0.8]), UP), plane(np.array([0.9, 0.5, 0.5]), np.array([1.0, 0, 0]))]
    rng = np.random.default_rng(0)
    top = rng.random((3000, 3)) * [0.8, 0.8, 0] + [0.1, 0.1, 0.8]
    side = rng.random((3000, 3)) * [0, 0.8, 0.6] + [0.9, 0.1, 0.2]
    line = np.column_stack([np.full(80, 0.9), np.linspace(0.1, 0.9, 80), np.full(80, 0.8)])
    edge = Edge((0, 1), (0, 1), "line", line, "convex", (0, 1), (0, 0.8), False)
    found = chamfers(Structure((), (edge,), ()), surfaces, patches_of(surfaces, [top, side]), table(3.0))
    for width, change in zip(WIDTHS, found, strict=True):
        made = change.new[-1].surface
        np.testing.assert_allclose(made.axis, [np.sqrt(0.5), 0, np.sqrt(0.5)])
        corners = np.array([[0.9 - width, 0.5, 0.8], [0.9, 0.5, 0.8 - width]])
        np.testing.assert_allclose(made.signed_distance(corners), 0, atol=1e-12)


def test_faces_that_lean_to_come_near_a_fillet_leave_a_fraction_of_a_pixel():
    surfaces, patches = round_case(False)
    assert chamfers(Structure((), (rim(),), ()), surfaces, patches, table(0.45))


@pytest.mark.parametrize(
    ("edge", "rows"),
    [
        (rim(), table(0.05)),  # where it should be
        (rim("concave"), table(4.0)),
        (rim(), table(4.0, "contour of face 0")),
        (rim(), table(None)),
    ],
)
def test_nothing_is_proposed_without_a_reason(edge, rows):
    surfaces, patches = round_case(False)
    assert chamfers(Structure((), (edge,), ()), surfaces, patches, rows) == []


def test_an_edge_of_a_face_that_would_lose_its_points_leaves_the_others_their_chamfers():
    surfaces, patches = round_case(False)
    line = np.column_stack([np.linspace(0.4, 0.6, 80), np.full(80, 0.5), np.full(80, HEIGHT)])
    narrow = plane(line[0], np.array([0, 1.0, 0]))
    strip = np.column_stack([line[:, 0], line[:, 1], HEIGHT - 0.008 * np.random.default_rng(2).random(80)])
    edges = rim(), Edge((1, 2), (2, 3), "line", line, "convex", (1, 2), (0, 0.2), False)
    both = [*surfaces, narrow], [*patches, *patches_of([narrow], [strip])]
    found = chamfers(Structure((), edges, ()), *both, table(4.0) + table(4.0, "edge 1"))
    for change, alone in zip(found, chamfers(Structure((), edges[:1], ()), surfaces, patches, table(4.0)), strict=True):
        assert (change.name, change.gone) == (alone.name, alone.gone)
        assert [len(p.xyz) for p in change.new] == [len(p.xyz) for p in alone.new]


def test_refused_edges_are_asked_pair_by_pair_worst_first():
    line = Edge((1, 2), (2, 3), "line", np.zeros((2, 3)), "convex", (1, 2), (0, 0.2), False)
    structure = Structure((), (rim(), line, rim(), line), ())
    rows = table(1.5) + table(4.0, "edge 1") + table(2.0, "edge 2") + table(0.1, "edge 3")
    assert [[row["name"] for row in t] for t in apart(structure, rows)] == [["edge 1"], ["edge 0", "edge 2"]]
    assert apart(structure, table(1.0) + table(2.0, "edge 2")) == []  # one pair: asked already
