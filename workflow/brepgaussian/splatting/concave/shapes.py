"""Shapes that a concavity may have, and how well each explains the rays through its opening."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.geometry.rows import distinct
from brepgaussian.splatting.concave.prism import signed_outline
from brepgaussian.splatting.concave.radiance import LEAST_PASSING, PLACE_CELLS, disagreement
from brepgaussian.splatting.concave.rays import Rays, exits, exits_of_dome, exits_of_funnel, exits_of_step

Array = NDArray[np.float64]
Ends = tuple[float, ...]  # depths in cells at which a hole is through
Costs = tuple[Array, NDArray[np.bool_]]  # (N,) disagreement of rays, (N,) which of them are told

SHALLOWEST = 3.0  # cells
_DEEPER = 0.005  # of the range of disagreement: price of each doubling of the depth, against drifting on a plateau
SURE = 4.0  # standard errors by which a deeper floor must explain the rays better
_NOTHING = 1e-9
_RESTING = 0.3  # of the rays that reach a floor: a shoulder is the rim of a narrower hole
_MOST_PLACE_CELLS = 8.0
_UNIT_CELLS = 3  # rays of one view this close to each other err together
FINEST = 0.25  # cells
_MIXED_CELLS = 1.5  # a pixel this near to a rim shows both sides of it
_LEAST_CLEAR = 0.3  # of the rays through an opening are clear of its rim; else, in a narrow slot, all count


@dataclass(frozen=True)
class Shape:
    """What is sought, in cells."""

    depth: float
    grow: float = 0.0
    draft: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    through: bool = False
    sink: float = np.inf
    domed: bool = False  # the floor is a spherical cap
    step: float = 0.0  # depth of a shoulder, where it narrows by `sink` at once, or from where on by `draft`; 0 = none
    hollow: float = 0.0  # radius about the middle within which the floor is open: rays there tell nothing

    @property
    def walls(self) -> tuple[float, ...]:
        """All but how deep it is, if the floor is flat."""
        return (self.grow, self.draft, self.sink, self.step, *self.tilt, self.depth if self.domed else -1.0)

    @property
    def top(self) -> float:
        """Depth at which the walls go straight down."""
        return self.sink / self.draft if self.draft and np.isfinite(self.sink) else 0.0


STRAIGHT = Shape(SHALLOWEST)


class Opening:
    """One opening with its rays; remembers what was tried."""

    def __init__(
        self,
        every: Rays,
        count: int,
        outline: NDArray[np.bool_],
        ends: Ends,
        tolerance: float,
        breaks: bool,
    ) -> None:
        """Use `count` of all rays; `ends` and `breaks` are those of `_ends`."""
        rays = every.sample(count)
        self.face = _deepest(every, outline)  # that the face lies below the lattice
        self.shallowest = self.face + SHALLOWEST
        self.rays, self.outline, self.ends, self.tolerance = rays, outline, ends, tolerance
        self.side = place_side(len(every), len(rays), _MOST_PLACE_CELLS)
        self.lit = bool((rays.grey < 0).sum() >= LEAST_PASSING)
        self.holed = self.lit or breaks
        self.deepest = ends[-1]
        self.price = 0.0  # of each doubling of the depth
        self._exits: dict[tuple[float, ...], tuple[Rays, Array]] = {}
        self._scores: dict[tuple[Shape, bool], tuple[float, float]] = {}
        self.keep_clear(None)
        self._units = units_of(rays)

    def costs(self, shape: Shape, even: bool = False) -> Costs:
        """(N,) disagreement of the rays, (N,) which of them are told."""
        sheared, found = self._traced(shape)
        side = PLACE_CELLS if even else self.side
        against, told = disagreement(sheared, found, shape.depth, self.tolerance, shape.through, side, even)
        if shape.hollow:
            away = sheared.start + shape.depth * sheared.sideways - self.middle[0]
            told &= (found < shape.depth) | (np.hypot(*away.T) > shape.hollow)
        return against, told & self._counted

    def keep_clear(self, grow: float | None) -> None:
        """Let rays that enter at the rim of the outline, moved outwards, not count; None: all count.

        They tell where the rim is, but of what lies below they tell nothing.
        """
        self._scores.clear()
        self._counted = np.ones(len(self.rays), bool)
        if grow is None:
            return
        entry = self.rays.start + self.rays.entry[:, None] * self.rays.sideways
        beyond = ndimage.map_coordinates(signed_outline(self.outline), entry.T, order=1, mode="nearest") - grow
        clear, inside = np.abs(beyond) > _MIXED_CELLS, beyond < 0
        if (clear & inside).sum() >= _LEAST_CLEAR * inside.sum():
            self._counted = clear

    def _traced(self, shape: Shape) -> tuple[Rays, Array]:
        """The rays in the frame of a shape's walls, and (N,) where they meet these."""
        if shape.walls not in self._exits:
            sheared = replace(self.rays, sideways=self.rays.sideways - np.array(shape.tilt))
            deepest = self.deepest + 1
            if shape.step and shape.draft:
                walls = shape.grow, shape.draft, shape.sink, shape.step
                found = exits_of_funnel(sheared, self.outline, deepest, *walls)
            elif shape.step:
                found = exits_of_step(sheared, self.outline, deepest, shape.grow, shape.sink, shape.step)
            else:
                found = exits(sheared, self.outline, deepest, shape.grow, shape.draft, shape.sink)
            if shape.domed:
                found = self._to_dome(sheared, found, shape)
            self._exits[shape.walls] = sheared, found
        return self._exits[shape.walls]

    def _to_dome(self, rays: Rays, straight: Array, shape: Shape) -> Array:
        center, width = self.middle
        radius = width + shape.grow - (shape.sink if shape.top else 0.0)
        return exits_of_dome(rays, straight, center, shape.top, radius, shape.depth)

    @cached_property
    def middle(self) -> tuple[Array, float]:
        """(2,) centre of the outline and radius of a circle of its area, cells."""
        return np.argwhere(self.outline).mean(axis=0), float(np.sqrt(np.count_nonzero(self.outline) / np.pi))

    def rests(self, shape: Shape) -> bool:
        """Whether a floor has the hull below it: most rays that reach it don't go on through what is open already."""
        sheared, found = self._traced(shape)
        reached = found >= shape.depth
        below = sheared.met(np.full(len(found), shape.depth), np.zeros(len(found), bool))[reached]
        return bool((below <= shape.depth).sum() >= _RESTING * len(below))

    def score(self, shape: Shape, even: bool = False) -> tuple[float, float]:
        """Mean disagreement and share of contradicting rays."""
        key = shape, even
        if key not in self._scores:  # searches come back to the same shapes
            self._scores[key] = summary(*self.costs(shape, even))
        return self._scores[key]

    def closed(self) -> float:
        """Disagreement on the lid, were there no concavity."""
        against, told = on_lid(self.rays, self.tolerance, self.side)
        return summary(against, told & self._counted)[0]

    def rim_cost(self, shape: Shape) -> float:
        """Disagreement where each place has one grey."""
        return self.score(shape, even=True)[0]

    def cost(self, shape: Shape) -> float:
        """Disagreement alone, and the price of depth."""
        return self.score(shape)[0] + self.price * np.log2(max(shape.depth, 1.0))

    def simplest(self, shapes: Sequence[Shape], known: Mapping[Shape, Costs] = MappingProxyType({})) -> Shape:
        """One of the shapes, simplest first: a later one replaces it only if that surely explains the rays better.

        Of a floor, what rays tell that don't tell of the other one counts, too: on walls of one grey, deeper floors
        lose the rays that contradict them.

        Args:
            shapes: in order.
            known: costs that were computed already.
        """
        best, costs = shapes[0], known.get(shapes[0]) or self.costs(shapes[0])
        for shape in shapes[1:]:
            other = known.get(shape) or self.costs(shape)
            on_the_whole = shape.through or summary(*other)[0] <= summary(*costs)[0]
            if on_the_whole and self.advantage(costs, other) > SURE:
                best, costs = shape, other
        return best

    def advantage(self, costs: Costs, other: Costs) -> float:
        """By how many standard errors the rays that both shapes tell of disagree less on the other."""
        return advantage(self._units, costs, other)


