"""Parameters (u, v) of points on the analytic surfaces, as OCC defines them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]
TURN = 2 * np.pi


@dataclass(frozen=True)
class Chart:
    """A parametrised surface of revolution (or a plane) with its own frame.

    Attributes:
        surface: the surface.
        x, y, z: right-handed frame; z is the axis, u = 0 lies towards x.
    """

    surface: Surface
    x: Array
    y: Array
    z: Array

    def parameters(self, points: Array) -> Array:
        """(N, 2) u, v of (N, 3) points; angles u in [0, 2 pi); a torus' v in (-pi, pi]."""
        s = self.surface
        offset = points - s.origin
        a, b, along = offset @ self.x, offset @ self.y, offset @ self.z
        if s.kind == "plane":
            return np.column_stack([a, b])
        u, rho = np.mod(np.arctan2(b, a), TURN), np.hypot(a, b)
        if s.kind == "cylinder":
            v = along
        elif s.kind == "cone":  # slant length from the reference circle
            v = along * np.cos(s.angle) + (rho - s.radius) * np.sin(s.angle)
        elif s.kind == "sphere":
            v = np.arctan2(along, rho)
        else:
            v = np.arctan2(along, rho - s.radius)
        return np.column_stack([u, v])

    def evaluate(self, u: Array, v: Array) -> Array:
        """(N, 3) points at parameters u, v (arrays that broadcast)."""
        s = self.surface
        u, v = np.broadcast_arrays(np.asarray(u, float), np.asarray(v, float))
        if s.kind == "plane":
            return s.origin + u[..., None] * self.x + v[..., None] * self.y
        radial = np.cos(u)[..., None] * self.x + np.sin(u)[..., None] * self.y
        if s.kind == "cylinder":
            rho, along = np.full(v.shape, s.radius), v
        elif s.kind == "cone":
            rho, along = s.radius + v * np.sin(s.angle), v * np.cos(s.angle)
        elif s.kind == "sphere":
            rho, along = s.radius * np.cos(v), s.radius * np.sin(v)
        else:
            rho, along = s.radius + s.minor * np.cos(v), s.minor * np.sin(v)
        return s.origin + rho[..., None] * radial + along[..., None] * self.z

    def scale(self, v: float) -> tuple[float, float]:
        """Length per unit of u and of v at a given v."""
        s = self.surface
        if s.kind == "plane":
            return 1.0, 1.0
        if s.kind == "cylinder":
            return s.radius, 1.0
        if s.kind == "cone":
            return max(s.radius + v * float(np.sin(s.angle)), 1e-6), 1.0
        if s.kind == "sphere":
            return max(s.radius * float(np.cos(v)), 1e-6), s.radius
        return max(s.radius + s.minor * float(np.cos(v)), 1e-6), s.minor


def chart_of(surface: Surface, z: Array | None = None, x: Array | None = None) -> Chart:
    """A chart with the surface's own axis (or `z`, for a sphere), u = 0 towards `x`."""
    axis = surface.axis if z is None else z
    if x is None:
        helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
        x = np.cross(helper, axis)
    x = x - (x @ axis) * axis
    x = x / np.linalg.norm(x)
    return Chart(surface, x, np.cross(axis, x), axis)


def largest_gap(angles: Array) -> tuple[float, float]:
    """Middle and width of the largest gap between angles on a circle."""
    ordered = np.sort(np.mod(angles, TURN))
    gaps = np.diff(np.append(ordered, ordered[0] + TURN))
    widest = int(np.argmax(gaps))
    return float(np.mod(ordered[widest] + 0.5 * gaps[widest], TURN)), float(gaps[widest])
