"""Silhouettes as evidence: which places a camera sees through, and how well a solid fills them."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.cameras import Cameras

Array = NDArray[np.float64]

_OPAQUE = 128  # alpha of a pixel that is half covered
CLEAR_PX = 2.0  # a place that projects this far outside a silhouette is empty: borders and poses err by less


@dataclass(frozen=True)
class Silhouettes:
    """Silhouettes of some views at some scale.

    Attributes:
        alpha: (V, H, W) uint8 coverage.
        distance: (V, H, W) float32 distance in pixels to the nearest opaque pixel.
        cameras: of these views, at this scale.
    """

    alpha: NDArray[np.uint8]
    distance: NDArray[np.float32]
    cameras: Cameras

    def empty(self, points: Array, clear: float = CLEAR_PX) -> NDArray[np.bool_]:
        """(N,) whether some camera sees the background at (N, 3) points, `clear` pixels from the silhouette.

        Places out of a view's frame are unknown to it.
        """
        result = np.zeros(len(points), bool)
        height, width = self.alpha.shape[1:]
        left = np.arange(len(points))
        for view in range(len(self.cameras)):
            pixels, depth = self.cameras.project(view, points[left])
            with np.errstate(invalid="ignore"):
                column, row = np.floor(pixels[:, 0]), np.floor(pixels[:, 1])
            ok = (depth > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
            out = np.zeros(len(left), bool)
            out[ok] = self.distance[view, row[ok].astype(int), column[ok].astype(int)] >= clear
            result[left[out]] = True
            left = left[~out]
            if not len(left):
                break
        return result

    def iou(self, corners: Array) -> float:
        """Mean intersection over union of the silhouettes with those of (T, 3, 3) triangles."""
        return float(np.mean(self.ious(corners))) if len(self.cameras) else float("nan")

    def ious(self, corners: Array) -> Array:
        """(V,) intersection over union per view; a view in which both are empty counts 1."""
        values = []
        for view in range(len(self.cameras)):
            drawn, known = self.draw(view, corners), self.alpha[view] >= _OPAQUE
            union = np.count_nonzero(drawn | known)
            values.append(np.count_nonzero(drawn & known) / union if union else 1.0)
        return np.array(values)

    def draw(self, view: int, corners: Array) -> NDArray[np.bool_]:
        """(H, W) silhouette of (T, 3, 3) triangles in one view."""
        height, width = self.alpha.shape[1:]
        image = np.zeros((height * _FINE, width * _FINE), np.uint8)
        pixels, depth = self.cameras.project(view, corners.reshape(-1, 3))
        front = (depth.reshape(-1, 3) > 0).all(axis=1)
        # OpenCV draws with pixel centres at integers, takes fixed-point coordinates and paints every pixel
        # that an outline touches: drawn finer and read at pixel centres, that is a sixth of a pixel
        fixed = np.round((pixels.reshape(-1, 3, 2) * _FINE - 0.5) * 2**_SHIFT)
        front &= (np.abs(fixed) < 2**30).all(axis=(1, 2))  # a point next to the camera overflows
        fixed = fixed.astype(np.int32)
        for triangle in fixed[front]:
            cv2.fillConvexPoly(image, triangle, 1, lineType=cv2.LINE_8, shift=_SHIFT)
        return image[_FINE // 2 :: _FINE, _FINE // 2 :: _FINE].astype(bool)


_SHIFT = 6
_FINE = 3  # odd, so that a fine pixel's centre is a pixel's centre


def make_silhouettes(alpha: NDArray[np.uint8], cameras: Cameras, views: int, side: int) -> Silhouettes | None:
    """At most `views` evenly chosen silhouettes, reduced by a whole factor to at most about `side` pixels.

    Views without any silhouette are no evidence; None if none is left.
    """
    usable = [v for v in range(len(alpha)) if (alpha[v] >= _OPAQUE).any() and _finite(cameras, v)]
    if not usable:
        return None
    chosen = [
        usable[i] for i in np.unique(np.linspace(0, len(usable) - 1, min(views, len(usable))).round().astype(int))
    ]
    factor = max(1, int(np.ceil(max(alpha.shape[1:]) / side)))
    height, width = (n // factor for n in alpha.shape[1:])
    small = np.stack([_reduce(alpha[v], factor, height, width) for v in chosen])
    distance = np.stack(
        [cv2.distanceTransform((a < _OPAQUE).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5) for a in small]
    )
    scaled = Cameras(cameras.intrinsics[chosen] / factor, cameras.cam_from_unit[chosen], width, height)
    return Silhouettes(small, distance, scaled)


def _reduce(alpha: NDArray[np.uint8], factor: int, height: int, width: int) -> NDArray[np.uint8]:
    cut = alpha[: height * factor, : width * factor].reshape(height, factor, width, factor)
    return np.round(cut.mean(axis=(1, 3))).astype(np.uint8)


def _finite(cameras: Cameras, view: int) -> bool:
    return bool(np.isfinite(cameras.cam_from_unit[view]).all() and np.isfinite(cameras.intrinsics[view]).all())
