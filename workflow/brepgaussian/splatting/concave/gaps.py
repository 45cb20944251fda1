"""Gaps between faces of one plane: grooves across it, open at both ends, such as those for oil in a washer.

A groove that ends at a round side has no face at its ends that would show its section, and its floor is hidden from
silhouettes. But the faces beside it lie in one plane, and leave a strip of their convex hull.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.morphology import convex_hull_image

from brepgaussian.splatting.concave.columns import FINER, PARALLEL, Columns
from brepgaussian.splatting.concave.prism import Lattice, Prism, over
from brepgaussian.splatting.concave.sweep import Outlined
from brepgaussian.splatting.concave.volume import Volume

Cells = NDArray[np.bool_]

_LEAST_WIDTH_VOXELS = 3  # of a gap; the border between two faces that a view blurs is no wider
_ABOVE_VOXELS = (1.5, 4.0)  # over a plane, between which nothing stands in a gap
_STANDS = 0.1  # of a gap's cells


def gaps(hull: Volume, face: Outlined, faces: Sequence[Outlined]) -> Iterator[Prism]:
    """What the faces of one plane leave of their convex hull, open to its side: columns through all that lies below.

    Args:
        hull: what they were found on.
        face: one of the plane.
        faces: all that views have confirmed: outlines (R, C) on lattices.
    """
    normal, top = face[0].normal, face[0].offset
    columns = Columns.of(hull, normal)
    shown = _shown(columns, top, [f for f in faces if on_one_plane(f[0], face[0], hull.spacing)])
    if not shown.any():
        return
    whole = np.asarray(convex_hull_image(shown))
    width = ndimage.iterate_structure(ndimage.generate_binary_structure(2, 1), _LEAST_WIDTH_VOXELS * FINER // 2)
    labels, count = ndimage.label(ndimage.binary_opening(whole & ~shown, width))
    beside = ~ndimage.binary_erosion(whole)
    filled = np.kron((columns.field[columns.heights < top] > 0).any(axis=0), np.ones((FINER, FINER), bool))
    for k in range(1, count + 1):
        gap = labels == k
        if not (gap & beside).any() or _is_built_over(columns, gap, top):
            continue
        gap &= filled  # without holes that go through
        solid = columns.heights[(columns.field[:, gap[::FINER, ::FINER]] > 0).any(axis=1)]
        if len(solid):
            yield columns.prism(gap, float(solid.min()), top)


def on_one_plane(first: Lattice, second: Lattice, spacing: float) -> bool:
    """Whether the lattices of two faces lie on one plane and look the same way."""
    return bool(first.normal @ second.normal > PARALLEL and abs(first.offset - second.offset) < spacing)


def _shown(columns: Columns, top: float, faces: Sequence[Outlined]) -> Cells:
    """Cells (R, C) of sections that faces cover."""
    centers = columns.lattice.centers() + top * columns.lattice.normal
    shown = np.zeros(centers.shape[:2], bool)
    for lattice, outline in faces:
        shown |= over(lattice, outline, centers.reshape(-1, 3))[0].reshape(shown.shape)
    return shown


def _is_built_over(columns: Columns, gap: Cells, top: float) -> bool:
    """Whether something stands above a plane where its faces leave a gap: a rib, or a boss."""
    low, high = (top + v * columns.spacing for v in _ABOVE_VOXELS)
    above = columns.field[(columns.heights > low) & (columns.heights < high)]
    cells = gap[::FINER, ::FINER]
    return bool(len(above) and cells.any() and (above.max(axis=0) > 0)[cells].mean() > _STANDS)
