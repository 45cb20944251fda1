"""Open the concavities of a hull's field, level by level (a counterbore's bore lies under its first floor)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.splatting.concave.find import find_prisms
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.trim import flatten

_LEVELS = 3
_MARGIN_CELLS = 2.0  # a concavity is cut this far out of its opening, so that no skin of the lid remains

Mesher = Callable[[NDArray[np.float32]], tuple[NDArray[np.float64], NDArray[np.int64]]]


def open_concavities(
    views: Views,
    field: NDArray[np.float32],
    origin: NDArray[np.float64],
    spacing: float,
    mesher: Mesher,
    noise: float = 0.0,
) -> tuple[NDArray[np.float32], list[Prism]]:
    """Carve what views show to be open although every silhouette is blind to it.

    Args:
        views: images and cameras.
        field: (n, n, n) signed distance to the hull, inside positive.
        origin: (3,) position of field[0, 0, 0]; spacing: edge of a voxel.
        mesher: turns a field into vertices (K, 3) and triangles (T, 3), counter-clockwise from outside.
        noise: standard deviation of the images' noise, grey levels.

    Returns:
        The opened field and the concavities.
    """
    field, _ = flatten(views, field, origin, spacing, mesher)
    known: list[Prism] = []
    luminance = views.luminance
    for _ in range(_LEVELS):
        vertices, triangles = mesher(field)
        found = find_prisms(views, luminance, vertices, triangles, spacing, noise, known)
        if not found:
            break
        for prism in found:
            field = _subtract(field, origin, spacing, prism)
        known += found
    return field, known


def _subtract(
    field: NDArray[np.float32], origin: NDArray[np.float64], spacing: float, prism: Prism
) -> NDArray[np.float32]:
    """The field without the prism, slab by slab to save memory."""
    opened = np.empty_like(field)
    steps = [origin[axis] + spacing * np.arange(field.shape[axis]) for axis in range(3)]
    plane = np.stack(np.meshgrid(steps[1], steps[2], indexing="ij"), axis=-1).reshape(-1, 2)
    for row, x in enumerate(steps[0]):
        points = np.column_stack([np.full(len(plane), x), plane])
        outside = prism.signed_distance(points, _MARGIN_CELLS * spacing).reshape(field.shape[1:])
        opened[row] = np.minimum(field[row], outside)
    return opened
