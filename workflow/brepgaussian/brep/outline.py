"""Outlines of plane sheets: an octagon around the support that ends where a rounder face takes over."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from brepgaussian.brep.chart import Chart
from brepgaussian.brep.patches import Patch, touch

Array = NDArray[np.float64]

TANGENT_SINE = 1e-4  # sine of the angle between normals where two surfaces count as tangent
TANGENT_DISTANCE = 1e-5  # and their distance there, unit frame; the regularised fits are exact to rounding


def cut_at_tangents(
    polygon: Array, chart: Chart, patch: Patch, beside: Sequence[Patch], extended: bool = False
) -> Array:
    """The outline (K, 2) of a plane sheet without what lies beyond the lines where cylinders touch it.

    The points of an `extended` sheet need not reach the cylinders.

    Past such a line plane and cylinder part slowly: what a third face cuts off between them is thinner than the
    noise, and the minimum cut could take either side of it for the part's.
    """
    uv = chart.parameters(patch.xyz)
    for other in beside:
        line = _tangent_line(chart, patch, other)
        if line is None:
            continue
        across, at = line
        here, there = uv @ across - at, chart.parameters(other.xyz) @ across - at
        side = -np.sign(np.median(there))
        beyond = patch.reach + 2 * patch.sigma  # points stray by so much
        if side and (side * here).min() > -beyond and (extended or touch(patch, other)):
            cut = clip(polygon, -side * across, -side * at)
            polygon = cut if len(cut) >= 3 else polygon
    return polygon


def _tangent_line(chart: Chart, patch: Patch, other: Patch) -> tuple[Array, float] | None:
    """Where a cylinder touches a plane: (2,) unit normal of the line in u, v and its offset; None if it does not."""
    wall, round_ = patch.surface, other.surface
    if round_.kind != "cylinder" or abs(float(wall.axis @ round_.axis)) > TANGENT_SINE:
        return None
    height = float((round_.origin - wall.origin) @ wall.axis)
    if abs(abs(height) - round_.radius) > TANGENT_DISTANCE:
        return None
    direction = np.cross(wall.axis, round_.axis)
    across = np.array([direction @ chart.x, direction @ chart.y])
    across /= np.linalg.norm(across)
    return across, float(chart.parameters((round_.origin - height * wall.axis)[None])[0] @ across)


def octagon(uv: Array, margin: float) -> Array:
    """(K, 2) corners of the 8-sided outline of 2D points, grown by `margin`; K is 4 to 8."""
    try:
        hull = uv[ConvexHull(uv).vertices]
    except QhullError:  # all on a line
        hull = np.unique(uv, axis=0)
    sides = np.roll(hull, -1, axis=0) - hull
    angles = np.unique(np.round(np.mod(np.arctan2(sides[:, 1], sides[:, 0]), np.pi / 2), 12))
    best, best_area = None, np.inf
    for angle in angles:
        directions = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        spread = np.ptp(hull @ directions.T, axis=0) + margin
        if np.prod(spread) < best_area - 1e-12:
            best, best_area = directions, float(np.prod(spread))
    assert best is not None
    low, high = (hull @ best.T).min(axis=0) - margin, (hull @ best.T).max(axis=0) + margin
    polygon = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]]) @ best
    for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        diagonal = (a * best[0] + b * best[1]) / np.sqrt(2)
        bound = float((hull @ diagonal).max() + 2 * margin)  # few points lie near the tip of a corner
        if (polygon @ diagonal).max() - bound > 2 * margin:  # a cut that saves little is left out
            polygon = clip(polygon, diagonal, bound)
    return polygon


def clip(polygon: Array, gradient: Array, bound: float) -> Array:
    """The part of a convex polygon (K, 2) where gradient . x <= bound."""
    result: list[Array] = []
    values = polygon @ gradient - bound
    for i, (point, value) in enumerate(zip(polygon, values, strict=True)):
        following, next_value = polygon[(i + 1) % len(polygon)], values[(i + 1) % len(polygon)]
        if value <= 0:
            result.append(point)
        if value * next_value < 0:
            result.append(point + (following - point) * (value / (value - next_value)))
    return np.array(result).reshape(-1, 2)
