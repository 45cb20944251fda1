"""What a hull leaves standing over the holes of a planar face.

The region of a face ends at its holes, so the cut down to its plane leaves columns over them. Silhouettes clear most
of a hole through the part, but where a wall stands beside it, what is left hides a part of its rim from all views.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.log import get_logger
from brepgaussian.splatting.concave.prism import Prism, over
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.faces.confirm import Face

Array = NDArray[np.float64]
Needed = Callable[[Array, Scene], NDArray[np.bool_]]

_ABOVE_VOXELS = 1.5  # the plane, to stand over a hole
_MOST_STANDING = 0.5  # of a hole; a boss stands on all of its own
_LEAST_CELLS = 12  # of a hole, and of what stands over it
_SLACK_VOXELS = 2.0  # higher than the highest bulge over the face

logger = get_logger("stage1")


def clear_holes(hull: Volume, faces: Sequence[Face], needed: Needed, most: float) -> Volume:
    """The hull without what stands over a part of a face's hole only, unless silhouettes show it.

    Args:
        hull: cut down to the faces.
        faces: confirmed ones.
        needed: (N,) which of some points (N, 3) silhouettes show, although a scene without them hides them not.
        most: share of needed points with which a column is left alone.
    """
    if not any(_holes(face.outline) for face in faces):
        return hull
    scene = hull.scene()
    for face in faces:
        for hole in _holes(face.outline):
            height = face.bulge + _SLACK_VOXELS * hull.spacing
            over_hole = standing(scene, face, hole, _ABOVE_VOXELS * hull.spacing)
            if not _LEAST_CELLS <= over_hole.sum() <= _MOST_STANDING * hole.sum():
                continue
            if standing(scene, face, hole, height).sum() >= _LEAST_CELLS:
                continue  # no remains of a bulge, but a hub: what is left of it above would hide what silhouettes show
            within, heights = over(face.lattice, hole, scene.vertices)
            samples = scene.vertices[within & (heights > _ABOVE_VOXELS * hull.spacing) & (heights < height)]
            cleared = hull.without(Prism(face.lattice, hole, 0.0, False, 0.0), height)
            after = cleared.scene()
            if len(samples) and needed(samples, after).mean() <= most:
                logger.info("over a hole in a planar face: %.0f %% of it cleared", 100 * over_hole.sum() / hole.sum())
                hull, scene = cleared, after
    return hull


def _holes(outline: NDArray[np.bool_]) -> list[NDArray[np.bool_]]:
    """(R, C) the regions that an outline encloses."""
    labels, count = ndimage.label(ndimage.binary_fill_holes(outline) & ~outline)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    return [labels == k for k in range(1, count + 1) if sizes[k] >= _LEAST_CELLS]


def standing(solid: Scene | Volume, face: Face, cells: NDArray[np.bool_], height: float) -> NDArray[np.bool_]:
    """(C,) over which cells (R, C) of a face's lattice a hull reaches that high above the plane."""
    return solid.inside(face.lattice.centers()[cells] + height * face.lattice.normal)
