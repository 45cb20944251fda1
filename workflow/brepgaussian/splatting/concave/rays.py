"""Rays through an opening: where they enter, how they walk sideways as they sink, where they meet a wall or leave."""

from ctypes import c_double, c_int64
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.splatting.concave.openings import Stack
from brepgaussian.splatting.concave.prism import Lattice, signed_outline
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.library import load, pointer

Array = NDArray[np.float64]

_STEPS = 256  # of sphere tracing: a ray half a cell from a long wall takes one for each half cell of its way
_REACHED = 0.05  # cells
_SLOWEST = 1e-3  # sideways cells per cell of depth: a ray straight down never leaves
_BELT_CELLS = 4  # of face around an opening that is looked at too, so that the outline can be judged
_MOST_CROSSINGS = 6  # of a ray with the hull
_LEAST_SINE = 0.05  # of a ray's angle to the lattice: a leaning mouth is seen from below its hole, too
_LID_CELLS = 3.0  # crossings this close to the opening's plane are the lid's own roughness


@dataclass(frozen=True)
class Rays:
    """Rays of all views through a lattice. Lengths are in cells.

    Attributes:
        start: (N, 2) where they cross the lattice.
        sideways: (N, 2) how far they go sideways for each cell of depth.
        grey: (N,) float64 grey level, -1 on background.
        view: (N,) the view that they are of.
        crossings: (N, C) ascending depths at which they cross the hull below the lattice, infinite for none.
        inside: (N,) whether they are inside the hull before the first of them.
        entry: (N,) depth at which they cross the face; zero if the lattice lies on it.
    """

    start: Array
    sideways: Array
    grey: Array
    view: NDArray[np.int64]
    crossings: Array
    inside: NDArray[np.bool_]
    entry: Array

    def __len__(self) -> int:
        return len(self.grey)

    def sample(self, count: int, seed: int = 0) -> "Rays":
        """At most `count` of them, evenly at random."""
        if len(self) <= count:
            return self
        return self.chosen(np.sort(np.random.default_rng(seed).choice(len(self), count, replace=False)))

    def chosen(self, which: NDArray[np.int64] | NDArray[np.bool_]) -> "Rays":
        """Some of them, by their numbers or by a mask (N,)."""
        return Rays(*(getattr(self, f.name)[which] for f in fields(self)))

    def met(self, depth: Array, free: NDArray[np.bool_]) -> Array:
        """(N,) where a ray that is free down to a depth meets the hull: there, further down, or nowhere (infinite).

        Args:
            depth: (N,) cells.
            free: (N,) rays that are free until they leave the part of the hull that they are in.
        """
        passed = np.zeros(len(self), np.int64)
        for crossing in self.crossings.T:
            passed += crossing < depth
        within = (passed + self.inside) % 2 == 1
        index = passed + (within & free)
        known = index < self.crossings.shape[1]
        following = np.full(len(self), np.inf)
        following[known] = self.crossings[known, index[known]]
        return np.where(within & ~free, depth, following)


def gather(stack: Stack, outline: NDArray[np.bool_], centers: Array, scene: Scene) -> Rays:
    """The rays through an opening and a belt around it.

    Args:
        stack: what the views show on the opening's plane.
        outline: (R, C) cells of the opening.
        centers: (V, 3) camera centres.
        scene: the hull.
    """
    lattice = stack.lattice
    rows, columns = np.nonzero(ndimage.binary_dilation(outline, iterations=_BELT_CELLS))
    cells = stack.surface()[rows, columns]  # (N, 3)
    sunk = stack.relief[rows, columns] / lattice.pitch  # (N,)
    starts, sideways, greys, entries, origins, rays, views = [], [], [], [], [], [], []
    for view, center in enumerate(centers):
        grey = stack.grey[view, rows, columns]
        seen = np.isfinite(grey)
        sight = cells - center
        seen &= -(sight @ lattice.normal) > _LEAST_SINE * np.linalg.norm(sight, axis=1)
        ray = sight[seen]
        ray /= -(ray @ lattice.normal)[:, None]  # one unit of depth
        sideways.append(np.column_stack([ray @ lattice.first, ray @ lattice.second]))
        starts.append(np.column_stack([rows[seen], columns[seen]]) - sunk[seen, None] * sideways[-1])
        entries.append(sunk[seen])
        greys.append(grey[seen].astype(float))
        origins.append(cells[seen])
        rays.append(ray)
        views.append(np.full(int(seen.sum()), view, np.int64))
    crossings, inside = crossings_of(scene, np.concatenate(origins), np.concatenate(rays), lattice.pitch)
    entry = np.concatenate(entries)
    return Rays(
        np.concatenate(starts),
        np.concatenate(sideways),
        np.concatenate(greys),
        np.concatenate(views),
        crossings + entry[:, None],
        inside,
        entry,
    )


