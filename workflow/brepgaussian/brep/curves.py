"""Curves and corners of the published solid, for `brep.h5`.

The paper intersects primitives pairwise, trims the curves to the parameter range t of projected edge points,
and clusters candidate corners (section on primitive fitting and assembly). Here the arrangement has done
both exactly: a curve is what is left of an intersection between two faces of the solid, a corner is where
three meet. The edge points are the check: see `support_by_edge_points`.
"""

from collections import defaultdict
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.artifacts.brep import Curve
from brepgaussian.artifacts.points import Points
from brepgaussian.brep.structure import SMOOTH, Edge, Structure

Array = NDArray[np.float64]

_EDGE_VALUE = 0.5  # of a point from which it counts as an edge point
_NEAR = 0.02  # unit frame: the strict tolerance of the paper's curve scores


def curves_of(structure: Structure) -> tuple[Curve, ...]:
    """The solid's edges as trimmed curves; pieces that the kernel left of one curve are joined."""
    return tuple(Curve(kind=e.kind, faces=e.surfaces, t_range=e.t_range, points=e.polyline) for e in joined(structure))


def joined(structure: Structure) -> list[Edge]:
    """Edges, joined over vertices where just two pieces between the same two faces meet."""
    edges: dict[int, Edge] = dict(enumerate(structure.edges))
    at: dict[int, set[int]] = defaultdict(set)
    for index, edge in edges.items():
        for vertex in edge.vertices:
            at[vertex].add(index)
    for vertex in sorted(at):
        if len(at[vertex]) != 2:
            continue
        first, second = sorted(at[vertex])
        a, b = edges[first], edges[second]
        if a.closed or b.closed or sorted(a.faces) != sorted(b.faces):
            continue
        edges[first] = _chain(a, b, vertex)
        del edges[second]
        for end in edges[first].vertices:
            at[end] = {first if k == second else k for k in at[end]}
        at[vertex] = {first}
    return [edges[k] for k in sorted(edges)]


def _chain(a: Edge, b: Edge, vertex: int) -> Edge:
    """Two pieces as one edge through a common vertex, in the direction of the first."""
    if a.vertices[1] == vertex:
        head, tail = a, b if b.vertices[0] == vertex else _turned(b)
    else:
        head, tail = b if b.vertices[1] == vertex else _turned(b), a
    kind = a.kind if a.kind == b.kind else "other"
    length = abs(a.t_range[1] - a.t_range[0]) + abs(b.t_range[1] - b.t_range[0])
    start = head.t_range[0] if head.t_range[0] <= head.t_range[1] else 0.0
    return Edge(
        surfaces=a.surfaces,
        faces=a.faces,
        kind=kind,
        polyline=np.concatenate([head.polyline, tail.polyline[1:]]),
        convexity=a.convexity,
        vertices=(head.vertices[0], tail.vertices[1]),
        t_range=(0.0, 1.0) if kind == "other" else (start, start + length),
        closed=head.vertices[0] == tail.vertices[1],
    )


def _turned(edge: Edge) -> Edge:
    """The same edge from its other end."""
    return replace(edge, polyline=edge.polyline[::-1], vertices=(edge.vertices[1], edge.vertices[0]))


def corners_of(structure: Structure) -> Array:
    """(C, 3) vertices where three or more faces meet."""
    return np.array([v.point for v in structure.vertices if v.corner]).reshape(-1, 3)


def support_by_edge_points(structure: Structure, points: Points) -> dict[str, Any]:
    """How edge points and the solid's sharp edges agree: a check without a truth.

    Returns:
        `edge_points_explained`: share of edge points near a sharp edge; `edges_confirmed`: share of the
        sharp edges' length with an edge point nearby; both None without edge points or sharp edges.
    """
    chosen = (points.curve >= 0) | (points.edge > _EDGE_VALUE)
    sharp = [e.polyline for e in structure.edges if e.convexity != SMOOTH]
    if not chosen.any() or not sharp:
        return {"edge_points_explained": None, "edges_confirmed": None}
    curves, cloud = np.concatenate(sharp), points.xyz[chosen].astype(float)
    explained = cKDTree(curves).query(cloud)[0] <= _NEAR
    confirmed = cKDTree(cloud).query(curves)[0] <= _NEAR
    return {
        "edge_points_explained": round(float(explained.mean()), 4),
        "edges_confirmed": round(float(confirmed.mean()), 4),
    }
