"""What one image says about luminance steps: silhouette, noise, half-disk step strength."""

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

DIRECTIONS = 8  # orientations of the line that divides the disk, over 180 degrees
OPAQUE = 128  # alpha from which a pixel centre counts as covered
_MARGIN = 4  # px kept around the silhouette, so that its border has an outside
_MIN_SHARE = 0.35  # a half-disk needs this share of its pixels on the object
_QUANTISATION = 12**-0.5  # standard deviation of rounding to whole grey levels
_MAD_TO_SIGMA = 1.4826
_QUARTILE, _QUARTILE_OF_NORMAL = 0.75, 1.1503  # of |x| for a standard normal x
_COARSE_PX = 3  # of a JPEG's 8 x 8 patterns, the finest that quality 85 and below keeps of noise of two grey levels
_SHADING_AT_COARSE = 0.5  # grey levels: what curved faces without noise answer at that spacing
_RINGING_PX = (2.0, 8.0)  # depths inside the silhouette where JPEG's blocks of 8 x 8 ring


@dataclass(frozen=True)
class Crop:
    """The part of a view that shows the object.

    Attributes:
        box: the crop's rows and columns in the full image.
        grey: (h, w) float32 luminance, 0..255; off the object the value of the nearest object pixel.
        inside: (h, w) bool silhouette.
        noise: standard deviation of the image noise, grey levels.
    """

    box: tuple[slice, slice]
    grey: NDArray[np.float32]
    inside: NDArray[np.bool_]
    noise: float

    def paste(self, values: NDArray, shape: tuple[int, int]) -> NDArray:
        """Put a cropped array back into a full image of zeros."""
        full = np.zeros(shape, values.dtype)
        full[self.box] = values
        return full


def crop(luminance: NDArray[np.float32], alpha: NDArray[np.uint8]) -> Crop | None:
    """Cut one view to its silhouette; None if the object is not in it.

    Args:
        luminance: (H, W) grey levels 0..255, straight (not premultiplied).
        alpha: (H, W) silhouette.
    """
    inside = alpha >= OPAQUE
    if not inside.any():
        return None
    rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
    box = (
        slice(max(rows[0] - _MARGIN, 0), rows[-1] + 1 + _MARGIN),
        slice(max(columns[0] - _MARGIN, 0), columns[-1] + 1 + _MARGIN),
    )
    inside = np.ascontiguousarray(inside[box])
    grey = fill_outside(np.ascontiguousarray(luminance[box], np.float32), inside)
    return Crop(box, grey, inside, estimate_noise(grey, inside))


