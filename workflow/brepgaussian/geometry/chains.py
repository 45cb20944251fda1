"""Edges joined over vertices that nobody sees: where a curve was split by a seam, not by a corner."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Two edge ends within this angle continue each other. Corners of parts are degrees sharp; the kernel's
# tangents are exact to 1e-6, those of polylines to the angle of a step, about a degree.
CONTINUATION_DEG = 3.0


@dataclass(frozen=True)
class EdgeEnds:
    """What counting needs of one edge.

    Attributes:
        vertices: ids of its two end vertices, equal for a closed edge.
        tangents: (2, 3) unit tangents at its ends, both pointing into the edge.
        faces: its faces, sorted.
    """

    vertices: tuple[int, int]
    tangents: NDArray[np.float64]
    faces: tuple[int, ...]


def join(edges: Sequence[EdgeEnds], continuation_deg: float = CONTINUATION_DEG) -> tuple[NDArray[np.int64], int]:
    """Join edges that continue each other.

    A vertex is hidden if exactly two edge ends meet in it, which bound the same faces and continue each
    other without a bend (two ends of one closed edge included). Every other vertex is a corner.

    Returns:
        (E,) index of the joined curve of each edge, 0..C-1 in the order of first appearance, and the
        number of corners.
    """
    ends = defaultdict(list)
    for index, edge in enumerate(edges):
        for side in (0, 1):
            ends[edge.vertices[side]].append((index, side))
    limit = -np.cos(np.radians(continuation_deg))
    parent = list(range(len(edges)))
    corners = 0
    for meeting in ends.values():
        if not _hidden(edges, meeting, limit):
            corners += 1
            continue
        (a, _), (b, _) = meeting
        parent[max(_root(parent, a), _root(parent, b))] = min(_root(parent, a), _root(parent, b))
    roots = [_root(parent, i) for i in range(len(edges))]
    order = {root: k for k, root in enumerate(dict.fromkeys(roots))}
    return np.array([order[root] for root in roots], np.int64), corners


def _hidden(edges: Sequence[EdgeEnds], meeting: list[tuple[int, int]], limit: float) -> bool:
    if len(meeting) != 2:
        return False
    (a, i), (b, j) = meeting
    if edges[a].faces != edges[b].faces:
        return False
    return float(edges[a].tangents[i] @ edges[b].tangents[j]) < limit


def _root(parent: list[int], index: int) -> int:
    while parent[index] != index:
        index = parent[index]
    return index
