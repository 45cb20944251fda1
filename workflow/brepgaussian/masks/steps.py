"""What one image says about luminance steps: silhouette, noise, half-disk step strength."""

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from brepgaussian.views.checks import OPAQUE
from brepgaussian.views.noise import estimate_noise, fill_outside, high_pass, silhouette_box

DIRECTIONS = 8  # orientations of the line that divides the disk, over 180 degrees
_MIN_SHARE = 0.35  # a half-disk needs this share of its pixels on the object
_QUARTILE, _QUARTILE_OF_NORMAL = 0.75, 1.1503  # of |x| for a standard normal x
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
    box = silhouette_box(inside)
    inside = np.ascontiguousarray(inside[box])
    grey = fill_outside(np.ascontiguousarray(luminance[box], np.float32), inside)
    return Crop(box, grey, inside, estimate_noise(grey, inside))


def noise_map(crop: Crop) -> NDArray[np.float32]:
    """(h, w) standard deviation of the noise per pixel: compression makes more of it beside the silhouette.

    Lossy compression (JPEG) rings in the blocks that hold a strong edge, above all object against background.
    """
    depth = np.asarray(cv2.distanceTransform(crop.inside.astype(np.uint8), cv2.DIST_L2, 5))
    band = (depth > _RINGING_PX[0]) & (depth <= _RINGING_PX[1])
    near = float(np.quantile(high_pass(crop.grey)[band], _QUARTILE)) if band.any() else 0.0
    near = max(near / _QUARTILE_OF_NORMAL, crop.noise)
    return np.where(depth <= _RINGING_PX[1], near, crop.noise).astype(np.float32)


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
