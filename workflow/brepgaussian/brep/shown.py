"""Edges of a solid that the images show within its outline, and what another solid makes of them. Imports no OCP."""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.brep.structure import CONVEX, SMOOTH, Structure

Array = NDArray[np.float64]

SHOWN_PX = 0.5  # median distance of an edge from a step of luminance that shows it
_SURE_PX = 0.1  # the same of an edge that is known to be where it is,
_SEEN = 20  # if so many observations say so
_SAME_EDGE = 0.012  # unit frame: twice the width of a rounded-off edge, beside which a fringe has its false ones
_HALF = 0.5  # of an edge that another solid has, too;
_MOSTLY = 0.75  # of one that is known to a pixel: half of a small arc lies that near to the corner that it rounds off
_MAJORITY = 0.5  # of what is seen of a face's sharp edges


@dataclass(frozen=True)
class ShownEdge:
    """An edge beside which the images show a step of luminance.

    Attributes:
        line: (S, 3) samples, unit frame; px: median distance from that step; count: of its observations.
        footprint: size of a pixel there, unit frame.
        surfaces: indices of the surfaces that meet in it.
        arc: whether a fillet ends there, on convex ground (in valleys light fades towards the edge, and the step that
            views show lies pixels beside it): the corner that it rounds off is nearly as good.
    """

    line: Array
    px: float
    count: int
    footprint: float
    arc: bool = False
    surfaces: tuple[int, int] = (-1, -1)

    @property
    def is_sure(self) -> bool:
        """Whether the images know to a fraction of a pixel where it is."""
        return self.arc and self.px < _SURE_PX and self.count >= _SEEN

    def is_on(self, edges: cKDTree, slack_px: float = 0.0) -> bool:
        """Whether another solid, by samples of its sharp edges that lie off by no more than `slack_px`, has it."""
        reach, share = (self.footprint, _MOSTLY) if self.is_sure else (_SAME_EDGE, _HALF)
        return bool(np.mean(edges.query(self.line)[0] <= reach + slack_px * self.footprint) >= share)


def shown_edges(
    structure: Structure, rows: Iterable[Mapping[str, Any]], footprint: float, fillets: Collection[int] = ()
) -> tuple[ShownEdge, ...]:
    """The edges within a solid's outline most samples of which lie where the images show a step of luminance.

    Not those that are known to no fraction of a pixel, of a face most of whose other edges the images do not show: some
    step lies near one of several lines that are guessed.

    Args:
        structure: of the solid.
        rows: the acceptance test's table of edges.
        footprint: size of a pixel at the object, unit frame.
        fillets: indices of surfaces that roll on others.
    """
    found = []
    table = dict(edge_rows(rows))
    guessed = _guessed(structure, table)
    for index, row in table.items():
        edge = structure.edges[index]
        if _is_step(row) and not (row["interior_px"] >= _SURE_PX and guessed.intersection(edge.surfaces)):
            rolled = any(i in fillets for i in edge.surfaces)
            px, count = float(row["interior_px"]), int(row["interior"])
            arc = edge.convexity == CONVEX and rolled
            found.append(ShownEdge(edge.polyline, px, count, footprint, arc, edge.surfaces))
    return tuple(found)


def _guessed(structure: Structure, table: Mapping[int, Mapping[str, Any]]) -> set[int]:
    """Surfaces most of whose sharp edges, by what is seen of these, no step and no silhouette shows."""
    seen, shown = Counter[int](), Counter[int]()
    for index, row in table.items():
        edge = structure.edges[index]
        if edge.convexity != SMOOTH:
            count = int(row["silhouettes"]) + int(row["creases"])
            seen.update(dict.fromkeys(edge.surfaces, count))
            shown.update(dict.fromkeys(edge.surfaces, count if is_shown(row) else 0))
    return {i for i, count in seen.items() if shown[i] < _MAJORITY * count}


def edge_rows(rows: Iterable[Mapping[str, Any]]) -> Iterator[tuple[int, Mapping[str, Any]]]:
    """Indices of edges and their rows in the acceptance test's table, which has faces' contours, too."""
    for row in rows:
        kind, index = str(row["name"]).rsplit(" ", 1)
        if kind == "edge":
            yield int(index), row


def is_shown(row: Mapping[str, Any]) -> bool:
    """Whether silhouettes or steps of luminance show an edge, by its row of the acceptance test."""
    return row["silhouette_px"] is not None or _is_step(row)


def _is_step(row: Mapping[str, Any]) -> bool:
    return row["interior_px"] is not None and row["interior_px"] < SHOWN_PX


def lost_edges(
    structure: Structure | None, known: Sequence[ShownEdge], smooth: Collection[int] = (), slack_px: float = 0.0
) -> int:
    """Number of edges that the images show and a solid lacks.

    Args:
        structure: of the solid; without one it lacks all.
        known: that the images show.
        smooth: surfaces of another solid that are one smooth face in this one. Light grows over a fillet, and some
            step is found beside every line in it: one counts only where images know it to a fraction of a pixel.
        slack_px: by how much edges of the solid may lie beside their places.
    """
    known = [e for e in known if e.px < _SURE_PX or not set(e.surfaces) <= set(smooth)]
    edges = [] if structure is None else structure.edges
    sharp = [e.polyline for e in edges if e.convexity != SMOOTH]
    if not sharp:
        return len(known)
    tree = cKDTree(np.concatenate(sharp))
    return sum(not edge.is_on(tree, slack_px) for edge in known)
