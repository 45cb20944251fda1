"""Planar faces of a hull, made flat: between its contours a hull bulges away from a face like a tent.

The plane of a face passes where the hull is lowest. All that lies beyond it is removed if the silhouettes are
filled without it.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.splatting.concave.contours import chords_in, contour_rays, loss
from brepgaussian.splatting.concave.planes import planar_regions
from brepgaussian.splatting.concave.scene import Scene

Array = NDArray[np.float64]
Mesher = Callable[[NDArray[np.float32]], tuple[Array, NDArray[np.int64]]]

_LEAST_AREA = 0.03  # bulges on smaller faces are low; strips of cylinders are smaller
_MOST_LOST = 0.002  # share of the rays that a half-space touches


def flatten(
    views: Views, field: NDArray[np.float32], origin: Array, spacing: float, mesher: Mesher
) -> tuple[NDArray[np.float32], list[tuple[Array, float]]]:
    """Cut a hull at the planes of its outer faces.

    Args:
        views: silhouettes and cameras.
        field: (n, n, n) signed distance to the hull, inside positive.
        origin: (3,) position of field[0, 0, 0]; spacing: edge of a voxel.
        mesher: turns a field into vertices (K, 3) and triangles (T, 3).

    Returns:
        The field, and the planes (outward unit normal, offset).
    """
    vertices, triangles = mesher(field)
    chords = chords_in(Scene(vertices, triangles), *contour_rays(views))
    cuts: list[tuple[Array, float]] = []
    for region in planar_regions(vertices, triangles, 2 * spacing):
        if region.area(vertices, triangles) < _LEAST_AREA:
            continue
        left = chords.trimmed(region.normal, region.offset)
        if loss(chords, left, region.normal, region.offset) <= _MOST_LOST:
            chords = left
            cuts.append((region.normal, region.offset))
    if not cuts:
        return field, cuts
    axes = [origin[axis] + spacing * np.arange(field.shape[axis]) for axis in range(3)]
    flat = field.copy()
    for normal, offset in cuts:
        height = (normal[k] * axes[k].reshape([-1 if a == k else 1 for a in range(3)]) for k in range(3))
        np.minimum(flat, (offset - sum(height)).astype(np.float32), out=flat)
    return flat, cuts
