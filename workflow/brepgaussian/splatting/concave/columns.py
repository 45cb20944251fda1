"""Columns of a hull along a direction: empty somewhere, or at both ends, between two faces across it, else full."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.splatting.concave.planes import Plane
from brepgaussian.splatting.concave.prism import Lattice, Prism, plane_axes
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.sample import sample

Array = NDArray[np.float64]
Field = NDArray[np.float32]

PARALLEL = 0.998  # cosine of 3.6 degrees
FINER = 2  # cells of a section for each voxel
BESIDE_VOXELS = 3  # so far from what is surely empty a section is as wide as its rim shows it
_END_VOXELS = 3.0  # at a channel's ends the hull is rounded
_RIM_VOXELS = 1.0  # the same at an end that shows the section: past it the hull rises as steeply as cameras look down
_AT_END_VOXELS = 2  # there a channel shows its section; what crosses it in the middle is none of it
_NECK_VOXELS = 2  # wide, what joins two regions at least
_LEAST_CELLS = 12  # of a section's region that changes
LEAST_PART_VOXELS = 60  # of one of several channels
_BY_STEP_VOXELS = 2.0  # above and below a face a hull differs, though it may be off by a voxel
_STEPPED = 0.2  # of a hole's section, in cells that a face beside it fills or empties: a bore that is wider by a tenth


@dataclass(frozen=True)
class Cut:
    """Columns to empty.

    Attributes:
        prisms: of one direction; their outlines are lateral, without margins.
        volume: in voxels.
        at_ends: whether both ends of each column are empty; else it is empty somewhere.
        in_hole: whether it widens a hole that goes through from face to face.
        necked: whether regions of its section are joined by necks alone; they are cuts of their own, too.
    """

    prisms: tuple[Prism, ...]
    volume: float
    at_ends: bool
    in_hole: bool = False
    necked: bool = False


@dataclass(frozen=True)
class Columns:
    """A hull's field along a direction.

    Attributes:
        lattice: of sections, finer by `FINER`, at height 0.
        heights: (K,) along the direction; field: (K, R, C) at them.
        spacing: of voxels.
    """

    lattice: Lattice
    heights: Array
    field: Field
    spacing: float

    @classmethod
    def of(cls, hull: Volume, normal: Array) -> "Columns":
        """Those along a unit normal (3,)."""
        origin, spacing = hull.origin, hull.spacing
        first, second = plane_axes(normal)
        corners = origin + spacing * (np.array(np.meshgrid(*[[0, n - 1] for n in hull.field.shape])).reshape(3, -1).T)
        corners = corners @ np.stack([first, second, normal]).T
        low, high = corners.min(axis=0), corners.max(axis=0)
        u, v, w = (np.arange(low[k], high[k], spacing) for k in range(3))
        base = u[:, None, None] * first + v[None, :, None] * second
        columns = np.empty((len(w), len(u), len(v)), np.float32)
        for k, height in enumerate(w):
            index = ((base + height * normal - origin) / spacing).reshape(-1, 3)
            columns[k] = sample(hull.field, index, -spacing).reshape(len(u), len(v))
        start = (u[0] - spacing / 2) * first + (v[0] - spacing / 2) * second
        lattice = Lattice(start, first, second, normal, spacing / FINER, (FINER * len(u), FINER * len(v)))
        return cls(lattice, w, columns, spacing)

    def between(self, bottom: float, top: float, margin: float) -> Field:
        """(k, R, C) field more than some voxels above one height and below another."""
        w, margin = self.heights, margin * self.spacing
        return self.field[(w > bottom + margin) & (w < top - margin)]

    def prism(self, outline: NDArray[np.bool_], bottom: float, top: float) -> Prism:
        """What lies between two heights within an outline."""
        lattice = replace(self.lattice, origin=self.lattice.origin + top * self.lattice.normal)
        return Prism(lattice, outline, top - bottom, False, 0.0)

    def stepped(self, outline: NDArray[np.bool_], height: float) -> bool:
        """Whether within an outline, or close around it, a hull begins or ends at a height."""
        below, above = (
            self.field[np.abs(self.heights - height - side * _BY_STEP_VOXELS * self.spacing).argmin()] > 0
            for side in (-1, 1)
        )
        cells = outline[::FINER, ::FINER]
        near = ndimage.binary_dilation(cells, iterations=BESIDE_VOXELS)
        return int((near & (below != above)).sum()) > _STEPPED * int(cells.sum())


def cuts(hull: Volume, normal: Array, faces: Sequence[Plane]) -> list[Cut]:
    """Columns that are empty somewhere between two neighbouring faces across a direction, and full elsewhere."""
    columns = Columns.of(hull, normal)
    return [
        cut
        for bottom, top, crossed in _spans(normal, faces, hull.spacing)
        for cut in _between(columns, bottom, top, crossed, wholes=True)
    ]


def holes(hull: Volume, normal: Array, faces: Sequence[Plane]) -> list[Cut]:
    """Holes as wide all along as they are somewhere between two faces across a direction; longest first.

    Between those two only faces lie that are not beside the hole: the hull neither begins nor ends there.
    """
    columns = Columns.of(hull, normal)
    steps = _steps(normal, faces, hull.spacing)
    found = []
    for i, j in combinations(range(len(steps)), 2):
        for cut in _between(columns, steps[i], steps[j], False):
            (prism,) = cut.prisms
            if cut.in_hole and not any(columns.stepped(prism.outline, height) for height in steps[i + 1 : j]):
                found.append(cut)
    return sorted(found, key=lambda cut: -cut.prisms[0].depth)


def _between(columns: Columns, bottom: float, top: float, crossed: bool, wholes: bool = False) -> list[Cut]:
    """Columns between two heights that are empty at both ends and, if nothing crosses them, somewhere.

    Of the latter also `wholes`, whatever necks join.
    """
    inner = columns.between(bottom, top, _END_VOXELS)
    if not len(inner):
        return []
    outer = columns.between(bottom, top, _RIM_VOXELS)
    anywhere = inner.min(axis=0)
    sections = [(_at_ends(inner), _at_ends(outer), True)]
    if not crossed:
        sections.insert(0, (anywhere, anywhere, False))
    return [
        Cut((columns.prism(outline, bottom, top),), volume, open_ended, in_hole and not crossed, necked)
        for least, widest, open_ended in sections
        for outline, volume, in_hole, necked in _sections(
            least, widest, inner, columns.spacing, wholes and not open_ended
        )
    ]


def _at_ends(columns: Field) -> Field:
    """(R, C) negative where columns (K, R, C) are empty at both ends."""
    return np.maximum(columns[:_AT_END_VOXELS].min(axis=0), columns[-_AT_END_VOXELS:].min(axis=0))


def _sections(
    least: Field, widest: Field, columns: Field, spacing: float, wholes: bool
) -> list[tuple[NDArray[np.bool_], float, bool, bool]]:
    """Outlines (finer by `FINER`) of regions of columns (K, R, C) that are full somewhere, volumes in voxels, and
    whether each is beside a hole, and is joined by necks.

    Args:
        least: (R, C) negative where a column counts as empty; widest: the same, for those beside such a region.
        columns, spacing: the hull's; wholes: whether what necks join is a region, too.
    """
    volume = (columns > 0).sum(axis=0)
    most = columns.max(axis=0)
    hole = ndimage.binary_fill_holes(most > 0) & (most <= 0)
    empty = (least < 0) & (most > 0)
    parts = _parts(empty)
    regions = [(parts, k, False) for k in range(1, int(parts.max(initial=0)) + 1)]
    if wholes:
        joined, count = ndimage.label(empty)
        several = (np.unique(parts[(joined == k) & (parts > 0)]) for k in range(1, count + 1))
        regions += [(joined, k, True) for k, inside in enumerate(several, start=1) if len(inside) > 1]
    found = []
    for labels, k, necked in regions:
        member = labels == k
        if member.sum() < _LEAST_CELLS or volume[member].sum() < LEAST_PART_VOXELS:
            continue
        beside = ndimage.binary_dilation(member, iterations=BESIDE_VOXELS)
        section = member | beside & (widest < 0) & ((most <= 0) | (labels == 0))
        fine = ndimage.zoom(np.where(section | (widest >= 0), widest, spacing), FINER, order=1, grid_mode=True,
                            mode="nearest")  # fmt: skip
        near = ndimage.binary_dilation(np.kron(section, np.ones((FINER, FINER), bool)), iterations=FINER)
        outline = (fine < 0) & near
        if outline.any():
            in_hole = bool((hole & ndimage.binary_dilation(member)).any())
            found.append((outline, float(volume[member].sum()), in_hole, necked))
    return found


def _parts(empty: NDArray[np.bool_]) -> NDArray[np.integer]:
    """(R, C) numbers from 1 of the regions of empty columns; necks of one voxel join none.

    A hole across a tube's wall, of which silhouettes see little, would join what lies outside of it to its bore.
    """
    labels, _ = ndimage.label(ndimage.binary_opening(empty, np.ones((_NECK_VOXELS, _NECK_VOXELS))))
    beside = ndimage.grey_dilation(labels, (_NECK_VOXELS + 1, _NECK_VOXELS + 1))
    return np.where(empty & (labels == 0), beside, labels)


def _spans(normal: Array, faces: Sequence[Plane], spacing: float) -> list[tuple[float, float, bool]]:
    """Where channels along a direction may begin and end, and whether other faces lie between.

    A slot across a channel has two faces that end it there; past it the channel goes on, to a face that looks the
    other way than the first.
    """
    steps = _steps(normal, faces, spacing)
    spans = [(bottom, top, False) for bottom, top in pairwise(steps)]
    down, up = (_steps(normal, [f for f in faces if side * (f.normal @ normal) > 0], spacing) for side in (-1, 1))

    def near(height: float, ends: list[float]) -> bool:
        return any(abs(height - end) <= 2 * _END_VOXELS * spacing for end in ends)

    def between(ends: list[float], bottom: float, top: float) -> bool:
        return any(bottom < end < top and not near(end, [bottom, top]) for end in ends)

    long = [(steps[i], steps[j]) for i, j in combinations(range(len(steps)), 2) if j - i > 1]
    return spans + [
        (bottom, top, True)
        for bottom, top in long
        if near(bottom, down) and near(top, up) and between(down, bottom, top) and between(up, bottom, top)
    ]


def _steps(normal: Array, faces: Sequence[Plane], spacing: float) -> list[float]:
    """Heights of the faces across a direction, ascending."""
    heights = sorted(float(np.sign(f.normal @ normal) * f.offset) for f in faces if abs(f.normal @ normal) > PARALLEL)
    kept: list[float] = []
    for height in heights:
        if not kept or height - kept[-1] > 2 * _END_VOXELS * spacing:
            kept.append(height)
    return kept
