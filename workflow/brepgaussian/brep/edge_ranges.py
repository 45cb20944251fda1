"""Parameter ranges t of the intersection curves from the edge points that lie on them (paper, section 3.4).

Every edge point is assigned to the nearest unbounded intersection curve and projected onto it. What hangs
together there and meets the solid's edge is the range that the points give this edge.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.artifacts.brep import LEAST_COVERAGE, LEAST_SUPPORT
from brepgaussian.artifacts.points import Points
from brepgaussian.brep.carrier import TURN, Carrier
from brepgaussian.brep.structure import SMOOTH, Edge

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

EDGE_VALUE = 0.5  # of a point from which it counts as an edge point
NEAR = 0.02  # unit frame: the strict tolerance of the paper's curve scores; no edge point is farther off
_TO_SIGMA = 1.4826  # median absolute deviation to standard deviation
_SIGMAS = 3.0
_LEAST_TOLERANCE = 1e-4  # unit frame; points without noise still have 32 bits
_GAP_SPACINGS = 8.0  # mean steps along a curve; one in 3000 random steps is wider
_SAME = 1e-6  # unit frame; two edges on one unbounded curve
_PROBES = 5


@dataclass(frozen=True)
class EdgePoints:
    """Edge points by curve.

    Attributes:
        xyz: (N, 3) positions.
        curve: (N,) index of the edge whose unbounded curve is nearest, -1 for none within tolerance.
        tolerance: distance from a curve within which its points are expected (three standard deviations).
        gap: distance along a curve without points that parts two runs.
    """

    xyz: Array
    curve: Indices
    tolerance: float
    gap: float


@dataclass(frozen=True)
class Range:
    """What edge points say about one edge.

    Attributes:
        t_solid: range of the solid's edge.
        t_edge: range that the edge points span; NaN where there are too few.
        support: number of edge points that span it.
        coverage: share of the solid's edge that has edge points beside it.
        closed: whether the solid's edge goes all the way round.
    """

    t_solid: tuple[float, float]
    t_edge: tuple[float, float] = (np.nan, np.nan)
    support: int = 0
    coverage: float = 0.0
    closed: bool = False

    @property
    def trusted(self) -> bool:
        """Whether there are points enough for a range."""
        return self.support >= LEAST_SUPPORT and self.coverage >= LEAST_COVERAGE


def edge_points(points: Points, sharp: Sequence[Array] = ()) -> Array:
    """(N, 3) the points that lie on edges: measured ones, of a high edge value, and the points of edge instances.

    An instance may bridge a gap. Where there are measured points, its points count beside these and beside the
    solid's `sharp` edges (polylines) only.
    """
    xyz = points.xyz.astype(float)
    measured, instance = xyz[(points.curve < 0) & (points.edge > EDGE_VALUE)], xyz[points.curve >= 0]
    if len(measured) and len(instance):
        instance = instance[cKDTree(np.concatenate([measured, *sharp])).query(instance)[0] <= NEAR]
    return np.concatenate([measured, instance])


def assign(xyz: Array, edges: Sequence[Edge], carriers: Sequence[Carrier]) -> EdgePoints:
    """Assign edge points to the nearest of the sharp edges' unbounded curves.

    The tolerance is three times the scatter of the points about the solid's edges.
    """
    sharp = [k for k, e in enumerate(edges) if e.convexity != SMOOTH]
    if not len(xyz) or not sharp:
        return EdgePoints(xyz, np.full(len(xyz), -1), NEAR, NEAR)
    close = cKDTree(np.concatenate([edges[k].polyline for k in sharp])).query(xyz)[0] <= NEAR
    distance, curve = np.full(len(xyz), NEAR), np.full(len(xyz), -1)
    for k in sharp:
        off = carriers[k].distance(xyz)
        better = off < distance - _SAME
        distance[better], curve[better] = off[better], k
    usual = float(np.median(distance[close])) if close.any() else NEAR
    tolerance = float(np.clip(_SIGMAS * _TO_SIGMA * usual, _LEAST_TOLERANCE, NEAR))
    curve[distance > tolerance] = -1
    steps = [np.diff(np.sort(carriers[k].parameters(xyz[curve == k]))) * carriers[k].scale for k in sharp]
    pooled = np.concatenate(steps)
    spacing = float(np.median(pooled)) / np.log(2) if len(pooled) else NEAR  # the mean step of random points
    return EdgePoints(xyz, curve, tolerance, max(_GAP_SPACINGS * spacing, 2 * tolerance))


def ranges(found: EdgePoints, edges: Sequence[Edge], carriers: Sequence[Carrier]) -> list[Range]:
    """The range of every edge; edges on one unbounded curve share its points."""
    leader = _leaders(edges, carriers)
    solid = [_solid_range(e, c) for e, c in zip(edges, carriers, strict=True)]
    result = []
    for index, (edge, carrier) in enumerate(zip(edges, carriers, strict=True)):
        together = np.flatnonzero(leader == leader[index])
        xyz = found.xyz[np.isin(found.curve, together)]
        if edge.convexity == SMOOTH or not len(xyz):
            result.append(Range(solid[index]))
            continue
        others = [edges[k].polyline for k in together.tolist() if k != index]
        result.append(_range(carrier, solid[index], edge.closed, xyz, others, found.gap))
    return result


def _leaders(edges: Sequence[Edge], carriers: Sequence[Carrier]) -> Indices:
    """(E,) the first edge on the same unbounded curve."""
    leader = np.arange(len(edges))
    for index, edge in enumerate(edges):
        step = max(1, len(edge.polyline) // _PROBES)
        probes = edge.polyline[::step]
        for first in np.unique(leader[:index]):
            if carriers[first].kind == carriers[index].kind != "other" and (
                carriers[first].distance(probes).max() < _SAME
            ):
                leader[index] = first
                break
    return leader


def _solid_range(edge: Edge, carrier: Carrier) -> tuple[float, float]:
    if carrier.kind == "line":
        return 0.0, carrier.length
    if not carrier.periodic:
        return 0.0, 1.0
    t = np.unwrap(carrier.parameters(edge.polyline))
    start = 0.0 if carrier.kind == "circle" else float(t[0])  # a circle's x points at its first sample
    return (start, start + TURN) if edge.closed else (start, float(t[-1]))


def _range(
    carrier: Carrier, solid: tuple[float, float], closed: bool, xyz: Array, others: Sequence[Array], gap: float
) -> Range:
    """The range of one edge from the points on its unbounded curve."""
    step = gap / carrier.scale
    middle = 0.5 * (solid[0] + solid[1])
    t = _near(carrier, carrier.parameters(xyz), middle)
    low, high = _territory(carrier, solid, middle, others)
    t = np.sort(t[(t > low) & (t < high)])
    if not len(t):
        return Range(solid)
    if closed and carrier.periodic:
        return _full_turn(solid, t, step)
    runs = np.split(t, np.flatnonzero(np.diff(t) > step) + 1)
    own = [r for r in runs if r[-1] > solid[0] and r[0] < solid[1]]
    if not own:
        return Range(solid)
    mine = np.concatenate(own)
    covered = sum(min(r[-1] + step / 2, solid[1]) - max(r[0] - step / 2, solid[0]) for r in own)
    coverage = min(float(covered / max(solid[1] - solid[0], 1e-12)), 1.0)
    return Range(solid, (float(mine[0]), float(mine[-1])), len(mine), coverage, closed)


def _full_turn(solid: tuple[float, float], t: Array, step: float) -> Range:
    """A closed edge: a whole turn, or the arc beside the widest gap, wherever the seam is."""
    gaps = np.diff(np.append(t, t[0] + TURN))
    widest = int(np.argmax(gaps))
    coverage = float(np.minimum(gaps, step).sum() / TURN)
    if gaps[widest] <= step:
        return Range(solid, solid, len(t), coverage, closed=True)
    start = t[(widest + 1) % len(t)]
    start += TURN * np.ceil((solid[0] - start) / TURN)  # counted from the seam on
    return Range(solid, (float(start), float(start + TURN - gaps[widest])), len(t), coverage, closed=True)


def _near(carrier: Carrier, t: Array, middle: float) -> Array:
    """Angles within half a turn of the middle of an edge."""
    return middle + np.mod(t - middle + np.pi, TURN) - np.pi if carrier.periodic else t


def _territory(
    carrier: Carrier, solid: tuple[float, float], middle: float, others: Sequence[Array]
) -> tuple[float, float]:
    """How far an edge may reach: half-way to the next edge on the same unbounded curve."""
    low, high = -np.inf, np.inf
    for polyline in others:
        t = _near(carrier, carrier.parameters(polyline), middle)
        before, after = t[t < middle], t[t > middle]
        if len(before):
            low = max(low, 0.5 * (min(float(before.max()), solid[0]) + solid[0]))
        if len(after):
            high = min(high, 0.5 * (max(float(after.min()), solid[1]) + solid[1]))
    return low, high
