"""Surface that no two views see: nothing is known about it but that silhouettes do not exclude it."""

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.splatting.concave.scene import Scene

Array = NDArray[np.float64]

_LEAST_VIEWS = 2
_LEAST_COSINE = 0.1  # a surface seen flatter shows nothing


def unobserved(views: Views, scene: Scene, points: Array, normals: Array, lift: float) -> NDArray[np.bool_]:
    """(N,) which points of a surface fewer than two views see.

    Args:
        views: cameras; the images do not matter.
        scene: the surface.
        points: (N, 3) on it; normals: (N, 3) unit, outward.
        lift: how far rays start above the surface, its roughness.
    """
    count = np.zeros(len(points), np.int64)
    start = points + lift * normals
    for center in views.cameras.centers:
        ray = center - start
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        facing = np.flatnonzero(np.einsum("ni,ni->n", ray, normals) > _LEAST_COSINE)
        count[facing] += ~scene.occluded(start[facing], ray[facing])
    return count < _LEAST_VIEWS