def crossings_of(scene: Scene, origins: Array, rays: Array, pitch: float) -> tuple[Array, NDArray[np.bool_]]:
    """(N, C) depths in cells, below the lid, at which rays cross a hull; (N,) whether they are inside before.

    Args:
        scene: the hull.
        origins: (N, 3) on the lid; rays: (N, 3) for one unit of depth.
        pitch: side of a cell.
    """
    length = np.linalg.norm(rays, axis=1)
    ray, distance = scene.intersections(origins, rays / length[:, None])
    depth = distance / length[ray] / pitch
    below = depth > _LID_CELLS
    ray, depth = ray[below], depth[below]
    order = np.lexsort([depth, ray])
    ray, depth = ray[order], depth[order]
    count = np.bincount(ray, minlength=len(origins))
    inside = count % 2 == 1  # a ray ends outside
    place = np.arange(len(ray)) - np.repeat(np.cumsum(count) - count, count)
    found = np.full((len(origins), min(int(count.max(initial=0)), _MOST_CROSSINGS)), np.inf)
    first = place < found.shape[1]
    found[ray[first], place[first]] = depth[first]
    return found, inside


def crossings_below(scene: Scene, origins: Array, lattice: Lattice) -> tuple[Array, NDArray[np.bool_]]:
    """The same of lines straight down from places (N, 3) on a lattice's plane."""
    return crossings_of(scene, origins, np.broadcast_to(-lattice.normal, origins.shape), lattice.pitch)


def exits(
    rays: Rays,
    outline: NDArray[np.bool_],
    deepest: float,
    grow: float = 0.0,
    draft: float = 0.0,
    sink: float = np.inf,
) -> Array:
    """(N,) depth at which each ray meets the wall of an opening, at most `deepest`; negative if it meets the face.

    Args:
        rays: in the frame in which the opening's walls go straight down (or lean by `draft` only).
        outline: (R, C) cells of the opening.
        deepest: where to stop.
        grow: how far the outline is moved outwards.
        draft: how far it shrinks for each cell of depth.
        sink: how far it shrinks at most, cells: a countersunk hole is straight from there on.
    """
    clear = np.ascontiguousarray(grow - signed_outline(outline))  # (R, C) positive inside
    start, sideways = np.ascontiguousarray(rays.start), np.ascontiguousarray(rays.sideways)
    depth = rays.entry.copy()
    load().bg_exits(
        c_int64(len(rays)), pointer(start), pointer(sideways), pointer(clear), *map(c_int64, clear.shape),
        *map(c_double, (deepest, draft, sink, _SLOWEST, _REACHED)), _STEPS, pointer(depth),
    )  # fmt: skip
    return depth


def exits_of_step(
    rays: Rays, outline: NDArray[np.bool_], deepest: float, grow: float, sink: float, top: float
) -> Array:
    """(N,) depth at which each ray meets the walls of an opening, or the shoulder at a depth `top` between them.

    Args:
        rays, outline, deepest, grow: as for `exits`.
        sink: how far the outline shrinks there, at once.
    """
    wide = exits(rays, outline, deepest, grow)
    narrow = exits(replace(rays, entry=np.full(len(rays), top)), outline, deepest, grow - sink)
    return np.where(wide < top, wide, np.where(narrow < 0, top, narrow))


def exits_of_funnel(
    rays: Rays, outline: NDArray[np.bool_], deepest: float, grow: float, draft: float, sink: float, top: float
) -> Array:
    """(N,) depth at which each ray meets the walls of an opening, which go straight down to a depth `top`.

    Args:
        rays, outline, deepest, grow: as for `exits`.
        draft, sink: how far the outline shrinks for each cell of depth from there on, and at most.
    """
    end = min(top + sink / draft, deepest)
    wide = exits(rays, outline, deepest, grow)
    cone, throat = (replace(rays, entry=np.full(len(rays), depth)) for depth in (top, end))
    on_cone = exits(cone, outline, end, grow + draft * top, draft)
    below = exits(throat, outline, deepest, grow - sink)
    below = np.where(on_cone < 0, top, np.where(on_cone < end, on_cone, np.where(below < 0, end, below)))
    return np.where(wide < top, wide, below)


def exits_of_dome(rays: Rays, straight: Array, center: Array, top: float, radius: float, depth: float) -> Array:
    """(N,) depth at which each ray meets the walls of a round opening, or the spherical cap that is its floor.

    Args:
        rays: as for `exits`.
        straight: (N,) what that gives for the walls.
        center: (2,) of the opening, cells; radius: of its walls where they go straight down, below `top`.
        depth: of the cap's lowest place; it is half a sphere at most.
    """
    height = min(depth - top, radius)
    sphere = (radius**2 + height**2) / (2 * height)
    away = rays.start - center
    side = rays.sideways
    # |away + d * side|^2 + (d - depth + sphere)^2 = sphere^2
    a = 1 + np.einsum("nc,nc->n", side, side)
    b = np.einsum("nc,nc->n", away, side) - (depth - sphere)
    c = np.einsum("nc,nc->n", away, away) + (depth - sphere) ** 2 - sphere**2
    root = b**2 - a * c
    cap = (np.sqrt(np.maximum(root, 0)) - b) / a
    return np.where((straight > depth - height) & (root > 0), np.minimum(cap, depth), straight)
