"""Whether places of a plane look the same from everywhere: radiance is fixed on the surface, if that is the surface."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.geometry.pixels import inner_distance
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.prism import Lattice

Array = NDArray[np.float64]

_INNER_CELLS = 3.0  # from the border, where blur ends
_TOLERANCE = 3.0  # grey levels by which views of a whole face differ at least: more than those of one place
_QUANTILES = (0.1, 0.9)  # over views; a few may be disturbed by other parts' borders
_LEAST_COMPARED = 2  # views of a cell
_CROWD_CELLS, _CROWD_SHARE = 7, 0.5  # window in which most cells differ: there the surface leaves the plane


def evenness(
    images: Images, lattice: Lattice, outline: NDArray[np.bool_], views: list[int], seen: NDArray[np.bool_]
) -> tuple[float, NDArray[np.bool_]]:
    """Share of the inner cells that look alike in all views, and (R, C) where the others crowd.

    Args:
        images: of all views.
        lattice, outline: a face, and (R, C) the cells to look at.
        views: those that show it; seen: (len(views), R * C) which cells each one sees.
    """
    inner = inner_distance(outline) > _INNER_CELLS
    index = np.flatnonzero(inner)
    grey = _grey(images, views, lattice.centers().reshape(-1, 3)[index], seen[:, index])
    told = np.isfinite(grey).sum(axis=0) >= _LEAST_COMPARED
    different = np.zeros(outline.shape, bool)
    if not told.any():
        return 1.0, different
    low, high = _quantiles(grey[:, told])
    alike = high - low <= max(_TOLERANCE, images.tolerance)
    different.ravel()[index[told]] = ~alike
    crowded = ndimage.uniform_filter(different.astype(np.float32), _CROWD_CELLS) > _CROWD_SHARE
    return float(alike.mean()), np.asarray(crowded)


def _quantiles(grey: Array) -> Array:
    """(2, N) quantiles over the views (V, N) that are not NaN: numpy's, but all places at once."""
    ordered = np.sort(grey, axis=0)  # NaN last
    place = np.array(_QUANTILES)[:, None] * (np.isfinite(grey).sum(axis=0) - 1)  # (2, N)
    below = np.floor(place).astype(int)
    low = np.take_along_axis(ordered, below, axis=0)
    high = np.take_along_axis(ordered, np.ceil(place).astype(int), axis=0)
    return np.asarray(low + (place - below) * (high - low))


def _grey(images: Images, chosen: list[int], cells: Array, seen: NDArray[np.bool_]) -> Array:
    """(V, N) grey levels of cells, NaN where a view does not see them."""
    result = np.full(seen.shape, np.nan)
    for row, view in enumerate(chosen):
        index = np.flatnonzero(seen[row])
        pixels = images.views.cameras.project(view, cells[index])[0]
        at = [pixels[:, 1] - 0.5, pixels[:, 0] - 0.5]
        result[row, index] = ndimage.map_coordinates(images.luminance[view], at, order=1, output=np.float64)
    return result
