"""Edges that images show, against other solids' edges whose distances are known by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.brep.shown import ShownEdge, lost_edges, moved_edges, shown_edges
from brepgaussian.brep.structure import SMOOTH

PIXEL = 0.001
TURN = np.linspace(0, np.pi / 2, 60)
ARC = 0.01 * np.column_stack([np.cos(TURN), np.sin(TURN), 0 * TURN])  # rounds off the corner at (.01, .01, 0)
LEGS = np.linspace(0, 0.01, 60)
CORNER = np.concatenate(
    [np.column_stack([LEGS, 0 * LEGS + 0.01, 0 * LEGS]), np.column_stack([0 * LEGS + 0.01, LEGS, 0 * LEGS])]
)


def edge(line, px=0.05, count=40):
    return ShownEdge(line, px, count, PIXEL)


def solid(*lines, convexity="convex"):
    return SimpleNamespace(edges=[SimpleNamespace(polyline=line, convexity=convexity) for line in lines])


def test_an_arc_that_is_surely_there_is_not_the_corner_that_it_rounds_off():
    """The arc is within .003 of the corner everywhere: three pixels, a quarter of what rough edges may be off by."""
    assert lost_edges(solid(CORNER), [edge(ARC)]) == 1
    assert lost_edges(solid(ARC), [edge(ARC)]) == 0


@pytest.mark.parametrize(("px", "count"), [(0.3, 40), (0.05, 10)])
def test_an_edge_that_is_known_roughly_may_be_off(px, count):
    assert lost_edges(solid(CORNER), [edge(ARC, px, count)]) == 0
    assert lost_edges(solid(CORNER + np.array([0, 0, 0.05])), [edge(ARC, px, count)]) == 1


def test_the_false_edge_beside_a_valley_may_be_lost_though_it_fits_better_than_the_true_one():
    """Light fades towards the valley: what a spurious face beside it ends at is where the step seems to be."""
    valley = CORNER + np.array([0.004, 0.004, 0])
    false = ShownEdge(CORNER, 0.05, 40, PIXEL, convex=False)
    true = ShownEdge(valley, 1.4, 40, PIXEL, convex=False)
    assert lost_edges(solid(valley, convexity="concave"), [false]) == 0
    assert moved_edges([true], [false], limit_px=0.1) == 0
    assert lost_edges(solid(valley), [edge(CORNER)]) == 1
    assert moved_edges([edge(valley, 1.4)], [edge(CORNER)], limit_px=0.1) == 1


def test_edges_that_are_not_shown_cannot_be_lost():
    assert lost_edges(solid(CORNER), [edge(ARC, px=0.8)]) == 0


def test_a_solid_without_sharp_edges_has_none_of_them():
    smooth = solid(ARC, convexity=SMOOTH)
    for structure in (None, solid(), smooth):
        assert lost_edges(structure, [edge(ARC), edge(ARC, px=0.8)]) == 1


@pytest.mark.parametrize(("px", "count", "expected"), [(0.05, 40, 0), (0.14, 40, 0), (0.6, 40, 1), (0.6, 10, 0)])
def test_an_edge_that_fitted_and_is_farther_off_has_moved(px, count, expected):
    """A chord in place of an arc; beyond twice what it was off by and a limit, by enough observations."""
    chord = np.linspace(ARC[0], ARC[-1], 60)
    assert moved_edges([edge(chord, px, count)], [edge(ARC)], limit_px=0.1) == expected


def test_an_edge_beside_none_of_the_old_ones_has_not_moved():
    assert moved_edges([edge(ARC + np.array([0, 0, 0.1]), px=0.9)], [edge(ARC)], limit_px=0.1) == 0


def test_rows_of_edges_within_the_outline_are_what_is_shown():
    structure = solid(ARC, CORNER)
    structure.edges[0].convexity = "concave"
    rows = [
        {"name": "edge 1", "interior_px": 0.2, "interior": 31},
        {"name": "edge 0", "interior_px": None, "interior": 0},
        {"name": "rim 0", "interior_px": 0.1, "interior": 50},
    ]
    (found,) = shown_edges(structure, rows, PIXEL)
    np.testing.assert_array_equal(found.line, CORNER)
    assert (found.px, found.count, found.footprint, found.convex) == (0.2, 31, PIXEL, True)
    (found,) = shown_edges(structure, [{"name": "edge 0", "interior_px": 0.05, "interior": 40}], PIXEL)
    assert not found.is_sure
