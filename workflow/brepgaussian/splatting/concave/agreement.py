"""Whether the images speak for one surface rather than another: on the right one, views agree about its radiance."""

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.radiance import differences
from brepgaussian.splatting.concave.scene import Scene

Array = NDArray[np.float64]

_STRIDE_PX = 4
_OPAQUE = 250  # alpha of a pixel that is surely object
_PLACE_PX = 6.0  # side of a place; within it, radiance changes linearly
_CAP = 3.0  # tolerances; greater differences (another surface is in the way) count no more than this
_NORMAL_BINS = 2.0  # faces that meet at an edge are different places


def disagreements(images: Images, before: Scene, after: Scene, reach: float) -> tuple[float, float, int]:
    """How much views differ on two surfaces, where these differ.

    Args:
        images: of all views.
        before, after: the surfaces; the second lies inside of the first.
        reach: rays on which they differ by less than this are left out.

    Returns:
        Mean difference of a ray from its place, in tolerances, on each of them; and the number of rays whose places
        are met by enough others to tell anything.
    """
    views = images.views
    origins, directions, greys = [], [], []
    for view, alpha in enumerate(views.alpha):
        rows, columns = np.nonzero(alpha[::_STRIDE_PX, ::_STRIDE_PX] > _OPAQUE)
        rows, columns = rows * _STRIDE_PX, columns * _STRIDE_PX
        center, ray = views.cameras.rays(view, np.column_stack([columns + 0.5, rows + 0.5]))
        origins.append(np.broadcast_to(center, ray.shape))
        directions.append(ray)
        greys.append(images.luminance[view, rows, columns])
    origin, direction, grey = np.concatenate(origins), np.concatenate(directions), np.concatenate(greys)
    (first, normal), (second, inner) = before.hits(origin, direction), after.hits(origin, direction)
    met = np.isfinite(first)
    changed = met.copy()
    changed[met] = second[met] - first[met] > reach
    missing = changed & ~np.isfinite(second)
    told = changed & ~missing
    side = _PLACE_PX * views.cameras.footprint()
    costs, telling = [], []
    for distance, facing in ((first, normal), (second, inner)):
        points = origin[told] + distance[told, None] * direction[told]
        cost, count = _differences(points, facing[told], grey[told].astype(float), side, images.tolerance)
        costs.append(cost)
        telling.append(count)
    lost = missing.sum() / max(changed.sum(), 1)
    return costs[0], float((1 - lost) * costs[1] + lost * _CAP), min(telling)


def _differences(
    points: Array, normals: NDArray[np.float32], grey: Array, side: float, tolerance: float
) -> tuple[float, int]:
    """Mean capped difference of rays from a linear fit to all rays of their place, and how many have such a place."""
    if not len(points):
        return 0.0, 0
    place = np.floor(points / side).astype(np.int64)
    facing = np.round(normals * _NORMAL_BINS).astype(np.int64)
    difference, enough = differences(
        np.column_stack([place, facing]), points / side - place - 0.5, grey, tolerance, _CAP
    )
    return (float(difference[enough].mean()) if enough.any() else 0.0), int(enough.sum())
