"""Planar faces of a hull, made flat: between its contours a hull bulges away from a face like a tent.

The plane of a face passes where the hull is lowest. All that lies beyond it is removed if the silhouettes are
filled without it.
"""

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.concave.contours import chords_in, loss
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.planes import planar_regions
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume

Array = NDArray[np.float64]

_LEAST_AREA = 0.03  # bulges on smaller faces are low; strips of cylinders are smaller
_MOST_LOST = 0.002  # share of the rays that a half-space touches


def flatten(images: Images, hull: Volume) -> tuple[Volume, list[tuple[Array, float]]]:
    """Cut a hull at the planes of its outer faces.

    Args:
        images: of all views.
        hull: what they leave.

    Returns:
        The hull, and the planes (outward unit normal, offset).
    """
    field, origin, spacing = hull.field, hull.origin, hull.spacing
    vertices, triangles = hull.mesh()
    chords = chords_in(Scene(vertices, triangles), *images.contour_rays)
    cuts: list[tuple[Array, float]] = []
    for region in planar_regions(vertices, triangles, 2 * spacing):
        if region.area(vertices, triangles) < _LEAST_AREA:
            continue
        left = chords.trimmed(region.normal, region.offset)
        if loss(chords, left, region.normal, region.offset) <= _MOST_LOST:
            chords = left
            cuts.append((region.normal, region.offset))
    if not cuts:
        return hull, cuts
    axes = [origin[axis] + spacing * np.arange(field.shape[axis]) for axis in range(3)]
    flat = field.copy()
    for normal, offset in cuts:
        height = (normal[k] * axes[k].reshape([-1 if a == k else 1 for a in range(3)]) for k in range(3))
        np.minimum(flat, (offset - sum(height)).astype(np.float32), out=flat)
    return hull.with_field(flat), cuts
