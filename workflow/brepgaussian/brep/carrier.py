"""The unbounded curve under a trimmed one: line, circle, ellipse, or a sampled intersection, with its parameter t.

t is an arc length for lines, an angle (eccentric for ellipses) for circles and ellipses, and the share of the
solid's curve for the others; it is 0 at the solid's first point and grows along its samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.brep.refine.mesh import slave
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]

TURN = 2 * np.pi
_EXACT = 1e-6  # unit frame; samples of the kernel lie this near to their conic
_EXTENSION = 0.05  # length by which a sampled intersection is walked on past its ends, unit frame
_WALK = 0.005  # step of that walk
_LEAST_SINE = 0.05  # between the surfaces' normals: a tangent intersection has no direction


@dataclass(frozen=True)
class Carrier:
    """An unbounded curve in the unit frame.

    Attributes:
        kind: line, circle, ellipse or other.
        origin: (3,) where t = 0 on a line; the centre of a circle or an ellipse; the first sample of others.
        x, y: (3,) unit; a line runs along x; p(t) = origin + radii[0] cos t x + radii[1] sin t y otherwise.
        radii: (2,) along x and y; (1, 0) for a line, zero for others.
        samples, along: (M, 3) samples of other curves and their (M,) t; empty for the analytic kinds.
        length: length of the solid's curve, unit frame.
    """

    kind: str
    origin: Array
    x: Array
    y: Array
    radii: Array
    samples: Array
    along: Array
    length: float

    @property
    def periodic(self) -> bool:
        """Whether t and t + 2 pi are one point."""
        return self.kind in ("circle", "ellipse")

    @property
    def scale(self) -> float:
        """Length per unit of t (the mean over a turn for ellipses)."""
        if self.kind == "line":
            return 1.0
        return float(np.sqrt(np.mean(self.radii**2))) if self.periodic else max(self.length, 1e-12)

    def parameters(self, points: Array) -> Array:
        """(N,) t of the nearest place on the curve for (N, 3) points near it; angles in (-pi, pi]."""
        offset = points - self.origin
        if self.kind == "line":
            return np.asarray(offset @ self.x, float)
        if self.periodic:
            return np.arctan2(offset @ self.y / self.radii[1], offset @ self.x / self.radii[0])
        at, part = self._nearest(points)
        return np.asarray(self.along[at] + part * (self.along[at + 1] - self.along[at]), float)

    def evaluate(self, t: Array) -> Array:
        """(N, 3) points at (N,) t."""
        t = np.asarray(t, float)
        if self.kind == "line":
            return self.origin + t[:, None] * self.x
        if self.periodic:
            a, b = self.radii
            return self.origin + a * np.cos(t)[:, None] * self.x + b * np.sin(t)[:, None] * self.y
        return np.column_stack([np.interp(t, self.along, self.samples[:, k]) for k in range(3)])

    def distance(self, points: Array) -> Array:
        """(N,) distance of (N, 3) points from the curve (exact but for points far off an ellipse)."""
        if self.kind != "other":
            return np.linalg.norm(points - self.evaluate(self.parameters(points)), axis=1)
        at, part = self._nearest(points)
        foot = self.samples[at] + part[:, None] * (self.samples[at + 1] - self.samples[at])
        return np.linalg.norm(points - foot, axis=1)

    def _nearest(self, points: Array) -> tuple[NDArray[np.int64], Array]:
        """Segment of the samples next to each point, and the place on it (0..1)."""
        last = len(self.samples) - 2
        nearest = cKDTree(self.samples).query(points)[1]
        best, place, least = np.zeros(len(points), np.int64), np.zeros(len(points)), np.full(len(points), np.inf)
        for at in (np.clip(nearest - 1, 0, last), np.clip(nearest, 0, last)):
            step = self.samples[at + 1] - self.samples[at]
            square = np.maximum((step**2).sum(axis=1), 1e-300)
            part = np.clip(np.einsum("ij,ij->i", points - self.samples[at], step) / square, 0, 1)
            gap = np.linalg.norm(self.samples[at] + part[:, None] * step - points, axis=1)
            better = gap < least
            best, place, least = (np.where(better, n, o) for n, o in ((at, best), (part, place), (gap, least)))
        return best, place


def carrier_of(kind: str, polyline: Array, surfaces: Sequence[Surface]) -> Carrier:
    """The carrier of a solid's curve from its (M, 3) samples, which lie exactly on it.

    Args:
        kind: line, circle, ellipse or other; a conic that its samples do not confirm is taken as other.
        polyline: samples in order; a closed curve ends where it starts.
        surfaces: the curve's surfaces, along which other curves are walked on.
    """
    length = float(np.linalg.norm(np.diff(polyline, axis=0), axis=1).sum())
    none, zero = np.zeros((0, 3)), np.zeros(3)
    if kind == "line" and length > 0:
        x = (polyline[-1] - polyline[0]) / np.linalg.norm(polyline[-1] - polyline[0])
        return Carrier("line", polyline[0], x, zero, np.array([1.0, 0.0]), none, np.zeros(0), length)
    if kind in ("circle", "ellipse"):
        conic = _conic(polyline, round_=kind == "circle")
        if conic is not None:
            result = Carrier(kind, *conic, none, np.zeros(0), length)
            if result.distance(polyline).max() < _EXACT:
                return result
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(polyline, axis=0), axis=1))])
    samples = polyline
    if np.linalg.norm(polyline[-1] - polyline[0]) > _EXACT and len(surfaces) > 1 and len(polyline) > 1:
        before, after = _walk(polyline[::-1], surfaces)[::-1], _walk(polyline, surfaces)
        samples = np.concatenate([before, polyline, after])
        steps = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(samples, axis=0), axis=1))])
        along = steps - steps[len(before)]
    return Carrier("other", polyline[0], zero, zero, np.zeros(2), samples, along / max(length, 1e-12), length)


def _conic(polyline: Array, round_: bool) -> tuple[Array, Array, Array, Array] | None:
    """Centre, x, y and radii of the circle or ellipse through samples; x points at the first one of a circle."""
    middle = polyline.mean(axis=0)
    axes = np.linalg.svd(polyline - middle)[2]
    flat = (polyline - middle) @ axes[:2].T
    scale = float(np.abs(flat).max())
    if not scale > 0 or len(polyline) < 5:
        return None
    u, v = (flat / scale).T
    if round_:
        terms, target = np.column_stack([u, v, np.ones(len(u))]), -(u**2 + v**2)
        d, e, _ = np.linalg.lstsq(terms, target, rcond=None)[0]
        center, radii = np.array([-d, -e]) / 2, np.zeros(2)
        radii[:] = np.hypot(u - center[0], v - center[1]).mean()
        first = flat[0] / scale - center
        turn = np.column_stack([first, [-first[1], first[0]]]) / np.linalg.norm(first)
    else:  # a u^2 + b u v + c v^2 + d u + e v + f = 0
        terms = np.column_stack([u * u, u * v, v * v, u, v, np.ones(len(u))])
        a, b, c, d, e, f = np.linalg.svd(terms)[2][-1]
        matrix = np.array([[a, b / 2], [b / 2, c]])
        if not np.linalg.det(matrix) > 0:
            return None
        center = np.linalg.solve(matrix, [-d / 2, -e / 2])
        value = center @ matrix @ center - f
        eigen, turn = np.linalg.eigh(matrix / value)
        if eigen.min() <= 0:
            return None
        radii = 1 / np.sqrt(eigen)
        if turn[:, 0] @ (flat[0] / scale - center) < 0:
            turn = -turn
    offset = flat / scale - center
    sense = float((offset[:-1, 0] * offset[1:, 1] - offset[:-1, 1] * offset[1:, 0]).sum())
    if sense * np.linalg.det(turn) < 0:
        turn = turn * [1, -1]
    x, y = turn.T @ axes[:2]
    return middle + scale * center @ axes[:2], x, y, scale * radii


def _walk(polyline: Array, surfaces: Sequence[Surface]) -> Array:
    """Points of two surfaces' intersection after the last one of a polyline."""
    point, heading = polyline[-1], polyline[-1] - polyline[-2]
    table, found = np.arange(len(surfaces))[None], []
    for _ in range(round(_EXTENSION / _WALK)):
        normals = [s.normals(point[None])[0] for s in surfaces[:2]]
        tangent = np.cross(*normals)
        sine = float(np.linalg.norm(tangent))
        if sine < _LEAST_SINE:
            break
        heading = tangent * np.sign(tangent @ heading) / sine
        point = slave((point + _WALK * heading)[None], table, surfaces)[0]
        found.append(point)
    return np.array(found).reshape(-1, 3)
