"""Concavities whose walls are not straight: countersunk, through at an angle, narrowing."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.concave.prism import signed_outline
from brepgaussian.splatting.concave.shapes import FINEST, SHALLOWEST, Opening, Shape, best_depth

_THROATS = np.linspace(0.05, 0.5, 10)  # of the opening's half width: by so much a countersunk hole is narrower
_SLANT = 1.0  # draft of a countersink of 90 degrees
_COUNTERSINKS = (_SLANT, 0.5)  # drafts tried first: seats are steeper
_COUNTERSINK_RATIO = 1.2  # of the drafts tried next: 45 degrees, then 40 and 50
_FEW_DEPTHS = 10
_TILTS = np.arange(-0.9, 0.91, 0.3)  # sideways per depth: up to 42 degrees
_DRAFTS = (0.25, 0.5, 1.0)
_MOST_DRAFT = 1.5
_FINEST_LEAN = 0.01
_LEAN_STEP = 0.04  # of draft, and relative of depth, at first
_RIM_MOVES = ((1, 1), (-1, -1), (0, 1), (0, -1))  # of outline and sink: the rim or the throat moves
_LEAST_SINK = 1.5  # cells; a smaller countersink is a rim that is off
_MOST_SINK = 0.6  # of the half width
_ROUND = 0.9  # of a circle's radius by its area, that lies within an outline; of a square .886 does
_DOME_DEPTHS = 16
_LEAST_STEP = 1.5  # cells above a shoulder
_STEPS, _WIDER = 12, (0.6, 0.8, 1.0, 1.3, 1.7)  # depths of it that are tried, and widths, of a countersink's
_HEIGHTS, _NARROWED = (0.1, 0.2, 0.35, 0.6, 1.0, 1.6), (0.3, 0.5, 0.7, 0.9)  # of half the width: a funnel's cone
_STEEPEST = 4.0  # of its draft, and of one over it: 14 degrees from flat, and from straight
_LEAST_THROAT = 3.0  # cells, half the width; through a narrower one no view tells anything


def countersunk(opening: Opening, straight: Shape) -> Shape:
    """The best countersunk or chamfered hole (perhaps at its far end too), or blind one as deep as a straight one."""
    width = float(-signed_outline(opening.outline).min())
    shapes = [Shape(end, through=True) for end in opening.ends] if opening.holed else []
    if not straight.through or not shapes:  # fewer rays may not show that it goes through
        shapes.append(straight)
    tried: list[Shape] = []
    for draft in _COUNTERSINKS:
        throats = [replace(shape, draft=draft, sink=float(k) * width) for shape in shapes for k in _THROATS]
        if draft == _SLANT:
            throats += [replace(t, depth=t.depth - t.sink) for t in throats if t.through]
        tried.append(to_best_sink(opening, throats))
    return min(tried, key=opening.cost)


def to_best_sink(opening: Opening, shapes: Sequence[Shape]) -> Shape:
    """The best countersunk shape that small steps of outline, throat and draft reach from the best of some."""
    widest = float(_THROATS[-1] * -signed_outline(opening.outline).min())

    def moves(best: Shape, step: float) -> Iterable[Shape]:
        for g, k in _RIM_MOVES:
            yield replace(best, grow=best.grow + g * step, sink=float(np.clip(best.sink + k * step, 0.0, widest)))
        drafts = [best.draft * _COUNTERSINK_RATIO ** (k * step) for k in (-1, 1)]
        yield from (replace(best, draft=draft) for draft in drafts if 1 / _STEEPEST <= draft <= _MOST_DRAFT)

    return _descended(opening, min(shapes, key=opening.cost), moves, 1.0)


def stepped(opening: Opening, sunk: Shape) -> Shape:
    """The best blind concavity with a shoulder around a narrower rest of it, from one whose rim is countersunk."""
    width = float(-signed_outline(opening.outline).min())

    def possible(shape: Shape) -> bool:
        deep = _LEAST_STEP <= shape.step <= shape.depth - SHALLOWEST and shape.depth >= opening.shallowest
        return deep and 0 < shape.sink < _MOST_SINK * width

    plain = replace(sunk, draft=0.0)
    tops = np.geomspace(_LEAST_STEP, max(sunk.depth, 2 * _LEAST_STEP), _STEPS)
    shapes = (replace(plain, step=float(top), sink=sunk.sink * k) for top in tops for k in _WIDER)
    best = min(filter(possible, shapes), key=opening.cost, default=plain)

    def moves(best: Shape, step: float) -> Iterable[Shape]:
        for g, k in _RIM_MOVES:
            yield replace(best, grow=best.grow + g * step, sink=best.sink + k * step)
        yield from (replace(best, step=best.step + k * step) for k in (1, -1))
        yield from (replace(best, depth=best.depth + k * step) for k in (1, -1))

    return _descended(opening, best, moves, 1.0, possible=possible)


def funnels(opening: Opening, best: Shape) -> list[Shape]:
    """The best round concavities that are straight down to where a cone begins: through it, and blind below the cone.

    None if the opening is not round; none through it if it shows no background.
    """
    width = float(-signed_outline(opening.outline).min())
    if any(best.tilt) or width < _ROUND * opening.middle[1]:
        return []
    walls = [
        replace(best, grow=0.0, domed=False, through=False, draft=draft, sink=narrower * width, step=share * width)
        for share, narrower, draft in product(_HEIGHTS, _NARROWED, _DRAFTS)
    ]
    holes = [replace(w, depth=end, through=True) for w in walls for end in opening.ends if opening.holed]
    found = to_best_funnel(opening, holes), to_best_funnel(opening, [_to_end(w) for w in walls])
    return [shape for shape in found if shape is not None]


def to_best_funnel(opening: Opening, shapes: Sequence[Shape]) -> Shape | None:
    """The best funnel that small steps reach from the best of some; None if none is possible."""
    width = float(-signed_outline(opening.outline).min())

    def possible(shape: Shape) -> bool:
        narrow = _LEAST_SINK < shape.sink <= width + shape.grow - (_LEAST_THROAT if shape.through else 0.0)
        leaning = 1 / _STEEPEST <= shape.draft <= _STEEPEST and shape.step >= _LEAST_STEP
        return narrow and leaning and shape.step + shape.sink / shape.draft <= opening.deepest

    def moves(best: Shape, step: float) -> Iterable[Shape]:
        tried = [replace(best, grow=best.grow + g * step, sink=best.sink + k * step) for g, k in _RIM_MOVES]
        tried += [replace(best, step=best.step + k * step) for k in (1, -1)]
        tried += [replace(best, draft=best.draft * _COUNTERSINK_RATIO ** (k * step)) for k in (1, -1)]
        yield from (shape if shape.through else _to_end(shape) for shape in tried)

    best = min(filter(possible, shapes), key=opening.cost, default=None)
    return None if best is None else _descended(opening, best, moves, 2.0, possible=possible)


def _to_end(shape: Shape) -> Shape:
    """A blind funnel down to where its cone ends."""
    return replace(shape, depth=shape.step + shape.sink / shape.draft)


def domed(opening: Opening, best: Shape) -> list[Shape]:
    """The best round concavity whose floor is a spherical cap: with straight walls, and countersunk.

    Nothing if the opening is not round, or goes through.
    """
    width = float(-signed_outline(opening.outline).min())
    if best.through or any(best.tilt) or width < _ROUND * opening.middle[1]:
        return []
    deepest = max(min(opening.deepest, best.depth + width), opening.shallowest)
    depths = np.geomspace(opening.shallowest, deepest, _DOME_DEPTHS)
    straight = replace(best, draft=0.0, sink=np.inf, domed=True)
    plain = to_best_dome(opening, [replace(straight, depth=float(depth)) for depth in depths])
    rims = [replace(plain, grow=plain.grow + g, draft=1.0, sink=float(s) * width) for s in _THROATS for g in (0, 1)]
    return [plain, to_best_dome(opening, rims)]


def to_best_dome(opening: Opening, shapes: Sequence[Shape]) -> Shape:
    """The best domed shape that small steps reach from the best of some."""
    width = opening.middle[1]

    def possible(shape: Shape) -> bool:
        return shape.depth > shape.top + FINEST and (not shape.top or 0 < shape.sink < _MOST_SINK * width)

    def moves(best: Shape, step: float) -> Iterable[Shape]:
        yield from (replace(best, grow=best.grow + k * step) for k in (1, -1))
        yield from (replace(best, depth=best.depth + k * step) for k in (1, -1))
        if best.top:
            for g, k in _RIM_MOVES:
                yield replace(best, grow=best.grow + g * step, sink=best.sink + k * step)
            yield from (replace(best, draft=best.draft * _COUNTERSINK_RATIO ** (k * step)) for k in (-1, 1))

    best = min(filter(possible, shapes), key=opening.cost, default=shapes[0])
    return _descended(opening, best, moves, 1.0, possible=possible)


def to_best_taper(opening: Opening, shape: Shape) -> Shape:
    """The best tapered blind shape that small steps of draft, depth and outline reach from one."""

    def possible(shape: Shape) -> bool:
        return 0 < shape.draft <= _MOST_DRAFT and opening.shallowest <= shape.depth <= opening.deepest

    def moves(best: Shape, step: float) -> Iterable[Shape]:
        for k in (step, -step):
            yield replace(best, draft=best.draft + k)
            yield replace(best, depth=best.depth * (1 + k))
            yield replace(best, grow=best.grow + k / _LEAN_STEP)

    return _descended(opening, shape, moves, _LEAN_STEP, _FINEST_LEAN / 2, possible)


def has_throat(outline: NDArray[np.bool_], shape: Shape) -> bool:
    """Whether a countersink is more than a rim that is off, and leaves a hole."""
    width = shape.grow - float(signed_outline(outline).min())
    return _LEAST_SINK < shape.sink <= _MOST_SINK * width and width - shape.sink >= _LEAST_THROAT


def oblique(opening: Opening) -> Shape:
    """The best hole that goes through at an angle."""
    shapes = [Shape(opening.deepest, tilt=(float(u), float(v)), through=True) for u in _TILTS for v in _TILTS]

    def moves(best: Shape, step: float) -> Iterable[Shape]:
        u, v = best.tilt
        for du, dv in ((step, 0), (-step, 0), (0, step), (0, -step)):
            yield replace(best, tilt=(float(u + du), float(v + dv)))

    return _descended(opening, min(shapes, key=opening.cost), moves, (_TILTS[1] - _TILTS[0]) / 2, _FINEST_LEAN)


def tapered(opening: Opening) -> Shape:
    """The best concavity that narrows with its depth."""
    best = min((best_depth(opening, _FEW_DEPTHS, Shape(0.0, draft=d)) for d in _DRAFTS), key=opening.cost)

    def moves(best: Shape, step: float) -> Iterable[Shape]:
        for k in (step, -step):
            yield replace(best, draft=float(np.clip(best.draft + k, 0.0, _MOST_DRAFT)))
        if not best.through:
            for ratio in (0.9, 1.1):
                yield replace(best, depth=float(np.clip(best.depth * ratio, opening.shallowest, opening.deepest)))

    return _descended(opening, best, moves, _DRAFTS[0] / 2, _FINEST_LEAN)


def _descended(
    opening: Opening,
    best: Shape,
    moves: Callable[[Shape, float], Iterable[Shape]],
    step: float,
    finest: float = FINEST,
    possible: Callable[[Shape], bool] = lambda _: True,
) -> Shape:
    """The best shape that ever smaller steps reach from one.

    Args:
        opening: with the rays that judge.
        best: the start.
        moves: from a shape, by a step.
        step, finest: the first and the last one.
        possible: which shapes may be taken.
    """
    while step > finest:
        better = min(filter(possible, (best, *moves(best, step))), key=opening.cost, default=best)
        step = step / 2 if better == best else step
        best = better
    return best
