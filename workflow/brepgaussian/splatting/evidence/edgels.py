"""Edges of one image at sub-pixel accuracy."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_BLUR_PX = 1.0  # standard deviation of the derivative's Gaussian
_BESIDE_PX = 3.0  # past the blur of a step
_STEEPER = 2.0  # a step is steeper than what lies beside it, the shading of a curved face is not


@dataclass(frozen=True)
class Edgels:
    """Edges of an image, and the way to the nearest.

    Attributes:
        points: (E, 2) positions x, y, px; normals: (E, 2) unit, towards the brighter side.
        nearest: (H, W) int32 index of the edge nearest to each pixel.
    """

    points: Array
    normals: Array
    nearest: NDArray[np.int32]

    def lookup(self, pixels: Array) -> NDArray[np.int32]:
        """(N,) index of the edge nearest to (N, 2) positions."""
        height, width = self.nearest.shape
        column = np.clip(np.nan_to_num(pixels[:, 0], nan=0.0), 0, width - 1).astype(int)
        row = np.clip(np.nan_to_num(pixels[:, 1], nan=0.0), 0, height - 1).astype(int)
        return self.nearest[row, column]


def find_edgels(luminance: NDArray[np.float32], alpha: NDArray[np.uint8], least_slope: float) -> Edgels:
    """Crests of the gradient, the silhouette's included.

    Args:
        luminance: (H, W) grey levels, 0..255.
        alpha: (H, W) coverage; what it does not cover is taken as black.
        least_slope: grey levels per px below which there is no edge.
    """
    image = luminance * (alpha.astype(np.float32) / 255)
    blurred = cv2.GaussianBlur(image, (0, 0), _BLUR_PX)
    dx = cv2.Sobel(blurred, cv2.CV_32F, 1, 0, ksize=1, scale=0.5)
    dy = cv2.Sobel(blurred, cv2.CV_32F, 0, 1, ksize=1, scale=0.5)
    slope = np.hypot(dx, dy)
    rows, columns = np.nonzero(slope > least_slope)
    unit = np.column_stack([dx[rows, columns], dy[rows, columns]]) / slope[rows, columns, None]
    before, after = (_at(slope, columns + k * unit[:, 0], rows + k * unit[:, 1]) for k in (-1, 1))
    here = slope[rows, columns]
    beside = [_at(slope, columns + k * unit[:, 0], rows + k * unit[:, 1]) for k in (-_BESIDE_PX, _BESIDE_PX)]
    crest = (here >= before) & (here > after) & (here > _STEEPER * np.minimum(*beside))
    rows, columns, unit = rows[crest], columns[crest], unit[crest]
    before, here, after = before[crest], here[crest], after[crest]
    # vertex of the parabola through three slopes across the edge
    shift = 0.5 * (before - after) / np.minimum(before - 2 * here + after, -1e-6)
    points = np.column_stack([columns, rows]) + 0.5 + np.clip(shift, -0.5, 0.5)[:, None] * unit
    free = np.ones(slope.shape, np.uint8)
    free[rows, columns] = 0
    nearest = np.zeros(slope.shape, np.int32)
    if len(rows):
        _, labels = cv2.distanceTransformWithLabels(free, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL)
        index = np.zeros(labels.max() + 1, np.int32)
        index[labels[rows, columns]] = np.arange(len(rows))
        nearest = index[labels]
    return Edgels(points.astype(np.float64), unit.astype(np.float64), nearest)


_MOST_ROWS = 30_000  # OpenCV's maps end at 32767 rows


def _at(image: NDArray[np.float32], x: Array, y: Array) -> NDArray[np.float32]:
    """(N,) bilinear samples."""
    x, y = x.astype(np.float32), y.astype(np.float32)
    if not len(x):
        return np.zeros(0, np.float32)
    parts = [
        cv2.remap(image, x[k : k + _MOST_ROWS, None], y[k : k + _MOST_ROWS, None], cv2.INTER_LINEAR)
        for k in range(0, len(x), _MOST_ROWS)
    ]
    return np.asarray(np.concatenate(parts)[:, 0], np.float32)
