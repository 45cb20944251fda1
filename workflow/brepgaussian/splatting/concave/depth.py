"""The depth of an opening: that at which all views agree on its walls and its floor.

Walls and floor follow from the outline and a depth. Were the floor higher or lower than it is, one place on
it would be hit by rays that in truth meet different places, of different greys. Where all depths below the
true one explain the images equally well (all the floor has one grey), the least is right.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.concave.openings import Stack
from brepgaussian.splatting.concave.prism import Prism, signed_outline
from brepgaussian.splatting.concave.radiance import LEAST_PASSING, PLACE_CELLS, disagreement
from brepgaussian.splatting.concave.rays import Rays, crossings_of, exits, gather
from brepgaussian.splatting.concave.scene import Scene

Array = NDArray[np.float64]
_Ends = tuple[float, ...]
_Costs = tuple[Array, NDArray[np.bool_]]  # (N,) disagreement of rays, (N,) which of them are told

_LEAST_RAYS = 200
_SEARCH_RAYS = 40_000  # more make the search slower, not better
_DEPTHS = 36  # tried at first, from the shallowest on in equal ratios
_SHALLOWEST = 3.0  # cells
_DEEPER = 0.005  # of the range of disagreement: price of each doubling of the depth, against drifting on a plateau
_SURE = 4.0  # standard errors by which a deeper floor must explain the rays better
_NOTHING = 1e-9
_BREAKING = 0.5  # of the rays meet another opening below
_RESTING = 0.8  # of the rays that reach a floor
_MOST_PLACE_CELLS = 8.0
_MOST_DEEPER = 16  # depths tried with all rays
_FINAL_RAYS = 240_000  # for a floor that few of the rays reach
_FINAL_RATIO = 1.04  # of the depths tried with them
_UNIT_CELLS = 3  # rays of one view this close to each other err together
_TOLD_SHARE = 0.9  # of the rays through an opening leave the hull before the depth of a hole through its nearest part
_GROWS = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])  # cells by which an outline may be off
_THROATS = np.linspace(0.05, 0.5, 10)  # of the opening's half width: by so much a countersunk hole is narrower
_COUNTERSINK_RATIO = 1.2  # of the drafts tried first: 45 degrees, then 40 and 50
_FINEST = 0.25  # cells
_RIM_RAYS = 60_000
_FEW_RAYS = 8_000  # for many shapes of leaning walls
_FEW_DEPTHS = 10
_TILTS = np.arange(-0.9, 0.91, 0.3)  # sideways per depth: up to 42 degrees
_DRAFTS = (0.25, 0.5, 1.0)
_MOST_DRAFT = 1.5
_FINEST_LEAN = 0.01
_LEANING = 0.9  # walls lean only if that leaves at most this share of the straight ones' disagreement
_CHAMFERED = 0.97  # the same for a hole's rim alone
_LEAST_SINK = 1.5  # cells; a smaller countersink is a rim that is off
_MOST_SINK = 0.6  # of the half width
_LEAST_THROAT = 3.0  # cells, half the width; through a narrower one no view tells anything
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

    @property
    def walls(self) -> tuple[float, ...]:
        """All but how deep it is."""
        return (self.grow, self.draft, self.sink, *self.tilt)


_STRAIGHT = _Shape(_SHALLOWEST)


class _Opening:
    """One opening with its rays; remembers what was tried."""

    def __init__(
        self,
        every: Rays,
        count: int,
        outline: NDArray[np.bool_],
        ends: _Ends,
        tolerance: float,
        breaks: bool,
    ) -> None:
        """Use `count` of all rays; `ends` and `breaks` are those of `_ends`."""
        rays = every.sample(count)
        self.face = float(every.entry.max())  # the deepest that the face lies below the lattice
        self.shallowest = self.face + _SHALLOWEST
        self.rays, self.outline, self.ends, self.tolerance = rays, outline, ends, tolerance
        # fewer rays need larger places to agree in
        self.side = min(PLACE_CELLS * np.sqrt(len(every) / max(len(rays), 1)), _MOST_PLACE_CELLS)
        self.holed = (rays.grey < 0).sum() >= LEAST_PASSING or breaks
        self.deepest = ends[-1]
        self.price = 0.0  # of each doubling of the depth
        self._exits: dict[tuple[float, ...], tuple[Rays, Array]] = {}
        places = np.column_stack([rays.view, rays.start // _UNIT_CELLS])
        self._units = np.unique(places, axis=0, return_inverse=True)[1].ravel()

    def costs(self, shape: _Shape, even: bool = False) -> _Costs:
        """(N,) disagreement of the rays, (N,) which of them are told."""
        sheared, found = self._traced(shape)
        return disagreement(
            sheared, found, shape.depth, self.tolerance, shape.through, PLACE_CELLS if even else self.side, even
        )

    def _traced(self, shape: _Shape) -> tuple[Rays, Array]:
        """The rays in the frame of a shape's walls, and (N,) where they meet these."""
        if shape.walls not in self._exits:
            sheared = replace(self.rays, sideways=self.rays.sideways - np.array(shape.tilt))
            found = exits(sheared, self.outline, self.deepest + 1, shape.grow, shape.draft, shape.sink)
            self._exits[shape.walls] = sheared, found
        return self._exits[shape.walls]

    def rests(self, shape: _Shape) -> bool:
        """Whether a floor has the hull below it: most rays that reach it don't go on through what is open already."""
        sheared, found = self._traced(shape)
        reached = found >= shape.depth
        below = sheared.met(np.full(len(found), shape.depth), np.zeros(len(found), bool))[reached]
        return bool((below <= shape.depth).sum() >= _RESTING * len(below))

    def score(self, shape: _Shape) -> tuple[float, float]:
        """Mean disagreement and share of contradicting rays."""
        return _summary(*self.costs(shape))

    def closed(self) -> float:
        """Disagreement on the lid, were there no concavity."""
        return _summary(*disagreement(self.rays, np.full(len(self.rays), -1.0), 0.0, self.tolerance, side=self.side))[0]

    def rim_cost(self, shape: _Shape) -> float:
        """Disagreement where each place has one grey."""
        return _summary(*self.costs(shape, even=True))[0]

    def cost(self, shape: _Shape) -> float:
        """Disagreement alone, and the price of depth."""
        return self.score(shape)[0] + self.price * np.log2(max(shape.depth, 1.0))

    def simplest(self, shapes: Sequence[_Shape], known: Mapping[_Shape, _Costs] = MappingProxyType({})) -> _Shape:
        """One of the shapes, simplest first: a later one replaces it only if that surely explains the rays better.

        Args:
            shapes: in order.
            known: costs that were computed already.
        """
        best, costs = shapes[0], known.get(shapes[0]) or self.costs(shapes[0])
        for shape in shapes[1:]:
            other = known.get(shape) or self.costs(shape)
            if self.advantage(costs, other) > _SURE:
                best, costs = shape, other
        return best

    def advantage(self, costs: _Costs, other: _Costs) -> float:
        """By how many standard errors the rays that both shapes tell of disagree less on the other."""
        less = np.bincount(self._units, np.where(costs[1] & other[1], costs[0] - other[0], 0.0))
        return float(less.sum() / max(float(np.sqrt((less**2).sum())), _NOTHING))


