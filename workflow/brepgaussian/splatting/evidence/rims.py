"""Edges of concavities, from their shape: light thrown back and forth leaves no step where wall and floor meet."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.measure import find_contours

from brepgaussian.artifacts.views import Views
from brepgaussian.splatting.concave.prism import Prism, signed_outline
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.evidence.edges import EdgeCloud

Array = NDArray[np.float64]

_BLUR_CELLS = 0.7  # of the outline, whose cells are a staircase
_STEP_CELLS = 1.0  # between points of a contour
_SHORTEST = 12  # points of a contour
_WINDOW = 5  # points to either side that give a contour's direction
_CORNER = np.radians(35.0)  # turn from one side of a corner to the other
_STEADY = np.radians(20.0)  # beside a corner a contour turns less; on a circle it turns everywhere
_ON_HULL = 0.012  # unit frame; the hull rounds corners


def concavity_edges(views: Views, scene: Scene, prisms: Sequence[Prism], cloud: EdgeCloud) -> EdgeCloud:
    """Add to an edge cloud the edges of concavities that it lacks and that two views or more see.

    Args:
        views: cameras.
        scene: the opened hull.
        prisms: the concavities.
        cloud: triangulated edges.
    """
    parts = [_edges(prism) for prism in prisms]
    if not parts:
        return cloud
    points, directions = (np.concatenate(column) for column in zip(*parts, strict=True))
    on_hull = np.isfinite(scene.near(points, _ON_HULL))  # another concavity may have cut an edge away
    return cloud.completed(views.cameras, scene, points[on_hull], directions[on_hull])


def _edges(prism: Prism) -> tuple[Array, Array]:
    """(N, 3) points and (N, 3) tangents along rim, throat of a countersink, the floor's border and walls' corners."""
    lattice = prism.lattice
    axes = np.stack([lattice.first, lattice.second])
    down = -lattice.normal + np.array(prism.tilt) @ axes
    points, directions = [np.zeros((0, 3))], [np.zeros((0, 3))]
    outline = np.pad(ndimage.gaussian_filter(signed_outline(prism.outline), _BLUR_CELLS), 1, constant_values=1.0)
    narrower = min(prism.draft * prism.depth, prism.sink)
    rings = [(0.0, 0.0)] if prism.domed else [(0.0, 0.0), (prism.depth, narrower)]
    if 0 < prism.rim <= narrower:
        rings.append((prism.rim / prism.draft, prism.rim))
    for depth, shrunk in rings:
        for line in find_contours(outline + shrunk / lattice.pitch, 0.0):
            cells, tangents = _even(line - 1)  # the padding
            if len(cells) < _SHORTEST:
                continue
            ring = lattice.origin + (cells + 0.5) * lattice.pitch @ axes + depth * down
            points.append(ring)
            directions.append(tangents @ axes)
            if depth == 0 and not prism.draft:
                along = np.arange(0, prism.depth, _STEP_CELLS * lattice.pitch)
                for corner in _meet(cells, tangents, _corners(tangents)):
                    start = lattice.origin + (corner + 0.5) * lattice.pitch @ axes
                    points.append(start + along[:, None] * down)
                    directions.append(np.broadcast_to(down / np.linalg.norm(down), (len(along), 3)))
    return np.concatenate(points), np.concatenate(directions)


def _even(line: Array) -> tuple[Array, Array]:
    """(N, 2) points evenly along a contour and (N, 2) unit tangents over a window."""
    length = np.append(0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    at = np.arange(0, length[-1], _STEP_CELLS)
    points = np.column_stack([np.interp(at, length, line[:, k]) for k in (0, 1)])
    ahead = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    return points, ahead / np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)


def _corners(tangents: Array) -> NDArray[np.int64]:
    """Indices at which a closed contour turns sharply between stretches that do not turn."""
    if len(tangents) < 4 * _WINDOW:
        return np.zeros(0, np.int64)
    angle = np.arctan2(tangents[:, 1], tangents[:, 0])

    def turn(first: int, second: int) -> Array:
        change = np.roll(angle, -second) - np.roll(angle, -first)
        return np.abs((change + np.pi) % (2 * np.pi) - np.pi)

    sharp = turn(-_WINDOW // 2, _WINDOW // 2)
    steady = np.maximum(turn(-2 * _WINDOW, -_WINDOW), turn(_WINDOW, 2 * _WINDOW)) < _STEADY
    crest = sharp == ndimage.maximum_filter1d(sharp, 2 * _WINDOW + 1, mode="wrap")
    return np.flatnonzero((sharp > _CORNER) & steady & crest)


def _meet(points: Array, tangents: Array, corners: NDArray[np.int64]) -> Array:
    """(C, 2) where the straight stretches beside corners meet: the corners themselves are rounded."""
    before, after = (corners - 2 * _WINDOW) % len(points), (corners + 2 * _WINDOW) % len(points)
    a, u, b, v = points[before], tangents[before], points[after], tangents[after]
    cross = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    offset = b - a
    share = (offset[:, 0] * v[:, 1] - offset[:, 1] * v[:, 0]) / np.where(np.abs(cross) < 1e-3, np.inf, cross)
    return np.asarray(a + share[:, None] * u)
