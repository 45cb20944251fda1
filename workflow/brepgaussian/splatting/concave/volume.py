"""A solid as a field on a grid: what the hull is carved out of."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.sample import sample

Array = NDArray[np.float64]
Field = NDArray[np.float32]

MARGIN_CELLS = 2.0  # a concavity is cut this far out of its opening, so that no skin of the lid remains
_MARGIN_VOXELS = 4.0  # around a prism in which the field follows it


@dataclass(frozen=True)
class Volume:
    """A solid.

    Attributes:
        field: (n, n, n) signed distance to its surface, inside positive.
        origin: (3,) position of field[0, 0, 0], unit frame.
        spacing: edge of a voxel, unit frame.
    """

    field: Field
    origin: Array
    spacing: float

    @cached_property
    def box(self) -> Array:
        """(8, 3) corners of the box around it."""
        inside = self.field > 0
        spans = []
        for axis in range(3):
            used = np.flatnonzero(inside.any(axis=tuple(k for k in range(3) if k != axis)))
            spans.append(self.origin[axis] + self.spacing * np.array([used[0] - 1, used[-1] + 1]))
        return np.asarray(np.array(np.meshgrid(*spans)).reshape(3, -1).T)

    def mesh(self) -> tuple[Array, NDArray[np.int64]]:
        """Vertices (K, 3) and triangles (T, 3) of its surface, counter-clockwise seen from outside; not to be changed:
        they are kept, since one hull is asked about many cuts.
        """
        return self._mesh

    @cached_property
    def _mesh(self) -> tuple[Array, NDArray[np.int64]]:
        from skimage.measure import marching_cubes

        vertices, triangles, _, _ = marching_cubes(
            self.field, 0.0, gradient_direction="ascent", mask=_crossed(self.field)
        )
        return self.origin + self.spacing * vertices.astype(np.float64), triangles.astype(np.int64)

    def scene(self, rims: Sequence[Prism] = ()) -> Scene:
        """Its surface, to cast rays at, with the concavities that are cut into it."""
        return Scene(*self.mesh(), rims)

    def inside(self, points: Array) -> NDArray[np.bool_]:
        """(N,) whether points (N, 3) lie inside of it."""
        return np.asarray(sample(self.field, (points - self.origin) / self.spacing, -self.spacing) > 0)

    def with_field(self, field: Field) -> "Volume":
        """Another solid on the same grid."""
        return replace(self, field=field)

    def without(self, prism: Prism, margin: float) -> "Volume":
        """What is left of it outside of a prism that is longer by `margin`; beyond a few voxels nothing changes."""
        reach = max(_MARGIN_VOXELS * self.spacing, 2 * prism.lattice.pitch)
        return self.carved(ends_of(prism, margin), reach, lambda points: prism.signed_distance(points, margin))

    def lost_in(self, left: "Volume") -> int:
        """How many of its voxels another solid on the same grid has no more."""
        return int(np.count_nonzero((self.field > 0) & (left.field <= 0)))

    def filled(self, prism: Prism, margin: float, full: "Volume") -> "Volume":
        """It with all that another one of the same grid has within a prism that is longer by `margin`."""
        part, points = self._box(ends_of(prism, margin), 0.0)
        field = self.field.copy()
        within = -prism.signed_distance(points, margin).reshape(field[part].shape)
        field[part] = np.maximum(field[part], np.minimum(full.field[part], within))
        return self.with_field(field)

    def margin(self, prism: Prism) -> float:
        """By which a concavity in it is cut longer, unit frame."""
        return MARGIN_CELLS * self.spacing + prism.above

    def carved(self, extent: Array, reach: float, outside: Callable[[Array], Array]) -> "Volume":
        """What is left of it outside of a solid.

        Args:
            extent: (N, 3) places between which the solid lies.
            reach: how far around them the field follows it, unit frame; farther off nothing changes.
            outside: signed distances of (M, 3) places from the solid, negative within.
        """
        opened = self.field.copy()
        part, points = self._box(extent, reach)
        opened[part] = np.minimum(opened[part], outside(points).reshape(opened[part].shape))
        return self.with_field(opened)

    def _box(self, extent: Array, reach: float) -> tuple[tuple[slice, ...], Array]:
        """The part of the grid around some places (N, 3), and the positions (M, 3) of its nodes."""
        origin, spacing = self.origin, self.spacing
        low = np.clip(np.floor((extent.min(axis=0) - reach - origin) / spacing).astype(int), 0, None)
        shape = self.field.shape
        high = np.minimum(np.ceil((extent.max(axis=0) + reach - origin) / spacing).astype(int) + 1, shape)
        part = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
        steps = [origin[k] + spacing * np.arange(low[k], high[k]) for k in range(3)]
        return part, np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)


def _crossed(field: Field) -> NDArray[np.bool_]:
    """(n, n, n) cells that the surface crosses, named by their last corners: marching cubes need visit no others."""
    some = field > 0
    every = some.copy()
    for axis in range(3):
        first, last = ([slice(None)] * axis + [part] for part in (slice(None, -1), slice(1, None)))
        some, every = some[tuple(first)] | some[tuple(last)], every[tuple(first)] & every[tuple(last)]
    crossed = np.zeros(field.shape, bool)
    crossed[1:, 1:, 1:] = some & ~every
    return crossed


def ends_of(prism: Prism, margin: float) -> Array:
    """(N, 3) the cells of a prism's outline at both its ends."""
    lattice = prism.lattice
    cells = lattice.centers()[prism.outline]
    ends = []
    for height in (margin, -prism.depth - (margin if prism.through else 0.0)):
        drift = -height * np.asarray(prism.tilt)
        ends.append(cells + height * lattice.normal + drift[0] * lattice.first + drift[1] * lattice.second)
    return np.concatenate(ends)
