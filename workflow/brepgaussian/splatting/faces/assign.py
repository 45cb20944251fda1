"""Confirmed faces as evidence for later stages: which surfel lies on which."""

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.concave.prism import over
from brepgaussian.splatting.faces.confirm import Face

_FAR_CELLS = 1.5  # of the hull; a surfel farther from the plane is not on it
_ALIKE = np.cos(np.radians(25.0))  # of a surfel's normal and the face's


def assign(
    faces: list[Face], centers: NDArray[np.floating], normals: NDArray[np.floating], spacing: float
) -> NDArray[np.int32]:
    """(N,) face of each surfel, -1 = none; where two compete, the nearer plane.

    Args:
        faces: the confirmed faces.
        centers, normals: (N, 3) surfels.
        spacing: edge of the hull's voxels.
    """
    result = np.full(len(centers), -1, np.int32)
    nearest = np.full(len(centers), _FAR_CELLS * spacing)
    for k, face in enumerate(faces):
        within, heights = over(face.lattice, face.outline, centers.astype(np.float64))
        mine = within & (np.abs(heights) < nearest) & (normals @ face.lattice.normal > _ALIKE)
        result[mine], nearest[mine] = k, np.abs(heights[mine])
    return result


def planes(faces: list[Face]) -> NDArray[np.float32]:
    """(F, 4) outward normals and offsets, n . x = d."""
    rows = [[*f.lattice.normal, f.lattice.offset] for f in faces]
    return np.array(rows, np.float32).reshape(-1, 4)