def _deepest(rays: Rays, outline: NDArray[np.bool_]) -> float:
    """How far the face lies below the lattice, at most, where rays enter an outline; not in the belt around it."""
    cells = np.round(rays.start + rays.entry[:, None] * rays.sideways).astype(int)
    on = np.flatnonzero(((cells >= 0) & (cells < outline.shape)).all(axis=1))
    inside = on[outline[tuple(cells[on].T)]]
    return float(rays.entry[inside].max(initial=0.0))


def place_side(every: int, count: int, most: float) -> float:
    """Side in cells of the places in which `count` of all rays agree: fewer rays need larger ones."""
    return float(min(PLACE_CELLS * np.sqrt(every / max(count, 1)), most))


def on_lid(rays: Rays, tolerance: float, side: float) -> Costs:
    """The costs of rays where there is no opening."""
    return disagreement(rays, np.full(len(rays), -1.0), 0.0, tolerance, side=side)


def units_of(rays: Rays) -> NDArray[np.int64]:
    """(N,) groups of rays that err together."""
    return distinct(np.column_stack([rays.view, (rays.start // _UNIT_CELLS).astype(np.int64)]))[1]


def advantage(units: NDArray[np.int64], costs: Costs, other: Costs) -> float:
    """By how many standard errors the rays of units (N,) that both shapes tell of disagree less on the other."""
    less = np.bincount(units, np.where(costs[1] & other[1], costs[0] - other[0], 0.0))
    return float(less.sum() / max(float(np.sqrt((less**2).sum())), _NOTHING))


def summary(against: Array, told: NDArray[np.bool_]) -> tuple[float, float]:
    """Mean disagreement of the rays (N,) that are told (N,), and share of those that contradict."""
    if not told.any():
        return np.inf, 1.0
    return float(against[told].mean()), float((against[told] > 1).mean())


def best_depth(opening: Opening, count: int, like: Shape = STRAIGHT) -> Shape:
    """The best of some depths, of walls that lean like those of another shape."""
    depths = np.unique(np.geomspace(opening.shallowest, max(opening.deepest, opening.shallowest), count))
    blind = [replace(like, depth=float(d), through=False) for d in depths]
    known: dict[Shape, Costs] = {}
    if not opening.price:
        known = {shape: opening.costs(shape) for shape in blind}
        scores = [summary(*costs)[0] for costs in known.values()]
        opening.price = _DEEPER * (max(scores) - min(scores))
    holes = [replace(like, depth=end, through=True) for end in opening.ends if opening.holed]
    floors = [shape for shape in blind if not holes or opening.rests(shape)]
    # where something shows through, a hole is the simplest; one that leads on to another opening has to be shown
    return opening.simplest([*holes, *floors] if opening.lit else [*floors, *holes], known)
