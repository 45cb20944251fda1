"""The depth of an opening: that at which all views agree on its walls and its floor.

Walls and floor follow from the outline and a depth. Were the floor higher or lower than it is, one place on
it would be hit by rays that in truth meet different places, of different greys. Where all depths below the
true one explain the images equally well (all the floor has one grey), the least is right.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.concave.openings import Stack
from brepgaussian.splatting.concave.prism import Prism, signed_outline
from brepgaussian.splatting.concave.radiance import disagreement
from brepgaussian.splatting.concave.rays import Rays, exits, gather

Array = NDArray[np.float64]

_LEAST_RAYS = 200
_SEARCH_RAYS = 60_000  # more make the search slower, not better
_DEPTHS = 36  # tried at first, from the shallowest on in equal ratios
_SHALLOWEST = 3.0  # cells
_DEEPER = 0.02  # of the range of disagreement: price of each doubling of the depth
_GROWS = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])  # cells by which an outline may be off
_THROATS = np.linspace(0.05, 0.5, 10)  # of the opening's half width: by so much a countersunk hole is narrower
_FINEST = 0.25  # cells
_FEW_RAYS = 8_000  # for many shapes of leaning walls
_FEW_DEPTHS = 10
_TILTS = np.arange(-0.9, 0.91, 0.3)  # sideways per depth: up to 42 degrees
_DRAFTS = (0.25, 0.5, 1.0)
_FINEST_LEAN = 0.01
_LEANING = 0.75  # walls lean only if that leaves at most this share of the straight ones' disagreement
_DEEP = 7.0  # cells
_SHALLOW_GAIN = 0.4  # for what is shallower: a lid that is badly placed looks like it
_GAIN = 0.75  # a concavity leaves at most this share of the disagreement on its lid


@dataclass(frozen=True)
class _Shape:
    """What is sought, in cells."""

    depth: float
    grow: float = 0.0
    draft: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    through: bool = False
    sink: float = np.inf


_STRAIGHT = _Shape(_SHALLOWEST)


class _Opening:
    """One opening with its rays; remembers what was tried."""

    def __init__(self, rays: Rays, outline: NDArray[np.bool_], deepest: float, tolerance: float) -> None:
        self.rays, self.outline, self.deepest, self.tolerance = rays, outline, deepest, tolerance
        self.price = 0.0  # of each doubling of the depth
        self._exits: dict[tuple[float, ...], tuple[Rays, Array]] = {}

    def score(self, shape: _Shape) -> tuple[float, float]:
        """Disagreement and share of contradicting rays; a doubling of the depth costs a little."""
        key = (shape.grow, shape.draft, shape.sink, *shape.tilt)
        if key not in self._exits:
            sheared = replace(self.rays, sideways=self.rays.sideways - np.array(shape.tilt))
            found = exits(sheared, self.outline, self.deepest + 1, shape.grow, shape.draft, shape.sink)
            self._exits[key] = sheared, found
        sheared, found = self._exits[key]
        return disagreement(sheared, found, shape.depth, self.tolerance, shape.through)

    def closed(self) -> float:
        """Disagreement on the lid, were there no concavity."""
        return disagreement(self.rays, np.full(len(self.rays), -1.0), 0.0, self.tolerance)[0]

    def cost(self, shape: _Shape) -> float:
        """Disagreement alone, and the price of depth."""
        return self.score(shape)[0] + self.price * np.log2(max(shape.depth, 1.0))


def measure(
    stack: Stack, outline: NDArray[np.bool_], centers: Array, deepest: float, tolerance: float
) -> tuple[Prism, float] | None:
    """The concavity under one opening, or None if the rays do not tell one.

    With it comes its gain: by how much less the rays disagree than on a lid, summed over cells of the lattice.

    Args:
        stack: what the views show on the opening's plane.
        outline: (R, C) cells of the opening.
        centers: (V, 3) camera centres.
        deepest: thickness of the hull below the opening.
        tolerance: grey levels that one place may differ by.
    """
    pitch = stack.lattice.pitch
    every = gather(stack, outline, centers)
    if len(every) < _LEAST_RAYS:
        return None
    opening = _Opening(every.sample(_SEARCH_RAYS), outline, deepest / pitch, tolerance)
    best = _refine(opening, _best_depth(opening, _DEPTHS))
    few = _Opening(every.sample(_FEW_RAYS), outline, deepest / pitch, tolerance)
    for leaning in (_oblique(few), _tapered(few)):
        if few.score(leaning)[0] < few.score(best)[0]:
            leaning = _refine(opening, leaning)
            if opening.score(leaning)[0] < _LEANING * opening.score(best)[0]:
                best = leaning
    disagreeing, error = opening.score(best)
    closed = opening.closed()
    deep = best.through or best.depth > _DEEP
    if disagreeing > (_GAIN if deep else _SHALLOW_GAIN) * closed or (not deep and best.depth < _SHALLOWEST + 1):
        return None
    throat = best.sink if np.isfinite(best.sink) else 0.0  # the countersink is left to the silhouettes
    fitted = signed_outline(outline) < best.grow - throat
    gain = (closed - disagreeing) * float(np.count_nonzero(fitted))
    depth = opening.deepest if best.through else best.depth
    return Prism(
        stack.lattice, fitted, depth * pitch, best.through, error, best.tilt, 0.0 if throat else best.draft
    ), gain


def _best_depth(opening: _Opening, count: int, like: _Shape = _STRAIGHT) -> _Shape:
    """The best of some depths, of walls that lean like those of another shape."""
    depths = np.unique(np.geomspace(_SHALLOWEST, max(opening.deepest, _SHALLOWEST), count))
    blind = [replace(like, depth=float(d), through=False) for d in depths]
    if not opening.price:
        scores = [opening.score(shape)[0] for shape in blind]
        opening.price = _DEEPER * (max(scores) - min(scores))
    width = float(-signed_outline(opening.outline).min())
    holes = [replace(like, depth=opening.deepest, through=True)]
    for share in _THROATS:
        # countersunk at 45 degrees; perhaps at its far end too
        throat = replace(holes[0], draft=1.0, sink=float(share) * width)
        holes += [throat, replace(throat, depth=throat.depth - throat.sink)]
    return min([*blind, *holes], key=opening.cost)


def _oblique(opening: _Opening) -> _Shape:
    """The best hole that goes through at an angle."""
    shapes = [_Shape(opening.deepest, tilt=(float(u), float(v)), through=True) for u in _TILTS for v in _TILTS]
    best = min(shapes, key=opening.cost)
    step = (_TILTS[1] - _TILTS[0]) / 2
    while step > _FINEST_LEAN:
        u, v = best.tilt
        moves = ((0, 0), (step, 0), (-step, 0), (0, step), (0, -step))
        better = min((replace(best, tilt=(float(u + du), float(v + dv))) for du, dv in moves), key=opening.cost)
        step = step / 2 if better == best else step
        best = better
    return best


def _tapered(opening: _Opening) -> _Shape:
    """The best concavity that narrows with its depth."""
    best = min((_best_depth(opening, _FEW_DEPTHS, _Shape(0.0, draft=d)) for d in _DRAFTS), key=opening.cost)
    step = _DRAFTS[0] / 2
    while step > _FINEST_LEAN:
        tried = [replace(best, draft=max(best.draft + change, 0.0)) for change in (0, step, -step)]
        if not best.through:
            tried += [replace(best, depth=min(best.depth * k, opening.deepest)) for k in (0.9, 1.1)]
        better = min(tried, key=opening.cost)
        step = step / 2 if better == best else step
        best = better
    return best


def _refine(opening: _Opening, best: _Shape) -> _Shape:
    """Depth and outline in turn, in ever smaller steps."""
    step, grows = max(0.1 * best.depth, 2 * _FINEST), best.grow + _GROWS
    while step > _FINEST:
        best = min((replace(best, grow=float(g)) for g in grows), key=opening.cost)
        if np.isfinite(best.sink):
            far = opening.deepest - best.depth  # the countersink at the far end, of the same size or none
            sinks = [max(best.sink + float(k), 0.0) for k in _GROWS / 2]
            tried = [replace(best, sink=k, depth=opening.deepest - (k if far > 0 else 0.0)) for k in sinks]
            best = min(tried, key=opening.cost)
        elif not best.through:
            tried = [replace(best, depth=best.depth + k * step) for k in (-1, -0.5, 0, 0.5, 1)]
            best = min((t for t in tried if _SHALLOWEST <= t.depth <= opening.deepest), key=opening.cost, default=best)
        step /= 2
    return best
