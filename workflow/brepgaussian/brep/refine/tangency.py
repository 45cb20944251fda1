"""Smooth edges, which the structure tells, as equations of the refinement."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.refine.constraints import Row
from brepgaussian.brep.refine.mesh import slave
from brepgaussian.brep.refine.parameters import derivative
from brepgaussian.brep.structure import SMOOTH, Structure
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]

_TANGENT_SAMPLES = 5  # on a smooth edge
_TANGENT_ANGLE = np.radians(20.0)  # smooth edges that deviate more are creases of low angle


def tangent_rows(structure: Structure, surfaces: Sequence[Surface]) -> list[Row]:
    """Smooth edges stay smooth: the gap between the two surfaces where their normals are parallel is zero.

    To first order the gap is f_1 - s f_2 at a point of parallel normals (s = n_1 . n_2 = +-1), and its
    derivative that of f_1 - s f_2, since the point slides along both surfaces.
    """
    rows: list[Row] = []
    for edge in structure.edges:
        first, second = edge.surfaces
        if edge.convexity != SMOOTH or first < 0 or second < 0 or first == second:
            continue
        points = edge.polyline[np.linspace(0, len(edge.polyline) - 1, _TANGENT_SAMPLES).round().astype(int)]
        points, sign = touching(points, surfaces[first], surfaces[second])
        good = np.abs(sign) > np.cos(_TANGENT_ANGLE)
        points, sign = points[good], np.sign(sign[good])
        gap = surfaces[first].signed_distance(points) - sign * surfaces[second].signed_distance(points)
        one = derivative(surfaces[first], points)
        two = -sign[:, None] * derivative(surfaces[second], points)
        rows.extend(({first: a, second: b}, float(g)) for a, b, g in zip(one, two, gap, strict=True))
    return rows


def touching(points: Array, first: Surface, second: Surface) -> tuple[Array, Array]:
    """(N, 3) points near a line of contact where the normals are parallel, and (N,) n_1 . n_2 there."""
    h, table = 1e-4, np.zeros((len(points), 1), np.int64)
    sign = np.sign(np.einsum("ni,ni->n", first.normals(points), second.normals(points)))[:, None]
    start = points
    tangent = np.gradient(points, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    for _ in range(4):
        points = slave(points, table, [first])
        across = np.cross(first.normals(points), tangent)
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)

        def slope(x: Array, across: Array = across) -> Array:
            return np.einsum("ni,ni->n", first.normals(x) - sign * second.normals(x), across)

        bend = (slope(points + h * across) - slope(points - h * across)) / (2 * h)
        step = np.where(np.abs(bend) > 1e-3, -slope(points) / np.where(np.abs(bend) > 1e-3, bend, 1), 0)
        points = points + np.clip(step, -0.02, 0.02)[:, None] * across
    points = np.where(np.linalg.norm(points - start, axis=1, keepdims=True) < 0.05, points, start)
    return points, np.einsum("ni,ni->n", first.normals(points), second.normals(points))
