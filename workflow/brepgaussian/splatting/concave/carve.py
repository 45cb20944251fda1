"""Open the concavities of a hull's field, level by level (a counterbore's bore lies under its first floor)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.concave.find import find_curved, find_prisms
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.sweep import straighten, subtract
from brepgaussian.splatting.concave.trim import flatten
from brepgaussian.splatting.concave.turned import turn

_LEVELS = 3
_MARGIN_CELLS = 2.0  # a concavity is cut this far out of its opening, so that no skin of the lid remains

Mesher = Callable[[NDArray[np.float32]], tuple[NDArray[np.float64], NDArray[np.int64]]]


def open_channels(
    images: Images,
    field: NDArray[np.float32],
    origin: NDArray[np.float64],
    spacing: float,
    mesher: Mesher,
) -> tuple[NDArray[np.float32], list[Prism]]:
    """Cut a hull at its outer planes, and carry on all along what it leaves empty at one end or at one angle.

    Arguments and results are those of `open_concavities`.
    """
    field, _ = flatten(images.views, field, origin, spacing, mesher)
    field, channels = straighten(images, field, origin, spacing, mesher)
    return turn(images, field, origin, spacing, mesher), channels


def open_concavities(
    images: Images,
    field: NDArray[np.float32],
    origin: NDArray[np.float64],
    spacing: float,
    mesher: Mesher,
) -> tuple[NDArray[np.float32], list[Prism]]:
    """Carve pockets and holes that views show to be open although every silhouette is blind to them.

    Args:
        images: of all views.
        field: (n, n, n) signed distance to the hull, inside positive.
        origin: (3,) position of field[0, 0, 0]; spacing: edge of a voxel.
        mesher: turns a field into vertices (K, 3) and triangles (T, 3), counter-clockwise from outside.

    Returns:
        The opened field and the concavities.
    """
    known: list[Prism] = []
    scene = Scene(*mesher(field))
    for _ in range(_LEVELS):
        found = find_prisms(images, scene, spacing, known)
        if not found:
            break
        for prism in found:
            field = subtract(field, origin, spacing, prism, _MARGIN_CELLS * spacing)
        known += found
        scene = Scene(*mesher(field))
    for prism in find_curved(images, scene, spacing, known):
        field = subtract(field, origin, spacing, prism, _MARGIN_CELLS * spacing)
        known.append(prism)
    return field, known