def _summary(against: Array, told: NDArray[np.bool_]) -> tuple[float, float]:
    if not told.any():
        return np.inf, 1.0
    return float(against[told].mean()), float((against[told] > 1).mean())


def measure(
    stack: Stack, outline: NDArray[np.bool_], centers: Array, scene: Scene, tolerance: float
) -> tuple[Prism, float] | None:
    """The concavity under one opening, or None if the rays do not tell one.

    With it comes its gain: by how much less the rays disagree than on a lid, summed over cells of the lattice.

    Args:
        stack: what the views show on the opening's plane.
        outline: (R, C) cells of the opening.
        centers: (V, 3) camera centres.
        scene: the hull.
        tolerance: grey levels that one place may differ by.
    """
    pitch = stack.lattice.pitch
    ends, breaks = _ends(scene, stack, outline)
    every = gather(stack, outline, centers, scene)
    if len(every) < _LEAST_RAYS or not ends:
        return None
    opening = _Opening(every, _SEARCH_RAYS, outline, ends, tolerance, breaks)
    rim = _Opening(every, _RIM_RAYS, outline, ends, tolerance, breaks)
    best = _refine(rim, _best_depth(opening, _DEPTHS))
    few = _Opening(every, _FEW_RAYS, outline, ends, tolerance, breaks)
    others = (_countersunk(few, best), _tapered(few), *([_oblique(few)] if few.holed else []))
    for leaning in others:
        if few.score(leaning)[0] < few.score(best)[0]:
            sunk = np.isfinite(leaning.sink)
            leaning = _refine(rim, leaning if leaning.through or sunk else _best_depth(opening, _DEPTHS, leaning))
            sure = opening.advantage(opening.costs(best), opening.costs(leaning)) > _SURE
            share = opening.score(leaning)[0] / opening.score(best)[0]
            if sure and share < (_CHAMFERED if sunk else _LEANING) and (not sunk or _has_throat(outline, leaning)):
                best = leaning
    disagreeing, error = opening.score(best)
    closed = opening.closed()
    deep = best.through or best.depth - opening.face > _DEEP
    if disagreeing > (_GAIN if deep else _SHALLOW_GAIN) * closed or (not deep and best.depth < opening.shallowest + 1):
        return None
    endless = False
    if not best.through:
        endless = opening.advantage(opening.costs(replace(best, depth=opening.ends[0])), opening.costs(best)) < _SURE
        best = _deepen(opening, _Opening(every, _FINAL_RAYS, outline, ends, tolerance, breaks), best)
    fitted = signed_outline(outline) < best.grow
    gain = (closed - disagreeing) * float(np.count_nonzero(fitted))
    prism = Prism(
        stack.lattice,
        fitted,
        best.depth * pitch,
        best.through,
        error,
        best.tilt,
        best.draft,
        best.sink * pitch,
        endless,
    )
    return prism, gain


