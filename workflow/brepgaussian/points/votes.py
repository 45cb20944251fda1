"""What the patch masks say about points: in which region of which view each one lies."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.geometry.cameras import Cameras

Array = NDArray[np.float64]
GRAZING = 0.17  # cosine between normal and line of sight (80 degrees), below which a pixel says nothing
_CELL_SPACINGS = 1.5  # a cell of the depth buffer holds a point if it is this many point spacings wide
_BLUR = 0.013  # unit frame; so near to an edge surfels are rounded off and their normals turn
_CORE, _RIDGE = 0.4, 0.1  # share of views in which a core point is clear; slack of a ridge between two borders
_UNSEEN, _LEAST_TRUST = 0.5, 0.05  # trust in a point that no view sees, and the least of all
LUMINANCE = np.array([0.299, 0.587, 0.114], np.float32)  # Rec. 601
_DEPTH_CELLS = 3.0  # depth step, in cells, that hides a point


@dataclass(frozen=True)
class Seen:
    """What the views show of N points.

    Attributes:
        regions: (V, N) int16 region ids, 0 = hidden, seen at a grazing angle, or near a border.
        trust: (N,) share of the views that see a point in which no border is near.
        clear: (N,) the same for the narrower border at which regions end.
        grey: (N,) median grey level over the views, NaN = unknown.
    """

    regions: NDArray[np.int16]
    trust: Array
    clear: Array
    grey: Array


def observe(
    views: Views, patches: NDArray[np.int16], xyz: Array, normals: Array, dense: Array, spacing: float, border: float
) -> Seen:
    """Look each point up in each view.

    Args:
        views: V views.
        patches: (V, H, W) region ids, 0 = none.
        xyz, normals: (N, 3) points that ask.
        dense: (M, 3) points that hide others.
        spacing: typical distance between neighbours in `dense`.
        border: px; nearer to the border of a region a point has no region.
    """
    cameras = views.cameras
    found = np.zeros((len(cameras), len(xyz)), np.int16)
    levels = np.full((len(cameras), len(xyz)), np.nan, np.float32)
    views_of, far = np.zeros(len(xyz)), np.zeros(len(xyz))
    centers = cameras.centers
    wide = max(border, _BLUR / cameras.footprint())
    for view in range(len(cameras)):
        sight = centers[view] - xyz
        facing = np.einsum("ij,ij->i", sight, normals) > GRAZING * np.linalg.norm(sight, axis=1)
        asks = np.flatnonzero(facing)
        asks = asks[visible(cameras, view, xyz[asks], dense, spacing)]
        pixels, _ = cameras.project(view, xyz[asks])
        column, row = np.floor(pixels).astype(np.int64).T
        inside = (column >= 0) & (row >= 0) & (column < cameras.width) & (row < cameras.height)
        asks, row, column = asks[inside], row[inside], column[inside]
        found[view, asks] = interior(patches[view], border)[row, column]
        views_of[asks] += 1
        far[asks] += interior(patches[view], wide)[row, column] > 0
        levels[view, asks] = views.rgb[view, row, column] @ LUMINANCE
    levels[found == 0] = np.nan
    shares = [
        np.clip(np.where(views_of > 0, count / np.maximum(views_of, 1), _UNSEEN), _LEAST_TRUST, 1.0)
        for count in (far, (found > 0).sum(0))
    ]
    return Seen(found, shares[0], shares[1], nan_median(levels))


def core(seen: Seen, pairs: NDArray[np.int64], within: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(N,) points that speak for a patch: away from borders, or, in narrow patches, farthest from them.

    Args:
        seen: what the views show.
        pairs: (E, 2) neighbours; within: (E,) pairs of one region.
    """
    highest = seen.trust.copy()
    for one, other in (pairs[within].T, pairs[within].T[::-1]):
        np.maximum.at(highest, one, seen.trust[other])
    ridge = (seen.trust >= highest - _RIDGE) & (seen.clear >= _CORE)
    return (seen.trust >= _CORE) | ridge


def nan_median(levels: NDArray[np.float32]) -> Array:
    """(N,) medians over the first axis of (V, N), NaN where there is nothing."""
    count = np.isfinite(levels).sum(0)
    ordered = np.sort(levels, axis=0)  # NaN last
    columns = np.arange(levels.shape[1])
    low = ordered[np.maximum(count - 1, 0) // 2, columns]
    middle = np.where(count % 2 == 1, low, (low + ordered[np.minimum(count // 2, len(levels) - 1), columns]) / 2)
    return np.where(count > 0, middle, np.nan).astype(np.float64)


def visible(cameras: Cameras, view: int, xyz: Array, dense: Array, spacing: float) -> NDArray[np.bool_]:
    """(N,) whether points are not hidden behind `dense` points, by a coarse depth buffer."""
    pixel = cameras.footprint()
    cell_px = max(1.0, _CELL_SPACINGS * spacing / pixel)
    shape = (int(cameras.height / cell_px) + 1, int(cameras.width / cell_px) + 1)
    buffer = np.full(shape, np.inf, np.float32)
    row, column, depth = _cells(cameras, view, dense, cell_px, shape)
    np.minimum.at(buffer, (row, column), depth.astype(np.float32))
    buffer = np.asarray(
        cv2.erode(buffer, np.ones((3, 3), np.uint8)), np.float32
    )  # the nearest of the neighbouring cells closes gaps
    row, column, depth = _cells(cameras, view, xyz, cell_px, shape)
    return depth <= buffer[row, column] + _DEPTH_CELLS * cell_px * pixel


def _cells(
    cameras: Cameras, view: int, xyz: Array, cell_px: float, shape: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    pixels, depth = cameras.project(view, xyz)
    column, row = np.floor(pixels / cell_px).astype(np.int64).T
    return np.clip(row, 0, shape[0] - 1), np.clip(column, 0, shape[1] - 1), depth


def interior(patches: NDArray[np.int16], border: float) -> NDArray[np.int16]:
    """(H, W) region ids without the pixels nearer than `border` px to another region."""
    reach = max(1, round(border - 0.5))  # from a pixel's centre to the far side of its neighbours
    kernel = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    same = cv2.dilate(patches, kernel) == cv2.erode(patches, kernel)
    return np.where(same, patches, 0).astype(np.int16)


def agreement(found: NDArray[np.int16], pairs: NDArray[np.int64]) -> tuple[Array, Array]:
    """How often two points lie in the same region.

    Args:
        found: (V, N) regions.
        pairs: (E, 2) point indices.

    Returns:
        (E,) number of views in which they share a region, (E,) number of views in which both have one.
    """
    same, both = np.zeros(len(pairs)), np.zeros(len(pairs))
    first, second = np.ascontiguousarray(pairs[:, 0]), np.ascontiguousarray(pairs[:, 1])
    for view in found:
        one, other = view[first], view[second]
        seen = (one > 0) & (other > 0)
        both += seen
        same += seen & (one == other)
    return same, both
