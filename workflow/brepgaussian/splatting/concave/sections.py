"""What machined openings look like: circles, slots, rectangles with round corners, polygons, keyed and flatted bores.

A section has straight walls where an outline of cells has none, and says which piece of the wall is which face.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
T = TypeVar("T")

PIECES = 8  # of a section at most
LEAST_STRAIGHT = 1.0  # cells; a shorter straight piece between round corners is none: a circle
_STEP, _NOTHING = 1e-3, 1e-12  # cells, for derivatives
_FINE = 0.5  # cells in which a border is traced


class Shape(Protocol):
    """A section's shape about its own centre and axes, in cells."""

    def signed_distance(self, at: Array) -> Array:
        """(...) distance of places (..., 2) to the border, negative inside."""

    def pieces(self, at: Array) -> NDArray[np.int64]:
        """(N,) number of the piece of the border next to places (N, 2)."""

    def corners(self) -> Array:
        """(K, 2) places where two pieces meet at an angle."""

    def mapped(self: T, change: Callable[[float], float]) -> T:
        """The shape with all its lengths changed: grown by as much on all sides, or scaled."""

    @property
    def reach(self) -> float:
        """No place of it is farther from the centre."""


@dataclass(frozen=True)
class Rounded:
    """A rectangle of half the sides `half` with corners of a `radius`: a circle, a slot, a pocket."""

    half: tuple[float, float]
    radius: float

    def signed_distance(self, at: Array) -> Array:
        """See `Shape`."""
        past = np.abs(at) - np.array(self.half) + self.radius
        outside = np.linalg.norm(np.maximum(past, 0), axis=-1)
        return np.asarray(outside + np.minimum(past.max(axis=-1), 0) - self.radius)

    def pieces(self, at: Array) -> NDArray[np.int64]:
        """Walls along the second axis are 0 and 1, along the first 2 and 3; a circle is 4, ends and corners 4 to 7."""
        half = np.array(self.half)
        past = np.abs(at) - half + self.radius  # the middles of the corners
        side = (at < 0).astype(np.int64)
        straight = half - self.radius > LEAST_STRAIGHT  # walls of which axis there are
        wall = np.where(past[:, 0] > past[:, 1], side[:, 0], 2 + side[:, 1])
        turned = (past > 0).all(axis=1) & (self.radius > 0) if straight.all() else past[:, np.argmax(straight)] > 0
        corner = 4 + straight[0] * side[:, 0] + 2 * straight[1] * side[:, 1]
        return np.asarray(np.where(turned | ~straight.any(), corner, wall))

    def corners(self) -> Array:
        """See `Shape`."""
        signs = np.array([[a, b] for a in (-1, 1) for b in (-1, 1)])
        return signs * np.array(self.half) if self.radius == 0 else np.zeros((0, 2))

    def mapped(self, change: Callable[[float], float]) -> "Rounded":
        """See `Shape`."""
        radius = max(change(self.radius), 0.0) if self.radius > 0 else 0.0
        return Rounded((max(change(self.half[0]), 0.0), max(change(self.half[1]), 0.0)), radius)

    @property
    def reach(self) -> float:
        """See `Shape`."""
        return float(np.hypot(*self.half))


@dataclass(frozen=True)
class Polygon:
    """A regular polygon of some `sides`, at most `PIECES`, whose walls are at `inner` from its centre."""

    sides: int
    inner: float

    def _ways(self, turn: float = 0.0) -> Array:
        """(sides, 2) directions of its walls, turned by a part of a side."""
        angle = 2 * np.pi * (np.arange(self.sides) + turn) / self.sides
        return np.column_stack([np.cos(angle), np.sin(angle)])

    def signed_distance(self, at: Array) -> Array:
        """See `Shape`."""
        return np.asarray((at @ self._ways().T).max(axis=-1) - self.inner)

    def pieces(self, at: Array) -> NDArray[np.int64]:
        """See `Shape`."""
        return np.asarray((at @ self._ways().T).argmax(axis=-1))

    def corners(self) -> Array:
        """See `Shape`."""
        return np.asarray(self.inner / np.cos(np.pi / self.sides) * self._ways(0.5))

    def mapped(self, change: Callable[[float], float]) -> "Polygon":
        """See `Shape`."""
        return Polygon(self.sides, max(change(self.inner), 0.0))

    @property
    def reach(self) -> float:
        """See `Shape`."""
        return self.inner / float(np.cos(np.pi / self.sides))


