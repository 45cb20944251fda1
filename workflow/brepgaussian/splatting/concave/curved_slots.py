"""Slots along an arc, with round ends: what lets a plate be turned, a lever swing."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.circles import circle_through
from brepgaussian.splatting.concave.sections import Section

Array = NDArray[np.float64]

_MOST_SWEEP = np.radians(160.0)  # to either side of its middle: farther, the ends meet
_LEAST_BEND = 1.5  # half widths: an arc of less is no slot
_LEAST_SPAN = 0.2  # radians from end to end: what bends less is straight
_LEAST_RADIUS = 1.0  # cells, of a bend that a fit tries
_FEW = 0.02  # of the cells lie farther in or out than an edge's blur


@dataclass(frozen=True)
class Bent:
    """A slot along an arc about (-bend, 0): half its `width`, and half the angle of its middle line, `sweep`."""

    bend: float
    width: float
    sweep: float

    def _polar(self, at: Array) -> tuple[Array, Array]:
        """(...) distances from the arc's middle and (...) angles from the first axis."""
        x = at[..., 0] + self.bend
        return np.hypot(x, at[..., 1]), np.arctan2(at[..., 1], x)

    def _ends(self) -> Array:
        """(2, 2) middles of the round ends."""
        turned = np.array([-self.sweep, self.sweep])
        return self.bend * np.column_stack([np.cos(turned) - 1, np.sin(turned)])

    def signed_distance(self, at: Array) -> Array:
        """See `sections.Shape`."""
        away, turned = self._polar(at)
        ends = np.linalg.norm(at[..., None, :] - self._ends(), axis=-1).min(axis=-1)
        return np.asarray(np.where(np.abs(turned) <= self.sweep, np.abs(away - self.bend), ends) - self.width)

    def pieces(self, at: Array) -> NDArray[np.int64]:
        """The outer wall is 0, the inner one 1, the ends are 2 and 3."""
        away, turned = self._polar(at)
        return np.where(np.abs(turned) > self.sweep, 2 + (turned > 0), away < self.bend).astype(np.int64)

    def corners(self) -> Array:
        """See `sections.Shape`: its pieces go over into each other smoothly."""
        return np.zeros((0, 2))

    def mapped(self, change: Callable[[float], float]) -> "Bent":
        """See `sections.Shape`; grown, it bends as before."""
        width = max(change(self.width), 0.0)
        return Bent(max(change(self.bend + self.width) - width, 0.0), width, self.sweep)

    @property
    def reach(self) -> float:
        """See `sections.Shape`."""
        return float(np.linalg.norm(self._ends()[0])) + self.width


def bent_slot(p: Sequence[float]) -> Section:
    """A slot whose middle is (p[0], p[1]), bent away from angle p[2] by a radius p[3], half of p[4] wide.

    p[5] is half the length of its middle line; all lengths in cells.
    """
    bend = max(p[3], _LEAST_RADIUS)
    return Section((p[0], p[1]), p[2], Bent(bend, p[4], float(np.clip(p[5] / bend, 0.0, _MOST_SWEEP))))


def start_of(outline: NDArray[np.bool_]) -> list[float] | None:
    """The parameters of the bent slot that an outline (R, C) may be, roughly; None if it is none."""
    cells = np.argwhere(outline).astype(float)
    circle = circle_through(cells) if len(cells) else None
    if circle is None:
        return None
    middle = circle[0]
    away = cells - middle
    way = float(np.arctan2(*away.mean(axis=0)[::-1]))
    turned = np.arctan2(away[:, 1], away[:, 0]) - way
    turned = np.arctan2(np.sin(turned), np.cos(turned))  # (N,) from the middle of the slot
    low, high = np.quantile(np.linalg.norm(away, axis=1), [_FEW, 1 - _FEW])
    width, bend, span = float(high - low) / 2, float(high + low) / 2, float(np.ptp(turned))
    sweep = span / 2 - width / bend
    if not 0 < sweep < _MOST_SWEEP or span <= _LEAST_SPAN or bend <= _LEAST_BEND * width:
        return None
    way += float(turned.max() + turned.min()) / 2
    start = middle + bend * np.array([np.cos(way), np.sin(way)])
    return [float(start[0]), float(start[1]), way, bend, width, bend * sweep]
