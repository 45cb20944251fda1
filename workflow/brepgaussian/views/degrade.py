"""Noise and JPEG in images, rendered or photographed, to measure what they cost."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.settings.views import ViewsSettings


def degrade(
    image: NDArray[np.floating] | NDArray[np.uint8], alpha: NDArray[np.uint8], settings: ViewsSettings, view: int
) -> NDArray[np.uint8]:
    """One image with noise and through JPEG, where asked for.

    Args:
        image: (H, W, 3) grey levels.
        alpha: (H, W); where it is 0 the result is black.
        settings: noise, jpeg_quality, seed.
        view: number of the view; each has noise of its own.

    Returns:
        (H, W, 3) uint8. The noise is the same in all three channels, so that its size is that of the luminance.
    """
    if settings.noise > 0:
        random = np.random.default_rng([settings.seed, view])
        image = image + random.normal(0, settings.noise, image.shape[:2])[:, :, None]
    quantised = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    quantised[alpha == 0] = 0
    if settings.jpeg_quality > 0:
        import cv2

        _, code = cv2.imencode(".jpg", quantised, [cv2.IMWRITE_JPEG_QUALITY, settings.jpeg_quality])
        quantised = np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR), np.uint8)
        quantised[alpha == 0] = 0
    return quantised


def degrade_photos(views: Views, settings: ViewsSettings) -> Views:
    """Photographs with noise and through JPEG, where asked for; renderings have theirs already."""
    if settings.noise <= 0 and settings.jpeg_quality <= 0:
        return views
    images = zip(views.rgb, views.alpha, strict=True)
    rgb = np.stack([degrade(image, alpha, settings, view) for view, (image, alpha) in enumerate(images)])
    return replace(views, rgb=rgb)
