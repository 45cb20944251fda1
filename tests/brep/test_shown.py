"""Edges that images show, against other solids' edges whose distances are known by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.brep.shown import ShownEdge, lost_edges, shown_edges
from brepgaussian.brep.structure import SMOOTH

PIXEL = 0.001
TURN = np.linspace(0, np.pi / 2, 60)
ARC = 0.01 * np.column_stack([np.cos(TURN), np.sin(TURN), 0 * TURN])  # rounds off the corner at (.01, .01, 0)
LEGS = np.linspace(0, 0.01, 60)
CORNER = np.concatenate(
    [np.column_stack([LEGS, 0 * LEGS + 0.01, 0 * LEGS]), np.column_stack([0 * LEGS + 0.01, LEGS, 0 * LEGS])]
)


def edge(line, px=0.05, count=40, arc=True):
    return ShownEdge(line, px, count, PIXEL, arc)


def row(name, px=None, count=40):
    """Row of the acceptance test's table of an edge that no silhouette shows."""
    return {"name": name, "interior_px": px, "interior": count, "silhouette_px": None, "silhouettes": 0, "creases": 40}


def known(*edges):
    """Edges (line, px) of a solid as its acceptance test tells them, one more beside them shown for sure."""
    rows = [row(f"edge {i}", px) for i, (_, px) in enumerate(edges)]
    beside = [row(f"edge {len(edges) + i}", 0.05) for i in range(len(edges))]
    found = shown_edges(solid(*(line for line, _ in edges), *(line for line, _ in edges)), [*rows, *beside], PIXEL)
    return found[: len(found) - len(beside)]


def solid(*lines, convexity="convex"):
    return SimpleNamespace(
        edges=[SimpleNamespace(polyline=line, convexity=convexity, surfaces=(2, 7)) for line in lines]
    )


def test_an_arc_that_is_surely_there_is_not_the_corner_that_it_rounds_off():
    """The arc is within .003 of the corner everywhere: three pixels, a quarter of what rough edges may be off by."""
    assert lost_edges(solid(CORNER), [edge(ARC)]) == 1
    assert lost_edges(solid(ARC), [edge(ARC)]) == 0


@pytest.mark.parametrize(("px", "count"), [(0.3, 40), (0.05, 10)])
def test_an_edge_that_is_known_roughly_may_be_off(px, count):
    assert lost_edges(solid(CORNER), [edge(ARC, px, count)]) == 0
    assert lost_edges(solid(CORNER + np.array([0, 0, 0.05])), [edge(ARC, px, count)]) == 1


def test_edges_of_no_fillet_are_compared_roughly():
    """Those of spurious faces fit as well: what views show there is a step, not whose it is."""
    beside = CORNER + np.array([0.004, 0.004, 0])
    assert lost_edges(solid(beside), [edge(CORNER, arc=False)]) == 0
    assert lost_edges(solid(beside), [edge(CORNER)]) == 1


@pytest.mark.parametrize(("off", "lost"), [(0.02, 0), (0.03, 1)])
def test_edges_of_a_solid_that_is_not_refined_may_lie_beside_their_places(off, lost):
    """Ten pixels of slack and the .012 that edges may be off by: beyond .022 no refinement finds the edge."""
    beside = CORNER + np.array([0, 0, off])
    assert lost_edges(solid(beside), [edge(CORNER, arc=False)]) == 1
    assert lost_edges(solid(beside), [edge(CORNER, arc=False)], slack_px=10) == lost


def test_edges_that_are_not_shown_cannot_be_lost():
    assert lost_edges(solid(CORNER), known((ARC, 0.8))) == 0


def test_a_solid_without_sharp_edges_has_none_of_them():
    smooth = solid(ARC, convexity=SMOOTH)
    for structure in (None, solid(), smooth):
        assert lost_edges(structure, known((ARC, 0.05), (ARC, 0.8))) == 1


@pytest.mark.parametrize(
    ("convexity", "fillets", "sure"), [("convex", {7}, True), ("concave", {7}, False), ("convex", {3}, False)]
)
def test_rows_of_edges_within_the_outline_are_what_is_shown(convexity, fillets, sure):
    structure = solid(ARC, CORNER, convexity=convexity)
    rows = [
        row("edge 1", 0.05, 31),
        row("edge 0", None, 0),
        row("rim 0", 0.1, 50),
    ]
    (found,) = shown_edges(structure, rows, PIXEL, fillets)
    np.testing.assert_array_equal(found.line, CORNER)
    assert (found.px, found.count, found.footprint) == (0.05, 31, PIXEL)
    assert found.is_sure == sure


@pytest.mark.parametrize(
    ("px", "smooth", "lost"), [(0.3, (2, 7), 0), (0.3, (2, 5), 1), (0.3, (), 1), (0.05, (2, 7), 1)]
)
def test_within_a_fillet_only_a_sure_edge_counts(px, smooth, lost):
    apart = CORNER + np.array([0, 0, 0.05])
    assert lost_edges(solid(apart), known((ARC, px)), smooth) == lost


@pytest.mark.parametrize(("others", "shown"), [((1.9, 2.3), 0), ((1.9, 0.3), 2), ((0.05, 1.9), 2), ((1.9, None), 0)])
@pytest.mark.parametrize("px", [0.3, 0.05])
def test_a_face_is_not_shown_by_one_rough_edge_of_several(px, others, shown):
    """Three lines, of a face that is guessed, are near some step by chance; one to a pixel's fraction they are not."""
    lines = (ARC, CORNER, CORNER + 0.05)
    rows = [row(f"edge {i}", value) for i, value in enumerate((px, *others))]
    found = shown_edges(solid(*lines), rows, PIXEL)
    assert len(found) == (shown or int(px < 0.1))