def _ends(scene: Scene, stack: Stack, outline: NDArray[np.bool_]) -> tuple[_Ends, bool]:
    """Depths in cells at which a hole is through: past the nearest part of the hull below, and past all of it.

    With them, whether most of the opening lies over another one.
    """
    lattice = stack.lattice
    below = stack.surface()[outline]
    crossings, inside = crossings_of(scene, below, np.broadcast_to(-lattice.normal, below.shape), lattice.pitch)
    crossings += stack.relief[outline][:, None] / lattice.pitch
    if not crossings.shape[1]:
        return (), False
    breaks = bool(np.isfinite(crossings[:, 2:]).any(axis=1).mean() > _BREAKING)  # out of the hull, in again and out
    near = np.where(inside, crossings[:, 0], np.nan)
    near = near[np.isfinite(near)]
    far = float(crossings[np.isfinite(crossings)].max())
    nearest = float(np.quantile(near, _TOLD_SHARE)) + 1 if len(near) else far + 1
    return ((nearest, far + 1) if far > nearest else (far + 1,)), breaks


def _best_depth(opening: _Opening, count: int, like: _Shape = _STRAIGHT) -> _Shape:
    """The best of some depths, of walls that lean like those of another shape."""
    depths = np.unique(np.geomspace(opening.shallowest, max(opening.deepest, opening.shallowest), count))
    blind = [replace(like, depth=float(d), through=False) for d in depths]
    known: dict[_Shape, _Costs] = {}
    if not opening.price:
        known = {shape: opening.costs(shape) for shape in blind}
        scores = [_summary(*costs)[0] for costs in known.values()]
        opening.price = _DEEPER * (max(scores) - min(scores))
    holes = [replace(like, depth=end, through=True) for end in opening.ends if opening.holed]
    # where something shows through, a hole is the simplest
    return opening.simplest([*holes, *[shape for shape in blind if not holes or opening.rests(shape)]], known)


