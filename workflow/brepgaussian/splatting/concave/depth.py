"""The depth of an opening, from where each ray through it leaves its outline.

A ray that enters the opening walks sideways as it sinks. Its exit depth is where it crosses the outline. If
the floor lies deeper, the ray has met a wall; if not, it has met the floor. So the floor's depth is the
threshold on the exit depth that best parts the rays that show a wall from those that show the floor.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.splatting.concave.openings import BACKGROUND, LID, UNSEEN, WALL, Stack
from brepgaussian.splatting.concave.prism import Prism

Array = NDArray[np.float64]

_SECTORS = 16  # directions of the wall that a ray meets; each has its own grey
_SECTOR_RAYS = 30  # fewer say nothing about a sector
_SHALLOW_SHARE = 0.15  # of a sector's rays, those that leave first, surely meet its wall
_WALL_SHARE = 0.65  # of those, if the wall differs from the lid's grey all along the sector
_LEAST_RAYS = 100
_MARCH_STEPS = 80
_LEAST_SIDEWAYS = 1e-3  # a ray straight down never leaves


def measure(stack: Stack, outline: NDArray[np.bool_], centers: Array) -> Prism | None:
    """Depth of one opening, or None if the rays do not tell.

    Args:
        stack: what the views show on the opening's plane.
        outline: (R, C) cells of the opening.
        centers: (V, 3) camera centres.
    """
    exits, sectors, shown = _rays(stack, outline, centers)
    told = np.isin(sectors, _informative(exits, sectors, shown))
    exits, shown = exits[told], shown[told]
    # rays of the lid's grey show the floor of a blind concavity, but in one that goes through they show a
    # stretch of wall that happens to have that grey
    fits = [(_threshold(exits, shown, floor), floor == BACKGROUND) for floor in (LID, BACKGROUND)]
    told_fits = [(fit, through) for fit, through in fits if fit is not None]
    if not told_fits:
        return None
    (depth, error), through = min(told_fits, key=lambda item: item[0][1])
    return Prism(stack.lattice, outline, depth, through, error)


def _threshold(exits: Array, shown: NDArray[np.uint8], floor: int) -> tuple[float, float] | None:
    """The depth that best parts walls from floors, and the balanced share of rays against it."""
    used = (shown == WALL) | (shown == floor)
    order = np.argsort(exits[used], kind="stable")
    exits, wall = exits[used][order], (shown[used] == WALL)[order]
    walls, floors = int(wall.sum()), int((~wall).sum())
    if min(walls, floors) < _LEAST_RAYS:
        return None
    # shallower than the k-th exit: walls that leave deeper, and floors that leave before, contradict
    cost = (walls - np.cumsum(wall)) / walls + np.cumsum(~wall) / floors
    best = int(cost.argmin())
    return float(exits[best]), float(cost[best] / 2)


def _informative(exits: Array, sectors: NDArray[np.int64], shown: NDArray[np.uint8]) -> list[int]:
    """Sectors whose wall differs from the lid's grey."""
    found = []
    for sector in range(_SECTORS):
        member = sectors == sector
        if member.sum() >= _SECTOR_RAYS:
            shallow = member & (exits <= np.quantile(exits[member], _SHALLOW_SHARE))
            if np.mean(shown[shallow] == WALL) > _WALL_SHARE:
                found.append(sector)
    return found


def _rays(
    stack: Stack, outline: NDArray[np.bool_], centers: Array
) -> tuple[Array, NDArray[np.int64], NDArray[np.uint8]]:
    """Exit depth, wall sector and what is shown, of every ray through the opening in every view."""
    lattice = stack.lattice
    rows, columns = np.nonzero(outline)
    cells = lattice.centers()[rows, columns]  # (N, 3)
    inside = ndimage.distance_transform_edt(np.pad(outline, 1))[1:-1, 1:-1]
    slope = np.gradient(ndimage.gaussian_filter(outline.astype(float), 1.5))
    parts = []
    for view, center in enumerate(centers):
        shown = stack.shown[view, rows, columns]
        seen = shown != UNSEEN
        ray = cells[seen] - center
        sideways = np.column_stack([ray @ lattice.first, ray @ lattice.second]) / -(ray @ lattice.normal)[:, None]
        start = np.column_stack([rows[seen], columns[seen]]).astype(float)
        length, end = _march(start, sideways, inside)
        exits = length * lattice.pitch / np.maximum(np.linalg.norm(sideways, axis=1), _LEAST_SIDEWAYS)
        angle = np.arctan2(-slope[0][end[:, 0], end[:, 1]], -slope[1][end[:, 0], end[:, 1]])
        sector = ((angle + np.pi) / (2 * np.pi) * _SECTORS).astype(int) % _SECTORS
        parts.append((exits, sector, shown[seen]))
    exits, sectors, shown = (np.concatenate(column) for column in zip(*parts, strict=True))
    return exits, sectors, shown


def _march(start: Array, sideways: Array, inside: Array) -> tuple[Array, NDArray[np.int64]]:
    """Walk (N, 2) positions along (N, 2) directions until they leave: (N,) lengths in cells, (N, 2) last cells."""
    direction = sideways / np.maximum(np.linalg.norm(sideways, axis=1, keepdims=True), 1e-9)
    position, length = start.copy(), np.zeros(len(start))
    limit = np.array(inside.shape) - 1
    for _ in range(_MARCH_STEPS):
        cell = np.round(position).astype(int)
        within = (cell >= 0).all(axis=1) & (cell <= limit).all(axis=1)
        clear = np.where(within, inside[tuple(np.clip(cell, 0, limit).T)], 0.0)
        step = np.where(clear > 0, np.maximum(clear - 0.5, 0.5), 0.0)  # as far as no border can be
        if not step.any():
            break
        position += direction * step[:, None]
        length += step
    return length, np.clip(np.round(position).astype(int), 0, limit)