@dataclass(frozen=True)
class Keyed:
    """A circle of a `radius` with a keyway along the first axis: half its `width`, and how far its `end` is."""

    radius: float
    width: float
    end: float

    def _parts(self, at: Array) -> Array:
        """(..., 2) distances to the circle and to the keyway, which begins at the centre."""
        middle, half = np.array([self.end / 2, 0.0]), np.array([self.end / 2, self.width])
        past = np.abs(at - middle) - half
        box = np.linalg.norm(np.maximum(past, 0), axis=-1) + np.minimum(past.max(axis=-1), 0)
        return np.stack([np.linalg.norm(at, axis=-1) - self.radius, box], axis=-1)

    def signed_distance(self, at: Array) -> Array:
        """See `Shape`."""
        return np.asarray(self._parts(at).min(axis=-1))

    def pieces(self, at: Array) -> NDArray[np.int64]:
        """The bore is 0, the keyway's end 1, its sides 2 and 3."""
        of_key = self._parts(at).argmin(axis=-1) == 1
        side = np.where(at[:, 0] - self.end > np.abs(at[:, 1]) - self.width, 1, 2 + (at[:, 1] < 0))
        return np.where(of_key, side, 0)

    def corners(self) -> Array:
        """See `Shape`."""
        mouth = float(np.sqrt(max(self.radius**2 - self.width**2, 0.0)))
        return np.array([[x, y] for x in (self.end, mouth) for y in (-self.width, self.width)])

    def mapped(self, change: Callable[[float], float]) -> "Keyed":
        """See `Shape`."""
        return Keyed(*(max(change(v), 0.0) for v in (self.radius, self.width, self.end)))

    @property
    def reach(self) -> float:
        """See `Shape`."""
        return float(max(self.radius, np.hypot(self.end, self.width)))


@dataclass(frozen=True)
class Flatted:
    """A circle of a `radius` with a flat across the first axis, at `flat` from the centre: a D."""

    radius: float
    flat: float

    def signed_distance(self, at: Array) -> Array:
        """See `Shape`."""
        return np.maximum(np.linalg.norm(at, axis=-1) - self.radius, at[..., 0] - self.flat)

    def pieces(self, at: Array) -> NDArray[np.int64]:
        """The bore is 0, the flat 1."""
        return (at[:, 0] - self.flat > np.linalg.norm(at, axis=-1) - self.radius).astype(np.int64)

    def corners(self) -> Array:
        """See `Shape`."""
        half = float(np.sqrt(max(self.radius**2 - self.flat**2, 0.0)))
        return np.array([[self.flat, -half], [self.flat, half]])

    def mapped(self, change: Callable[[float], float]) -> "Flatted":
        """See `Shape`."""
        return Flatted(max(change(self.radius), 0.0), change(self.flat))

    @property
    def reach(self) -> float:
        """See `Shape`."""
        return self.radius


@dataclass(frozen=True)
class Section:
    """A shape somewhere in the cells of a lattice.

    Attributes:
        center: (2,) cells.
        angle: of the shape's first axis to the lattice's, radians.
        shape: about its centre.
        misfit: cells by which it differs from what it was fitted to, along its border.
        at_rim: whether that was the rim that the views show; else the cells of an outline.
    """

    center: tuple[float, float]
    angle: float
    shape: Shape
    misfit: float = 0.0
    at_rim: bool = False

    def local(self, cells: Array) -> Array:
        """(..., 2) places (..., 2) in the shape's own axes, about its centre."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        d = cells - np.array(self.center)
        return np.stack([d[..., 0] * c + d[..., 1] * s, d[..., 1] * c - d[..., 0] * s], axis=-1)

    def signed_distance(self, cells: Array) -> Array:
        """(...) distance of places (..., 2) to the border, in cells, negative inside."""
        return self.shape.signed_distance(self.local(cells))

    def gradient(self, cells: Array) -> Array:
        """(N, 2) unit directions at places (N, 2) out of the section, away from its nearest border."""
        steps = _STEP * np.eye(2)
        slope = np.stack([self.signed_distance(cells + s) - self.signed_distance(cells - s) for s in steps], axis=-1)
        return np.asarray(slope / np.maximum(np.linalg.norm(slope, axis=-1, keepdims=True), _NOTHING))

    def pieces(self, cells: Array) -> NDArray[np.int64]:
        """(N,) which piece of the border is next to places (N, 2), below `PIECES`; each is a face of the wall."""
        return self.shape.pieces(self.local(cells))

    def near_corners(self, cells: Array, distance: float) -> NDArray[np.bool_]:
        """(N,) whether places (N, 2) are nearer than `distance` cells to a corner between two pieces."""
        away = np.linalg.norm(self.local(cells)[:, None] - self.shape.corners(), axis=-1)
        return np.asarray((away < distance).any(axis=1))

    def grown(self, by: float) -> "Section":
        """The section that lies `by` cells outside of this one."""
        return replace(self, shape=self.shape.mapped(lambda length: length + by))

    def border(self, count: int) -> Array:
        """(count, 2) places along its border, evenly spaced."""
        from skimage.measure import find_contours

        reach = self.shape.reach + 2 * _FINE
        ticks = np.arange(-reach, reach + _FINE, _FINE)
        grid = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1)
        line = max(find_contours(self.shape.signed_distance(grid), 0.0), key=len)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        wanted = along[-1] * np.arange(count) / count
        at = np.column_stack([np.interp(wanted, along, line[:, k]) for k in (0, 1)]) * _FINE - reach
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array(self.center) + np.column_stack([at[:, 0] * c - at[:, 1] * s, at[:, 1] * c + at[:, 0] * s])