def _countersunk(opening: _Opening, straight: _Shape) -> _Shape:
    """The best countersunk or chamfered hole (perhaps at its far end too), or blind one as deep as a straight one."""
    width = float(-signed_outline(opening.outline).min())
    shapes = [_Shape(end, through=True) for end in opening.ends] if opening.holed else []
    if not straight.through:
        shapes.append(straight)
    throats = []
    for shape in shapes:
        for share in _THROATS:
            throat = replace(shape, draft=1.0, sink=float(share) * width)
            throats.append(throat)
            if shape.through:
                throats.append(replace(throat, depth=throat.depth - throat.sink))
    best = min(throats, key=opening.cost)
    widest = float(_THROATS[-1]) * width
    step = 1.0
    while step > _FINEST:
        moves = [
            replace(best, grow=best.grow + g * step, sink=float(np.clip(best.sink + k * step, 0.0, widest)))
            for g, k in ((0, 0), (1, 1), (-1, -1), (0, 1), (0, -1))  # the rim or the throat moves
        ]
        drafts = [best.draft * _COUNTERSINK_RATIO ** (k * step) for k in (-1, 1)]
        moves += [replace(best, draft=draft) for draft in drafts if 1 / _MOST_DRAFT <= draft <= _MOST_DRAFT]
        better = min(moves, key=opening.cost)
        step = step / 2 if better == best else step
        best = better
    return best


def _has_throat(outline: NDArray[np.bool_], shape: _Shape) -> bool:
    """Whether a countersink is more than a rim that is off, and leaves a hole."""
    width = shape.grow - float(signed_outline(outline).min())
    return _LEAST_SINK < shape.sink <= _MOST_SINK * width and width - shape.sink >= _LEAST_THROAT


def _deepen(opening: _Opening, full: _Opening, best: _Shape) -> _Shape:
    """The floor's depth from all rays, where some of them do not tell how much deeper it is."""
    costs = opening.costs(best)
    count = min(int(np.log(opening.deepest / best.depth) / np.log(_FINAL_RATIO)), _MOST_DEEPER)
    deeper = [replace(best, depth=best.depth * _FINAL_RATIO**k) for k in range(1, count + 1)]
    open_ones = [shape for shape in deeper if opening.advantage(opening.costs(shape), costs) < _SURE]
    if not open_ones:
        return best
    found = full.simplest([best, *open_ones])
    near = [replace(found, depth=found.depth * _FINAL_RATIO ** (k / 4)) for k in range(-4, 5)]
    return found if found is best else min(near, key=full.cost)


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
        tried = [replace(best, draft=float(np.clip(best.draft + k, 0.0, _MOST_DRAFT))) for k in (0, step, -step)]
        if not best.through:
            tried += [
                replace(best, depth=float(np.clip(best.depth * k, opening.shallowest, opening.deepest)))
                for k in (0.9, 1.1)
            ]
        better = min(tried, key=opening.cost)
        step = step / 2 if better == best else step
        best = better
    return best


def _refine(rim: _Opening, best: _Shape) -> _Shape:
    """Depth and outline in turn, in ever smaller steps."""
    step, grows = max(0.1 * best.depth, 2 * _FINEST), best.grow + _GROWS
    while step > _FINEST:
        best = min((replace(best, grow=float(g)) for g in grows), key=rim.rim_cost)
        if np.isfinite(best.sink):
            far = rim.deepest - best.depth  # the countersink at the far end, of the same size or none
            sinks = [max(best.sink + float(k), 0.0) for k in _GROWS / 2]
            tried = [replace(best, sink=k) for k in sinks]
            if best.through:
                tried = [replace(t, depth=rim.deepest - (t.sink if far > 0 else 0.0)) for t in tried]
            best = min(tried, key=rim.rim_cost)
        if not best.through:
            tried = [replace(best, depth=best.depth + k * step) for k in (-1, -0.5, 0, 0.5, 1)]
            best = min((t for t in tried if rim.shallowest <= t.depth <= rim.deepest), key=rim.rim_cost, default=best)
        step /= 2
    return best