def fill_outside(grey: NDArray[np.float32], inside: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Replace pixels off the object by the nearest object pixel (renderers leave garbage there)."""
    _, labels = cv2.distanceTransformWithLabels(
        (~inside).astype(np.uint8), cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL
    )
    nearest = np.zeros(labels.max() + 1, np.float32)
    nearest[labels[inside]] = grey[inside]
    return np.where(inside, grey, nearest[labels])


def estimate_noise(grey: NDArray[np.float32], inside: NDArray[np.bool_]) -> float:
    """Standard deviation of the image noise in grey levels, from the silhouette's interior.

    The median response to a mask that cancels planes of luminance and their products (Immerkaer, 1996), so edges and
    shading hardly count. Once between neighbours, and once between pixels further apart, for compression (JPEG) leaves
    noise to coarse patterns alone. At least the noise of rounding to whole levels.
    """
    fine, coarse = _typical_response(grey, inside, 1), _typical_response(grey, inside, _COARSE_PX)
    coarse = max(coarse**2 - _SHADING_AT_COARSE**2, 0.0) ** 0.5
    return max(fine, coarse, _QUANTISATION)


def _typical_response(grey: NDArray[np.float32], inside: NDArray[np.bool_], spacing: int) -> float:
    """Standard deviation of white noise that would answer the mask of such a spacing so; 0 where it fits nowhere."""
    window = np.ones((2 * spacing + 1, 2 * spacing + 1), np.uint8)
    core = cv2.erode(inside.astype(np.uint8), window, borderValue=0) > 0
    return _MAD_TO_SIGMA * float(np.median(_high_pass(grey, spacing)[core])) if core.any() else 0.0


def noise_map(crop: Crop) -> NDArray[np.float32]:
    """(h, w) standard deviation of the noise per pixel: compression makes more of it beside the silhouette.

    Lossy compression (JPEG) rings in the blocks that hold a strong edge, above all object against background.
    """
    depth = np.asarray(cv2.distanceTransform(crop.inside.astype(np.uint8), cv2.DIST_L2, 5))
    band = (depth > _RINGING_PX[0]) & (depth <= _RINGING_PX[1])
    near = float(np.quantile(_high_pass(crop.grey)[band], _QUARTILE)) if band.any() else 0.0
    near = max(near / _QUARTILE_OF_NORMAL, crop.noise)
    return np.where(depth <= _RINGING_PX[1], near, crop.noise).astype(np.float32)


def _high_pass(grey: NDArray[np.float32], spacing: int = 1) -> NDArray[np.float32]:
    """Absolute response to a mask of unit norm that cancels planes of luminance and their products.

    Args:
        grey: (h, w) luminance.
        spacing: between the pixels that it compares, px.
    """
    second = np.zeros(2 * spacing + 1, np.float32)
    second[::spacing] = 1, -2, 1
    return np.asarray(np.abs(cv2.filter2D(grey, cv2.CV_32F, np.outer(second, second) / 6)), np.float32)


@cache
def half_disks(radius: int) -> NDArray[np.float32]:
    """(DIRECTIONS, 2, k, k) float32 indicators of the two halves of a disk; line i lies at i * 180 / 8 degrees."""
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1].astype(np.float64)
    disk = x**2 + y**2 <= (radius + 0.5) ** 2
    kernels = []
    for i in range(DIRECTIONS):
        angle = np.pi * i / DIRECTIONS
        side = -np.sin(angle) * x + np.cos(angle) * y  # signed distance from the dividing line
        kernels.append([disk & (side > 0.25), disk & (side < -0.25)])
    return np.asarray(kernels, np.float32)


def step_strength(
    grey: NDArray[np.float32], inside: NDArray[np.bool_], radius: int
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Strongest luminance step through each pixel.

    The step in a direction is |mean of one half-disk - mean of the other|, over pixels on the object only.

    Args:
        grey: (h, w) luminance.
        inside: (h, w) silhouette.
        radius: of the disk, px.

    Returns:
        (h, w) float32 strength in grey levels, 0 off the object, and (h, w) uint8 index of the direction of
        the line with the strongest step (i * 180 / 8 degrees from the x axis).
    """
    weight = inside.astype(np.float32)
    value = grey * weight
    best = np.zeros(grey.shape, np.float32)
    direction = np.zeros(grey.shape, np.uint8)
    for i, (first, second) in enumerate(half_disks(radius)):
        floor = _MIN_SHARE * float(first.sum())
        count_a, count_b = _sum(weight, first), _sum(weight, second)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.abs(_sum(value, first) / count_a - _sum(value, second) / count_b)
        step[(np.minimum(count_a, count_b) < floor) | ~inside] = 0
        stronger = step > best
        np.copyto(best, step, where=stronger)
        direction[stronger] = i
    return best, direction


def without_shading(strength: NDArray[np.float32], radius: int) -> NDArray[np.float32]:
    """Take away what smooth shading adds: a step is a ridge of the strength, a slope of luminance is a plateau."""
    size = 2 * (2 * radius + 1) + 1  # a ridge is 2 radius + 1 wide, the window twice as wide
    window = np.ones((size, size), np.uint8)
    return np.asarray(cv2.morphologyEx(strength, cv2.MORPH_TOPHAT, window), np.float32)


def _sum(image: NDArray[np.float32], kernel: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(cv2.filter2D(image, cv2.CV_32F, kernel, borderType=cv2.BORDER_CONSTANT), np.float32)
