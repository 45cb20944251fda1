"""Image noise: how much there is, and images without most of it."""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.log import get_logger
from brepgaussian.views.checks import OPAQUE

_QUANTISATION = 12**-0.5  # standard deviation of rounding to whole grey levels
_MAD_TO_SIGMA = 1.4826
_COARSE_PX = 3  # of a JPEG's 8 x 8 patterns, the finest that quality 85 and below keeps of noise of two grey levels
_SHADING_AT_COARSE = 0.5  # grey levels: what curved faces without noise answer at that spacing
_LEAST_NOISE = 0.75  # grey levels: below, smoothing takes more from weak steps than from noise
_STRENGTH = 1.5  # of non-local means, standard deviations of the noise: more blurs steps of a few of them
_STRENGTH_COMPRESSED = 2.0  # neighbours alike by compression look like a pattern to keep
_COMPRESSED = 1.5  # noise between pixels further apart is so many times that between neighbours
_PATCH_PX, _WINDOW_PX = 5, 21  # of non-local means; patches of 7 px lose more of the steps
_MARGIN = 4  # px kept around the silhouette, so that its border has an outside

LOG = get_logger("views")


def estimate_noise(grey: NDArray[np.float32], inside: NDArray[np.bool_]) -> float:
    """Standard deviation of the image noise in grey levels, from the silhouette's interior.

    The median response to a mask that cancels planes of luminance and their products (Immerkaer, 1996), so edges and
    shading hardly count. Once between neighbours, and once between pixels further apart, for compression (JPEG) leaves
    noise to coarse patterns alone. At least the noise of rounding to whole levels.
    """
    return max(*_fine_and_coarse(grey, inside), _QUANTISATION)


def coarse_noise(grey: NDArray[np.float32], inside: NDArray[np.bool_]) -> float:
    """The part of `estimate_noise` that compression leaves, grey levels; 0 where there is none."""
    return max(_typical_response(grey, inside, _COARSE_PX) ** 2 - _SHADING_AT_COARSE**2, 0.0) ** 0.5


def noise_of(views: Views) -> float:
    """Median over the views of `estimate_noise`, grey levels."""
    found = []
    for view, alpha in enumerate(views.alpha):
        box = silhouette_box(alpha >= OPAQUE)
        found.append(estimate_noise(views.grey(view)[box], alpha[box] >= OPAQUE))
    return float(np.median(found))


def high_pass(grey: NDArray[np.float32], spacing: int = 1) -> NDArray[np.float32]:
    """Absolute response to a mask of unit norm that cancels planes of luminance and their products.

    Args:
        grey: (h, w) luminance.
        spacing: between the pixels that it compares, px.
    """
    second = np.zeros(2 * spacing + 1, np.float32)
    second[::spacing] = 1, -2, 1
    return np.asarray(np.abs(cv2.filter2D(grey, cv2.CV_32F, np.outer(second, second) / 6)), np.float32)


def fill_outside(image: NDArray, inside: NDArray[np.bool_]) -> NDArray:
    """Replace pixels off the object by the nearest object pixel (renderers leave garbage there).

    Args:
        image: (h, w) or (h, w, channels).
        inside: (h, w) silhouette, of one pixel at least.
    """
    _, labels = cv2.distanceTransformWithLabels(
        (~inside).astype(np.uint8), cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL
    )
    nearest = np.zeros((labels.max() + 1, *image.shape[2:]), image.dtype)
    nearest[labels[inside]] = image[inside]
    outside = ~inside if image.ndim == 2 else ~inside[:, :, None]
    return np.where(outside, nearest[labels], image)


def for_steps(views: Views) -> Views:
    """The images in which steps of luminance are looked for.

    As taken where noise is white, for means over half-disks tell steps best; smoothed where compression made patterns
    of it, that look like steps themselves.
    """
    return views if views.taken is None or _is_compressed(*_noises(views.as_taken)) else views.as_taken


def denoised(views: Views, threads: int = 1) -> Views:
    """The views without most of their noise, and as they were taken; themselves where there is little.

    Non-local means: the grey levels of machined faces vary slowly, so that every patch has many like it nearby. What
    follows compares places between views by grey level, which noise forbids and blur across steps misleads.

    Args:
        views: of one camera, whose noise is alike in all of them.
        threads: CPU threads; the result does not depend on it.
    """
    fine, coarse = _noises(views)
    if max(fine, coarse) < _LEAST_NOISE:
        return views
    strength = _STRENGTH_COMPRESSED * coarse if _is_compressed(fine, coarse) else _STRENGTH * fine
    LOG.info("noise %.2f grey levels, %.2f in coarse patterns: smoothed by non-local means", fine, coarse)
    cv2.setNumThreads(threads)
    rgb = views.rgb.copy()
    for view, alpha in enumerate(views.alpha):
        box = silhouette_box(alpha >= OPAQUE)
        inside = alpha[box] >= OPAQUE
        if inside.any():
            rgb[view][box][inside] = _smoothed(rgb[view][box], inside, strength)[inside]
    return replace(views, rgb=rgb, taken=views.rgb)


def _noises(views: Views) -> tuple[float, float]:
    """Medians over the views of the noise between neighbours, and between pixels further apart."""
    boxes = [silhouette_box(alpha >= OPAQUE) for alpha in views.alpha]
    known = [
        _fine_and_coarse(views.grey(view)[box], inside)
        for view, box in enumerate(boxes)
        if (inside := views.alpha[view][box] >= OPAQUE).any()
    ]
    fine, coarse = np.median(known, axis=0) if known else (0.0, 0.0)
    return float(fine), float(coarse)


def _is_compressed(fine: float, coarse: float) -> bool:
    return coarse > _COMPRESSED * fine


def _smoothed(image: NDArray[np.uint8], inside: NDArray[np.bool_], strength: float) -> NDArray[np.uint8]:
    """(h, w, 3): grey images by their one channel, a third of the work."""
    filled = np.ascontiguousarray(fill_outside(image, inside))
    grey = (filled == filled[:, :, :1]).all()
    source = np.ascontiguousarray(filled[:, :, 0]) if grey else filled
    result = cv2.fastNlMeansDenoising(source, None, strength, _PATCH_PX, _WINDOW_PX)
    return np.broadcast_to(result[:, :, None], image.shape) if grey else np.asarray(result, np.uint8)


def silhouette_box(inside: NDArray[np.bool_]) -> tuple[slice, slice]:
    """Rows and columns of a silhouette, with a margin; empty where it is."""
    rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
    if not len(rows):
        return slice(0, 0), slice(0, 0)
    return (
        slice(max(rows[0] - _MARGIN, 0), rows[-1] + 1 + _MARGIN),
        slice(max(columns[0] - _MARGIN, 0), columns[-1] + 1 + _MARGIN),
    )


def _fine_and_coarse(grey: NDArray[np.float32], inside: NDArray[np.bool_]) -> tuple[float, float]:
    """Noise between neighbours, and between pixels further apart without what shading makes there; grey levels."""
    return _typical_response(grey, inside, 1), coarse_noise(grey, inside)


def _typical_response(grey: NDArray[np.float32], inside: NDArray[np.bool_], spacing: int) -> float:
    """Standard deviation of white noise that would answer the mask of such a spacing so; 0 where it fits nowhere."""
    if not inside.any():
        return 0.0
    window = np.ones((2 * spacing + 1, 2 * spacing + 1), np.uint8)
    core = cv2.erode(inside.astype(np.uint8), window, borderValue=0) > 0
    return _MAD_TO_SIGMA * float(np.median(high_pass(grey, spacing)[core])) if core.any() else 0.0
