"""Corners as intersections of three surfaces or two curves near the ends of edge-point ranges, clustered."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.borders import clusters
from brepgaussian.brep.carrier import Carrier
from brepgaussian.brep.edge_ranges import Range
from brepgaussian.brep.refine.mesh import evaluate, slave
from brepgaussian.brep.structure import Edge
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_ON_ALL = 1e-6  # unit frame; an intersection lies this near to all its surfaces
_CLUSTER_SHARE = 0.4  # of the shortest edge: its two ends stay two corners


@dataclass(frozen=True)
class Corners:
    """Clustered corner candidates.

    Attributes:
        xyz: (K, 3) positions, the mean of each cluster.
        size: (K,) number of candidates.
        of_end: cluster at the (first, last) end of every edge's range, -1 for none.
    """

    xyz: Array
    size: Indices
    of_end: tuple[tuple[int, int], ...]


def corner_candidates(
    edges: Sequence[Edge],
    carriers: Sequence[Carrier],
    ranges: Sequence[Range],
    surfaces: Sequence[Surface],
    reach: float,
) -> Corners:
    """Intersect every curve with those that its edge points end at, and cluster the intersections.

    Two curves on three surfaces in all meet where the three surfaces do (three planes, for straight edges).

    Args:
        edges, carriers, ranges: alike in order.
        surfaces: what the edges' surface indices mean.
        reach: distance by which the range of the points may fall short of its corner.
    """
    found, ends = [np.zeros((0, 3))], []
    for index, (carrier, own) in enumerate(zip(carriers, ranges, strict=True)):
        if not own.trusted or own.closed:
            continue
        for side, point in enumerate(carrier.evaluate(np.array(own.t_edge))):
            met = _meetings(index, point, edges, carriers, ranges, surfaces, reach)
            found.append(met)
            ends += [(index, side)] * len(met)
    candidates = np.concatenate(found)
    of_end = np.full((len(edges), 2), -1)
    if not len(candidates):
        return Corners(candidates, np.zeros(0, np.int64), _pairs(of_end))
    shortest = min(c.length for c in carriers)
    groups = clusters(candidates, min(reach, _CLUSTER_SHARE * shortest))
    xyz = np.array([candidates[g].mean(axis=0) for g in groups])
    least = np.full((len(edges), 2), np.inf)
    for number, group in enumerate(groups):
        for index, side in (ends[k] for k in group):
            start = carriers[index].evaluate(np.array(ranges[index].t_edge))[side]
            off = float(np.linalg.norm(xyz[number] - start))
            if off < least[index, side]:
                least[index, side], of_end[index, side] = off, number
    return Corners(xyz, np.array([len(g) for g in groups]), _pairs(of_end))


def _pairs(of_end: Indices) -> tuple[tuple[int, int], ...]:
    return tuple((int(a), int(b)) for a, b in of_end)


def _meetings(
    index: int,
    point: Array,
    edges: Sequence[Edge],
    carriers: Sequence[Carrier],
    ranges: Sequence[Range],
    surfaces: Sequence[Surface],
    reach: float,
) -> Array:
    """(M, 3) intersections of one edge with the others near one end of its range."""
    found = []
    for other, edge in enumerate(edges):
        own = ranges[other]
        if other == index or not own.trusted or carriers[other].distance(point[None])[0] > reach:
            continue
        near = float(np.linalg.norm(point - carriers[other].evaluate(np.linspace(*own.t_edge, 64)), axis=1).min())
        if near > reach + carriers[other].length / 64:
            continue
        names = sorted({s for s in (*edges[index].surfaces, *edge.surfaces) if s >= 0})
        if len(names) < 3:
            continue
        table = np.array([names], np.int64)
        meeting = slave(point[None], table, surfaces)
        off = np.abs(evaluate(meeting, table, surfaces)[0]).max()
        if off < _ON_ALL and np.linalg.norm(meeting[0] - point) <= 2 * reach:
            found.append(meeting[0])
    return np.array(found).reshape(-1, 3)


def reconciled(range_: Range, carrier: Carrier, ends: tuple[int, int], corners: Corners) -> tuple[float, float]:
    """The published range: what the edge points span, up to the corners at its ends; the solid's without points.

    A curve of the solid that closes on itself meets no other and cannot end: points on most of it stand for all.
    """
    if not range_.trusted or range_.closed:
        return range_.t_solid
    result = list(range_.t_edge)
    for side, cluster in enumerate(ends):
        if cluster >= 0:
            t = float(carrier.parameters(corners.xyz[cluster][None])[0])
            if carrier.periodic:
                t += 2 * np.pi * round((result[side] - t) / (2 * np.pi))
            result[side] = t
    return (result[0], result[1]) if result[0] < result[1] else range_.t_edge
