"""Training images: cropped to the object, reduced to the training resolution, premultiplied by alpha."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.masks import Masks
from brepgaussian.artifacts.views import Views
from brepgaussian.splatting.camera import Camera, camera_of
from brepgaussian.splatting.library import TILE

_BORDER_PX = 6  # around the object's box: half the window of SSIM


@dataclass(frozen=True)
class Target:
    """What one view shows, as planes (rows, stride) padded with zeros to whole tiles.

    Attributes:
        camera: the crop's camera.
        colors: (C, rows, stride) float32 premultiplied colour in 0..1, C = 1 for grey images.
        alpha: (rows, stride) float32 coverage.
        edges: (rows, stride) float32 edge probability.
        origin: (x, y) of the crop in the training image.
    """

    camera: Camera
    colors: NDArray[np.float32]
    alpha: NDArray[np.float32]
    edges: NDArray[np.float32]
    origin: tuple[int, int] = (0, 0)

    @property
    def stride(self) -> int:
        """Row length in memory."""
        return self.alpha.shape[1]


def is_grey(views: Views) -> bool:
    """Whether red, green and blue agree everywhere: one channel then does for three."""
    return all(bool((image[..., :1] == image[..., 1:]).all()) for image in views.rgb)


def make_targets(views: Views, masks: Masks, size: int) -> list[Target]:
    """Targets of all views, reduced so that the images' longer side is `size` px (never enlarged)."""
    grey = is_grey(views)
    factor = training_scale(views, size)
    return [_target(views, masks, view, factor, grey) for view in range(len(views.alpha))]


def training_scale(views: Views, size: int) -> float:
    """Training pixels per pixel of the images."""
    return min(1.0, size / max(views.cameras.width, views.cameras.height))


def _target(views: Views, masks: Masks, view: int, factor: float, grey: bool) -> Target:
    import cv2

    alpha = views.alpha[view].astype(np.float32) / 255
    rgb = views.rgb[view][..., :1] if grey else views.rgb[view]
    colors = rgb.astype(np.float32) / 255 * alpha[..., None]
    layers = np.dstack([colors, alpha, masks.edges[view].astype(np.float32) / 255])
    camera = camera_of(views.cameras, view)
    if factor < 1:
        width, height = round(camera.width * factor), round(camera.height * factor)
        layers = cv2.resize(layers, (width, height), interpolation=cv2.INTER_AREA)
        sx, sy = width / camera.width, height / camera.height
        camera = Camera(
            camera.cam_from_unit, camera.fx * sx, camera.fy * sy, camera.cx * sx, camera.cy * sy, width, height
        )
    rows, columns = (np.flatnonzero(layers[..., -2].max(axis=axis) > 0) for axis in (1, 0))
    if len(rows) == 0:
        rows = columns = np.array([0])
    x0, y0 = max(columns[0] - _BORDER_PX, 0), max(rows[0] - _BORDER_PX, 0)
    x1 = min(columns[-1] + 1 + _BORDER_PX, camera.width)
    y1 = min(rows[-1] + 1 + _BORDER_PX, camera.height)
    x0, y0, x1, y1 = int(x0), int(y0), int(x1), int(y1)
    crop = layers[y0:y1, x0:x1]
    pad_y, pad_x = -crop.shape[0] % TILE, -crop.shape[1] % TILE
    padded = np.pad(crop, ((0, pad_y), (0, pad_x), (0, 0)))
    planes = np.ascontiguousarray(np.moveaxis(padded, 2, 0), np.float32)
    return Target(camera.crop(x0, y0, x1 - x0, y1 - y0), planes[:-2], planes[-2], planes[-1], (x0, y0))
