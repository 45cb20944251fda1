"""Rays through an opening: where they enter, how they walk sideways as they sink, where they meet a wall."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.splatting.concave.openings import Stack
from brepgaussian.splatting.concave.prism import signed_outline

Array = NDArray[np.float64]

_STEPS = 32  # of sphere tracing; what is left then is below a tenth of a cell except for grazing rays
_REACHED = 0.05  # cells
_SLOWEST = 1e-3  # sideways cells per cell of depth: a ray straight down never leaves
_BELT_CELLS = 4  # of face around an opening that is looked at too, so that the outline can be judged


@dataclass(frozen=True)
class Rays:
    """Rays of all views through a lattice. Lengths are in cells.

    Attributes:
        start: (N, 2) where they cross the lattice.
        sideways: (N, 2) how far they go sideways for each cell of depth.
        grey: (N,) float64 grey level, -1 on background.
    """

    start: Array
    sideways: Array
    grey: Array

    def __len__(self) -> int:
        return len(self.grey)

    def sample(self, count: int, seed: int = 0) -> "Rays":
        """At most `count` of them, evenly at random."""
        if len(self) <= count:
            return self
        chosen = np.sort(np.random.default_rng(seed).choice(len(self), count, replace=False))
        return Rays(self.start[chosen], self.sideways[chosen], self.grey[chosen])


def gather(stack: Stack, outline: NDArray[np.bool_], centers: Array) -> Rays:
    """The rays through an opening and a belt around it.

    Args:
        stack: what the views show on the opening's plane.
        outline: (R, C) cells of the opening.
        centers: (V, 3) camera centres.
    """
    lattice = stack.lattice
    rows, columns = np.nonzero(ndimage.binary_dilation(outline, iterations=_BELT_CELLS))
    cells = lattice.centers()[rows, columns]  # (N, 3)
    starts, sideways, greys = [], [], []
    for view, center in enumerate(centers):
        grey = stack.grey[view, rows, columns]
        seen = np.isfinite(grey)
        ray = cells[seen] - center
        sideways.append(np.column_stack([ray @ lattice.first, ray @ lattice.second]) / -(ray @ lattice.normal)[:, None])
        starts.append(np.column_stack([rows[seen], columns[seen]]).astype(float))
        greys.append(grey[seen].astype(float))
    return Rays(np.concatenate(starts), np.concatenate(sideways), np.concatenate(greys))


def exits(
    rays: Rays,
    outline: NDArray[np.bool_],
    deepest: float,
    grow: float = 0.0,
    draft: float = 0.0,
    sink: float = np.inf,
) -> Array:
    """(N,) depth at which each ray meets the wall of an opening, at most `deepest`; negative outside of it.

    Args:
        rays: in the frame in which the opening's walls go straight down (or lean by `draft` only).
        outline: (R, C) cells of the opening.
        deepest: where to stop.
        grow: how far the outline is moved outwards.
        draft: how far it shrinks for each cell of depth.
        sink: how far it shrinks at most, cells: a countersunk hole is straight from there on.
    """
    clear = -signed_outline(outline) + grow  # (R, C) positive inside
    speed = np.maximum(np.linalg.norm(rays.sideways, axis=1), _SLOWEST) + max(draft, 0.0)
    depth = np.zeros(len(rays))
    left = np.arange(len(rays))
    for step in range(_STEPS):
        position = rays.start[left] + depth[left, None] * rays.sideways[left]
        room = ndimage.map_coordinates(clear, position.T, order=1, mode="nearest") - np.minimum(
            draft * depth[left], sink
        )
        if step == 0:
            depth[room < 0] = -1.0
        going = (room > _REACHED) & (depth[left] < deepest)
        left, room = left[going], room[going]
        if not len(left):
            break
        depth[left] += room / speed[left]
    return np.minimum(depth, deepest)
