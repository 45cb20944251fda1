"""Curves and corners of the published solid, for `brep.h5`.

The paper intersects primitives pairwise, trims the curves to the parameter range t of projected edge points,
and clusters candidate corners (section on primitive fitting and assembly). The same is done here, on the
curves of the solid: `edge_ranges` projects the edge points, `corner_candidates` intersects and clusters. The
solid's own ranges and vertices, which the arrangement has made exact, stand beside them.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.artifacts.brep import Corner, Curve
from brepgaussian.artifacts.points import Points
from brepgaussian.brep.carrier import Carrier, carrier_of
from brepgaussian.brep.corner_candidates import Corners, corner_candidates, reconciled
from brepgaussian.brep.edge_ranges import NEAR, Range, assign, edge_points, ranges
from brepgaussian.brep.structure import SMOOTH, Edge, Structure
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]

_DIGITS = 6  # of figures in the report


@dataclass(frozen=True)
class Wireframe:
    """Curves, corners, and what the edge points say about them.

    Attributes:
        curves: the solid's edges, trimmed by edge points.
        corners: (C, 3) vertices of the solid where three or more faces meet.
        clusters: corner candidates from edge points, clustered.
        report: `curves_from_edge_points`, `range_error`, `corners_confirmed`, and the two shares of
            `support_by_edge_points`.
    """

    curves: tuple[Curve, ...]
    corners: Array
    clusters: tuple[Corner, ...]
    report: dict[str, Any]


def wireframe(structure: Structure, surfaces: Sequence[Surface], points: Points) -> Wireframe:
    """Trim the solid's intersection curves by the edge points, and find their corners."""
    edges = joined(structure)
    carriers = [carrier_of(e.kind, e.polyline, [surfaces[s] for s in e.surfaces if s >= 0]) for e in edges]
    sharp = [e.polyline for e in edges if e.convexity != SMOOTH]
    found = assign(edge_points(points, sharp), edges, carriers)
    spans = ranges(found, edges, carriers)
    corners = corner_candidates(edges, carriers, spans, surfaces, found.gap)
    curves = tuple(
        Curve(
            kind=c.kind, faces=e.surfaces, t_range=reconciled(r, c, ends, corners), points=e.polyline,
            t_solid=r.t_solid, t_edge=r.t_edge, support=r.support, coverage=r.coverage,
            frame=np.array([c.origin, c.x, c.y]), radii=c.radii,
        )
        for e, c, r, ends in zip(edges, carriers, spans, corners.of_end, strict=True)
    )  # fmt: skip
    vertices = corners_of(structure)
    clusters = _matched(corners, vertices, found.gap)
    report = support_by_edge_points(structure, points) | _summary(edges, carriers, spans, clusters, vertices)
    return Wireframe(curves, vertices, clusters, report)


def _matched(corners: Corners, vertices: Array, reach: float) -> tuple[Corner, ...]:
    """Every cluster with the solid's vertex that it confirms."""
    if not len(corners.xyz):
        return ()
    distance, at = np.full(len(corners.xyz), np.inf), np.full(len(corners.xyz), -1)
    if len(vertices):
        distance, at = cKDTree(vertices).query(corners.xyz)
    return tuple(
        Corner(point, int(size), int(v) if d <= reach else -1)
        for point, size, v, d in zip(corners.xyz, corners.size, at, distance, strict=True)
    )


def _summary(
    edges: Sequence[Edge],
    carriers: Sequence[Carrier],
    spans: Sequence[Range],
    clusters: Sequence[Corner],
    vertices: Array,
) -> dict[str, Any]:
    """How far ranges and corners from edge points agree with the solid; None where there is nothing to compare."""
    sharp = [k for k, e in enumerate(edges) if e.convexity != SMOOTH]
    trusted = [k for k in sharp if spans[k].trusted]
    errors = [
        carriers[k].scale * float(np.abs(np.subtract(spans[k].t_edge, spans[k].t_solid)).max())
        for k in trusted
        if not edges[k].closed
    ]
    met = {c.vertex for c in clusters if c.vertex >= 0}
    return {
        "curves_from_edge_points": round(len(trusted) / len(sharp), _DIGITS) if sharp else None,
        "range_error": round(float(np.median(errors)), _DIGITS) if errors else None,
        "corners_confirmed": round(len(met) / len(vertices), _DIGITS) if len(vertices) else None,
    }


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
    sharp = [e.polyline for e in structure.edges if e.convexity != SMOOTH]
    cloud = edge_points(points, sharp)
    if not len(cloud) or not sharp:
        return {"edge_points_explained": None, "edges_confirmed": None}
    curves = np.concatenate(sharp)
    explained = cKDTree(curves).query(cloud)[0] <= NEAR
    confirmed = cKDTree(cloud).query(curves)[0] <= NEAR
    return {
        "edge_points_explained": round(float(explained.mean()), 4),
        "edges_confirmed": round(float(confirmed.mean()), 4),
    }
