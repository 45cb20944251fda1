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


def resample(polyline: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """(count + 1, 3) points at equal arc lengths along a polyline (N, 3)."""
    steps = np.linalg.norm(np.diff(polyline, axis=0), axis=1)
    arc = np.concatenate([[0.0], np.cumsum(steps)])
    wanted = np.linspace(0, arc[-1], count + 1)
    return np.column_stack([np.interp(wanted, arc, polyline[:, k]) for k in range(3)])


def end_tangents(polyline: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2, 3) unit tangents at the ends of a sampled smooth curve (N, 3), both pointing into it (second order)."""
    tangents = []
    for line in (polyline, polyline[::-1]):
        first = line[1] - line[0]
        tangents.append(2 * first - (line[2] - line[0]) / 2 if len(line) > 2 else first)
    lengths = np.linalg.norm(tangents, axis=1, keepdims=True)
    return np.array(tangents) / np.maximum(lengths, 1e-300)
