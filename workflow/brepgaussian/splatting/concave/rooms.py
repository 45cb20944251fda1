"""The room in a corner, under a lid that a hull has there: between two floors and two ends, or over three floors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.concave.openings import Stack
from brepgaussian.splatting.concave.radiance import disagreement
from brepgaussian.splatting.concave.rays import Rays
from brepgaussian.splatting.concave.shapes import SURE, Costs, advantage, on_lid, place_side, summary, units_of
from brepgaussian.splatting.concave.volume import Volume

Array = NDArray[np.float64]

_MOST_PLACE_CELLS = 7.5  # side of a place, where few rays need large ones
_STEP, _FINEST = 4.0, 0.25  # cells by which planes are moved
_NEARER = np.arange(0, 1, 0.125)  # of the way that an end was moved


@dataclass(frozen=True)
class Corner:
    """The room under a lid where normals @ x > offsets.

    Attributes:
        lid: its plane's outward unit normal (3,) and offset.
        normals: (K, 3) unit: of two floors and two ends, or of three floors; offsets: (K,).
    """

    lid: tuple[Array, float]
    normals: Array
    offsets: Array

    @property
    def floors(self) -> int:
        """How many of the planes are floors; the others, which follow, are ends."""
        return 3 if len(self.normals) == 3 else 2

    def exits(self, stack: Stack, rays: Rays) -> Array:
        """(N,) depths in cells at which rays meet a floor or an end, -1 for those that enter beside it."""
        lattice = stack.lattice
        axes = np.stack([lattice.first, lattice.second])
        at = self.normals @ lattice.origin - self.offsets  # (K,)
        at = at + (rays.start + 0.5) * lattice.pitch @ (axes @ self.normals.T)  # (N, K) above each plane
        slope = lattice.pitch * (rays.sideways @ (axes @ self.normals.T) - self.normals @ lattice.normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = np.where(slope < 0, -at / slope, np.inf).min(axis=1)
        return np.where((at > 0).all(axis=1), depth, -1.0)

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """(N,) whether points (N, 3) lie over its floors and between its ends."""
        return np.asarray((points @ self.normals.T > self.offsets).all(axis=1))

    def cut_out(self, hull: Volume, margin: float) -> Volume:
        """A hull without it; it reaches above its lid by `margin`."""
        grid = np.meshgrid(*(hull.origin[k] + hull.spacing * np.arange(n) for k, n in enumerate(hull.field.shape)),
                           indexing="ij", sparse=True)  # fmt: skip
        normal, offset = self.lid
        outside = sum(n * g for n, g in zip(normal, grid, strict=True)) - offset - margin
        for normal, offset in zip(self.normals, self.offsets, strict=True):
            outside = np.maximum(outside, offset - sum(n * g for n, g in zip(normal, grid, strict=True)))
        return hull.with_field(np.minimum(hull.field, outside.astype(np.float32)))


class Sought:
    """The rays through one opening, and what they cost."""

    def __init__(self, stack: Stack, rays: Rays, every: int, tolerance: float) -> None:
        self.stack, self.rays, self.tolerance = stack, rays, tolerance
        self.side = place_side(every, len(rays), _MOST_PLACE_CELLS)

    def costs(self, corner: Corner) -> Costs:
        """Of the rays, were that corner open."""
        exits = corner.exits(self.stack, self.rays)
        return disagreement(self.rays, exits, np.inf, self.tolerance, side=self.side)

    def closed(self) -> Costs:
        """Of the rays on the lid."""
        return on_lid(self.rays, self.tolerance, self.side)

    def refined(self, corner: Corner) -> Corner:
        """The corner with its planes moved to where views agree best, in ever smaller steps."""
        step = _STEP
        best, cost = corner, summary(*self.costs(corner))[0]
        while step >= _FINEST:
            before = cost
            for k in range(len(corner.offsets)):
                for move in (step, -step):
                    offsets = best.offsets.copy()
                    offsets[k] += move * self.stack.lattice.pitch
                    moved = Corner(best.lid, best.normals, offsets)
                    value = summary(*self.costs(moved))[0]
                    if value < cost:
                        best, cost = moved, value
            step = step / 2 if cost == before else step
        return best

    def shortened(self, corner: Corner, first: Corner) -> Corner:
        """The corner with each end as near to where it was at first as explains the rays about as well.

        Behind an end few rays tell anything, and a little beyond it is the wall of something else.
        """
        for k in range(corner.floors, len(corner.offsets)):
            costs = self.costs(corner)
            for share in _NEARER:
                offsets = corner.offsets.copy()
                offsets[k] = first.offsets[k] + share * (corner.offsets[k] - first.offsets[k])
                nearer = Corner(corner.lid, corner.normals, offsets)
                if offsets[k] > corner.offsets[k] and advantage(units_of(self.rays), self.costs(nearer), costs) <= SURE:
                    corner = nearer
                    break
        return corner
