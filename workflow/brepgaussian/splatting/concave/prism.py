"""A prismatic concavity: a planar outline, pushed into the solid to a flat floor, straight, leaning or tapered."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.splatting.concave.sections import Section

Array = NDArray[np.float64]

_SMOOTH_CELLS = 1.5  # an outline of cells is a staircase, a wall is not
_ISLAND_CELLS = 8.0  # around an island within which a field follows it
_REACH_PLACES = 32  # of a section's border


def plane_axes(normal: Array) -> tuple[Array, Array]:
    """Two unit vectors (3,) that make a right-handed frame with a unit normal (3,)."""
    first = np.cross(np.eye(3)[int(np.argmin(np.abs(normal)))], normal)
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first)


@dataclass(frozen=True)
class Lattice:
    """A square lattice on a plane.

    Attributes:
        origin: (3,) position of the corner of cell (0, 0).
        first, second: (3,) unit axes of rows and columns; `normal`: (3,) unit, out of the solid.
        pitch: side of a cell.
        shape: numbers of cells along `first` and `second`.
    """

    origin: Array
    first: Array
    second: Array
    normal: Array
    pitch: float
    shape: tuple[int, int]

    @property
    def offset(self) -> float:
        """Of its plane, `normal . x = offset`."""
        return float(self.origin @ self.normal)

    def centers(self) -> Array:
        """(R, C, 3) centres of the cells."""
        rows = (np.arange(self.shape[0]) + 0.5) * self.pitch
        columns = (np.arange(self.shape[1]) + 0.5) * self.pitch
        return self.origin + rows[:, None, None] * self.first + columns[None, :, None] * self.second

    def widened(self, cells: int) -> "Lattice":
        """The same with so many cells more on every side."""
        corner = self.origin - cells * self.pitch * (self.first + self.second)
        return replace(self, origin=corner, shape=(self.shape[0] + 2 * cells, self.shape[1] + 2 * cells))

    def finer(self, low: NDArray[np.integer], high: NDArray[np.integer], times: int) -> tuple["Lattice", Array]:
        """Its cells from `low` to `high` (2,), so many times finer, and (R, C, 2) where they are in this lattice."""
        corner = self.origin + self.pitch * (low[0] * self.first + low[1] * self.second)
        rows, columns = (int(n) for n in times * (high - low))
        fine = replace(self, origin=corner, pitch=self.pitch / times, shape=(rows, columns))
        return fine, low + (np.moveaxis(np.indices(fine.shape), 0, -1) + 0.5) / times - 0.5

    def coordinates(self, points: Array) -> tuple[Array, Array]:
        """(N, 2) fractional cell indices (a cell's centre has integer ones) and (N,) heights along the normal."""
        offset = points - self.origin
        cells = np.column_stack([offset @ self.first, offset @ self.second]) / self.pitch - 0.5
        return cells, offset @ self.normal


def carried(start: Lattice, outline: NDArray[np.bool_], lattice: Lattice) -> NDArray[np.bool_]:
    """An outline on one lattice, carried along its normal to another one."""
    cells = np.round(start.coordinates(lattice.centers().reshape(-1, 3))[0]).astype(int)
    inside = ((cells >= 0) & (cells < outline.shape)).all(axis=1)
    result = np.zeros(len(cells), bool)
    result[inside] = outline[tuple(cells[inside].T)]
    return result.reshape(lattice.shape)


def over(lattice: Lattice, outline: NDArray[np.bool_], points: Array) -> tuple[NDArray[np.bool_], Array]:
    """(N,) whether points lie over (or under) the outline, and (N,) their heights above the plane."""
    cells, heights = lattice.coordinates(points)
    index = np.round(cells).astype(int)
    within: NDArray[np.bool_] = np.all((index >= 0) & (index < outline.shape), axis=1)
    within[within] = outline[index[within, 0], index[within, 1]]
    return within, heights


@dataclass(frozen=True)
class Prism:
    """One concavity.

    Attributes:
        lattice: on the plane of the opening.
        outline: (R, C) bool cells of the opening.
        depth: from the opening to the floor.
        through: whether background shows through it.
        error: share of rays that contradict it, 0..1.
        tilt: sideways move along the lattice's axes for each unit of depth (an oblique hole).
        draft: how far the outline shrinks on all sides for each unit of depth.
        sink: how far it shrinks at most: from there on a countersunk hole is straight.
        endless: whether the rays that tell its walls don't tell a floor: it may as well be deeper, or go through.
        domed: whether its floor is a spherical cap as wide as its walls there; it is round.
        above: how high the hull stands over the opening, where it fills the corner beside a hub.
        section: what the outline is a drawing of, if it is one of the usual ones; its walls are straight.
        islands: what stands on its floor and ends below its opening: straight, from a top (the lattice) down.
        step: depth of a shoulder all around it, where it narrows by `sink` at once, or down to which the walls of a
            funnel are straight; `parted` makes two of it.
        ring: whether its floor is a shoulder around a hole that is known: nothing else is sought in it.
        shown: depth that rays show, where a greater one is only likely; 0 = all of it.
    """

    lattice: Lattice
    outline: NDArray[np.bool_]
    depth: float
    through: bool
    error: float
    tilt: tuple[float, float] = (0.0, 0.0)
    draft: float = 0.0
    sink: float = np.inf
    endless: bool = False
    domed: bool = False
    above: float = 0.0
    section: Section | None = None
    islands: tuple["Prism", ...] = ()
    ring: bool = False
    step: float = 0.0
    shown: float = 0.0

    @property
    def least_depth(self) -> float:
        """That rays show."""
        return self.shown or self.depth

    @property
    def area(self) -> float:
        """Area of the opening."""
        return float(self.outline.sum()) * self.lattice.pitch**2

    @property
    def middle(self) -> Array:
        """(3,) the opening's centre."""
        return np.asarray(self.lattice.centers()[self.outline].mean(axis=0))

    @property
    def tapered(self) -> bool:
        """Whether it narrows all the way down."""
        return self.draft > 0 and not np.isfinite(self.sink)

    @property
    def rim(self) -> float:
        """By how much its throat is narrower than its opening on all sides: 0 without a countersink."""
        return self.sink if self.draft > 0 and not self.tapered else 0.0

    @cached_property
    def _smooth_outline(self) -> Array:
        return np.asarray(ndimage.gaussian_filter(signed_outline(self.outline), _SMOOTH_CELLS) * self.lattice.pitch)

    def lateral(self, cells: Array) -> Array:
        """(N,) distance, unit frame, of fractional cells (N, 2) to the opening's border, negative inside."""
        if self.section is not None:
            return self.section.signed_distance(cells) * self.lattice.pitch
        inside = np.asarray(ndimage.map_coordinates(self._smooth_outline, cells.T, order=1, mode="nearest"))
        return inside + _beyond(cells, self.lattice.shape) * self.lattice.pitch

    def signed_distance(self, points: Array, margin: float) -> Array:
        """(N,) about the distance to the concavity's walls and floor, negative within it.

        Args:
            points: (N, 3) positions.
            margin: how far it reaches above its opening (and below its end, if it goes through).
        """
        if self.step:
            wide, narrow = (part.signed_distance(points, margin) for part in self.parted())
            return np.minimum(wide, narrow)
        cells, height = self.upright(points)
        lateral = self.lateral(cells)
        leaning = 1 + np.dot(self.tilt, self.tilt)
        throat = (lateral + self.sink) / np.sqrt(leaning)
        lateral = (lateral + self.draft * np.maximum(-height, 0)) / np.sqrt(leaning + self.draft**2)
        lateral = np.minimum(lateral, throat)
        bottom = self.depth + (margin if self.through else 0.0)
        vertical = np.maximum(height - margin, -height - bottom)
        walls = np.maximum(lateral, vertical)
        if self.domed:
            walls = np.maximum(walls, self._cap(cells, height))
        for island in self.islands:
            near = np.flatnonzero(walls < _ISLAND_CELLS * self.lattice.pitch)
            around, over = island.lattice.coordinates(points[near])
            low, high = island.reach
            beside = np.all((around > low - _ISLAND_CELLS) & (around < high + _ISLAND_CELLS), axis=1)
            near, around, over = near[beside], around[beside], over[beside]
            walls[near] = np.maximum(walls[near], -np.maximum(island.lateral(around), over))
        return walls

    @cached_property
    def reach(self) -> tuple[Array, Array]:
        """(2,) least and largest row and column of it."""
        cells = np.argwhere(self.outline).astype(float)
        if self.section is not None:
            cells = np.concatenate([cells, self.section.border(_REACH_PLACES)])
        return cells.min(axis=0), cells.max(axis=0)

    def lowered(self, depth: float) -> Lattice:
        """Its lattice, so much deeper in it."""
        return replace(self.lattice, origin=self.lattice.origin - depth * self.lattice.normal)

    def parted(self) -> tuple["Prism", "Prism"]:
        """What lies above its shoulder, and the rest, which is narrower or narrows."""
        plain = replace(self, sink=np.inf, draft=0.0, step=0.0)
        wide = replace(plain, depth=self.step, through=False, endless=False, ring=True)
        rest = replace(plain, lattice=self.lowered(self.step), depth=self.depth - self.step, section=None)
        if self.draft:
            return wide, replace(rest, draft=self.draft, sink=self.sink)
        return wide, replace(rest, outline=signed_outline(self.outline) < -self.sink / self.lattice.pitch)

    def _cap(self, cells: Array, height: Array) -> Array:
        """(N,) distance to the spherical floor, negative within the sphere and above its widest place in the walls."""
        inside = np.argwhere(self.outline)
        radius = np.sqrt(len(inside) / np.pi) * self.lattice.pitch - self.rim
        deep = min(self.depth - (self.rim / self.draft if self.rim else 0.0), radius)
        sphere = (radius**2 + deep**2) / (2 * deep)
        away = np.linalg.norm(cells - inside.mean(axis=0), axis=1) * self.lattice.pitch
        found = np.hypot(away, height + self.depth - sphere) - sphere
        return np.where(height < deep - self.depth, found, -np.inf)

    def upright(self, points: Array) -> tuple[Array, Array]:
        """(N, 2) fractional cells of the opening below which points (N, 3) lie, along its walls, and (N,) heights."""
        cells, height = self.lattice.coordinates(points)
        return cells + np.outer(height, self.tilt) / self.lattice.pitch, height

    def box(self, margin: float) -> tuple[Array, Array]:
        """(3,) least and (3,) largest row, column and height of what a straight one may contain."""
        used, deep = np.argwhere(self.outline), self.depth + margin
        return np.append(used.min(axis=0) - 1, -deep), np.append(used.max(axis=0) + 1, deep)

    def contains(self, points: Array, margin: float) -> NDArray[np.bool_]:
        """(N,) whether points (N, 3) lie within a straight concavity; `margin` as for `signed_distance`."""
        low, high = self.box(margin)
        places = np.column_stack(self.lattice.coordinates(points))
        inside: NDArray[np.bool_] = np.asarray(((places >= low) & (places <= high)).all(axis=1))
        inside[inside] = self.signed_distance(points[inside], margin) < 0
        return np.asarray(inside)


def signed_outline(outline: NDArray[np.bool_]) -> Array:
    """(R, C) distance of cell centres to an outline, in cells, negative inside. Not to be changed: it is kept."""
    return _signed_outline(np.packbits(outline).tobytes(), outline.shape)


@lru_cache(maxsize=64)
def _signed_outline(bits: bytes, shape: tuple[int, int]) -> Array:
    flat = np.unpackbits(np.frombuffer(bits, np.uint8), count=shape[0] * shape[1])
    padded = np.pad(flat.reshape(shape).astype(bool), 1)
    inside, outside = ndimage.distance_transform_edt(padded), ndimage.distance_transform_edt(~padded)
    # half a cell on either side puts zero on the border between two cells
    return np.where(padded, 0.5 - inside, outside - 0.5)[1:-1, 1:-1]


def _beyond(cells: Array, shape: tuple[int, int]) -> Array:
    """(N,) distance of fractional cells from the lattice's rectangle, in cells."""
    low = np.maximum(-cells, 0)
    high = np.maximum(cells - (np.array(shape) - 1), 0)
    return np.linalg.norm(low + high, axis=1)
