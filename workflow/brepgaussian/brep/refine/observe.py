"""Sub-pixel positions of edges in the images, along profiles across their predicted place."""

from dataclasses import dataclass, replace
from weakref import ref

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.brep.refine.samples import Rays
from brepgaussian.brep.refine.visibility import CREASE, KINDS, OCCLUDING, SILHOUETTE, Seen
from brepgaussian.splatting.concave import Images as Shown
from brepgaussian.views.noise import coarse_noise

Array = NDArray[np.float64]

_STEP = 0.25  # px between samples of a silhouette's profile
_COARSE = 0.5  # px between samples of a luminance profile
_HALF = 2.5  # px on either side of the edge over which its profile is integrated
_PLATEAU = 1.0  # px beyond that over which the levels on either side are averaged
_BLUR = 1.0  # px, of the derivative of a Gaussian
_LEAST_STEP = 2.0  # grey levels below which an interior edge is not seen
_OPAQUE = 0.98  # alpha of a pixel that is safely inside the object
_MARGIN = 24  # px around the silhouettes
_VIEWS_FOR_NOISE = 8
SILHOUETTE_SIGMA = 0.02  # px
HARD_MASK_SIGMA = 0.2  # px, where the silhouettes are not antialiased
INTERIOR_SIGMA = 0.1  # px, of creases at any contrast
OCCLUDING_SIGMA = 0.2  # px, of occluding edges: what lies behind need not be flat
_INTERIOR_PER_STEP = 0.7  # px grey levels
_LEAST_SHARE = 0.5  # of an interior edge's samples that must show it
_MOST_SPREAD = 1 / 3  # median deviation of an edge's offsets over the window; chance gives one half
_NOISE_TO_POSITION = 2.5  # px: error of an integral over 5 px, and of its levels, per noise over step


@dataclass(frozen=True)
class Images:
    """Images ready for profiles.

    Attributes:
        alpha, luminance: (V, h, w) float32, 0..1 and grey levels, cropped to what the silhouettes need.
        corner: (2,) column and row of the crop's first pixel.
        noise: standard deviation of a pixel's grey level.
        silhouette_sigma: expected error of a silhouette's position, px.
    """

    alpha: NDArray[np.float32]
    luminance: NDArray[np.float32]
    corner: Array
    noise: float
    silhouette_sigma: float


@dataclass(frozen=True)
class Found:
    """Measured edges, one a row of `Seen`.

    Attributes:
        offset: (R,) px along the image normal from the predicted to the measured edge; NaN if not found.
        sigma: (R,) expected error, px.
        step: (R,) grey level on the negative side less that on the positive side; 0 for silhouettes.
    """

    offset: Array
    sigma: Array
    step: Array


_WHOLE: list[Shown] = []  # what `whole_images` gave last
_LAST: list[tuple["ref[Views]", Images]] = []  # what `prepare` gave last: one object's images are asked for often


def prepare(views: Views) -> Images:
    """Convert the images once, and estimate their noise and how soft their silhouettes are."""
    if not _LAST or _LAST[0][0]() is not views:
        _LAST[:] = [(ref(views), _converted(views))]
    return _LAST[0][1]


def whole_images(views: Views) -> Shown:
    """The images for comparing places of faces, converted once, too."""
    if not _WHOLE or _WHOLE[0].views is not views:
        _WHOLE[:] = [Shown.of(views, prepare(views).noise)]
    return _WHOLE[0]


def _converted(views: Views) -> Images:
    rows, columns = _extent(views.alpha.max(axis=(0, 2))), _extent(views.alpha.max(axis=(0, 1)))
    alpha = views.alpha[:, rows, columns]
    luminance = replace(views, rgb=views.rgb[:, rows, columns]).luminance.astype(np.float32)
    few = slice(None, None, max(1, len(alpha) // _VIEWS_FOR_NOISE))
    soft = int(((alpha[few] > 8) & (alpha[few] < 247)).sum())
    hard = int((np.abs(np.diff(alpha[few].astype(np.int16), axis=2)) > 239).sum())
    corner = np.array([columns.start, rows.start], float)
    noise = _noise(luminance[few], alpha[few] >= _OPAQUE * 255)
    sigma = SILHOUETTE_SIGMA if soft > hard else HARD_MASK_SIGMA
    return Images(alpha.astype(np.float32) / np.float32(255), luminance, corner, noise, sigma)


def _extent(present: NDArray[np.uint8]) -> slice:
    """Where a profile of the alphas along one axis is not empty, with a margin for searches."""
    found = np.flatnonzero(present)
    if len(found) == 0:
        return slice(0, len(present))
    return slice(max(int(found[0]) - _MARGIN, 0), int(found[-1]) + 1 + _MARGIN)


def _noise(luminance: NDArray[np.float32], opaque: NDArray[np.bool_]) -> float:
    """Median absolute second difference along rows inside the object, as a standard deviation; what JPEGs keep, too."""
    coarse = float(np.median([coarse_noise(image, inside) for image, inside in zip(luminance, opaque, strict=True)]))
    found = []
    for view, inside in enumerate(opaque):
        triple = inside[:, :-2] & inside[:, 1:-1] & inside[:, 2:]
        image = luminance[view]
        found.append(np.abs(image[:, :-2] - 2 * image[:, 1:-1] + image[:, 2:])[triple])
    values = np.concatenate(found)
    return max(float(np.median(values)) / 0.6745 / np.sqrt(6.0), coarse) if len(values) else 0.0


def measure(images: Images, seen: Seen, window: float, interior_window: float) -> Found:
    """Look for every edge within `window` px (silhouettes) or `interior_window` px of its predicted place."""
    count = len(seen.kind)
    offset, sigma, step = np.full(count, np.nan), np.full(count, np.inf), np.zeros(count)
    outline = seen.kind == SILHOUETTE
    rows = np.nonzero(outline)[0]
    offset[rows] = _silhouettes(images, seen.rays.take(rows), window)
    sigma[rows] = images.silhouette_sigma
    rows = np.nonzero(~outline)[0]
    offset[rows], step[rows] = _steps(images, seen.rays.take(rows), interior_window)
    with np.errstate(divide="ignore"):
        blur = (_INTERIOR_PER_STEP + _NOISE_TO_POSITION * images.noise) / np.abs(step[rows])
    least = np.where(seen.kind[rows] == OCCLUDING, OCCLUDING_SIGMA, INTERIOR_SIGMA)
    sigma[rows] = np.hypot(least, blur)
    offset[_contradicted(seen, step)] = np.nan
    offset[_by_chance(seen, offset, interior_window)] = np.nan
    return Found(offset, sigma, step)


def profiles(
    images: NDArray[np.float32], view: NDArray, pixel: Array, normal: Array, offsets: NDArray[np.floating]
) -> NDArray[np.float32]:
    """(R, S) bilinear samples of (V, h, w) images at pixel + offset * normal; borders are repeated."""
    height, width = images.shape[1:]
    x = np.clip(pixel[:, :1] + offsets * normal[:, :1] - 0.5, 0, width - 1.001)
    y = np.clip(pixel[:, 1:] + offsets * normal[:, 1:] - 0.5, 0, height - 1.001)
    column, row = x.astype(np.int32), y.astype(np.int32)
    fx, fy = (x - column).astype(np.float32), (y - row).astype(np.float32)
    at = (view[:, None] * height + row) * width + column
    flat = images.reshape(-1)
    top = flat[at]
    top += (flat[at + 1] - top) * fx
    at += width
    bottom = flat[at]
    bottom += (flat[at + 1] - bottom) * fx
    return top + (bottom - top) * fy


def _silhouettes(images: Images, rays: Rays, window: float) -> Array:
    """(R,) offsets by the integral of alpha over +-2.5 px around its crossing of one half."""
    half = round(_HALF / _STEP)
    reach = round(window / _STEP) + half
    offsets = np.arange(-reach, reach + 1) * _STEP
    alpha = profiles(
        images.alpha, rays.view, rays.pixel - images.corner, rays.normal, offsets
    )  # object on the negative side
    crossing = (alpha[:, :-1] >= 0.5) & (alpha[:, 1:] < 0.5)
    crossing[:, :half], crossing[:, 2 * reach - half :] = False, False
    distance = np.where(crossing, np.abs(offsets[:-1]), np.inf)
    at = np.argmin(distance, axis=1)
    rows = np.arange(len(at))
    found = np.isfinite(distance[rows, at])
    at = np.where(found, at, reach)
    part = np.take_along_axis(alpha, at[:, None] + np.arange(-half, half + 1), axis=1)
    clean = (part[:, 0] > _OPAQUE) & (part[:, -1] < 1 - _OPAQUE)
    area = _STEP * (part.sum(axis=1) - 0.5 * (part[:, 0] + part[:, -1]))
    return np.where(found & clean, offsets[at] - _HALF + area, np.nan)


def _steps(images: Images, rays: Rays, window: float) -> tuple[Array, Array]:
    """(R,) offsets and (R,) steps of luminance edges: peak of a Gaussian's derivative, then the area formula."""
    half, flat = round(_HALF / _COARSE), round(_PLATEAU / _COARSE)
    blur = round(3 * _BLUR / _COARSE)
    span = half + flat
    search = max(1, round(window / _COARSE))
    reach = search + max(span, blur)
    offsets = np.arange(-reach, reach + 1) * _COARSE
    profile = profiles(images.luminance, rays.view, rays.pixel - images.corner, rays.normal, offsets)
    opaque = profiles(images.alpha, rays.view, rays.pixel - images.corner, rays.normal, offsets) > _OPAQUE
    taps = np.arange(-blur, blur + 1) * _COARSE
    kernel = taps / _BLUR**2 * np.exp(-0.5 * (taps / _BLUR) ** 2)
    kernel /= np.abs(kernel).sum() / 2  # an ideal step answers with its height
    places = np.arange(reach - search, reach + search + 1)
    answer = sum(w * profile[:, places + k] for w, k in zip(kernel, range(-blur, blur + 1), strict=True))
    taper = np.exp(-0.5 * (offsets[places] / max(window, 1.0)) ** 2)
    peak = places[np.argmax(np.abs(answer) * taper, axis=1)]
    part = np.take_along_axis(profile, peak[:, None] + np.arange(-span, span + 1), axis=1)
    clean = np.take_along_axis(opaque, peak[:, None] + np.arange(-span, span + 1), axis=1).all(axis=1)
    low, high = part[:, : flat + 1].mean(axis=1), part[:, -flat - 1 :].mean(axis=1)
    step = low - high
    middle = part[:, flat : flat + 2 * half + 1]
    area = _COARSE * (middle.sum(axis=1) - 0.5 * (middle[:, 0] + middle[:, -1]) - 2 * half * high)
    strong = np.abs(step) > max(_LEAST_STEP, 2 * images.noise)
    shift = area / np.where(strong, step, 1.0) - _HALF
    good = strong & clean & (np.abs(shift) < _HALF / 2)
    return np.where(good, offsets[peak] + shift, np.nan), np.where(good, step, 0.0)


def _contradicted(seen: Seen, step: Array) -> NDArray[np.bool_]:
    """Creases whose step has another sign than most views give the same sample: light is fixed."""
    crease = (seen.kind == CREASE) & (step != 0)
    votes = np.zeros(int(seen.rays.sample.max(initial=-1)) + 1)
    np.add.at(votes, seen.rays.sample[crease], np.sign(step[crease]))
    bad = np.zeros(len(step), bool)
    bad[crease] = votes[seen.rays.sample[crease]] * step[crease] < 0
    return bad


def _by_chance(seen: Seen, offset: Array, window: float) -> NDArray[np.bool_]:
    """Interior edges that most of their samples do not show, or show anywhere in the window.

    Between two walls of the same grey there is no step; what is found there belongs to something else.
    """
    found = np.isfinite(offset)
    bad = np.zeros(len(offset), bool)
    key = np.where(seen.kind == SILHOUETTE, -1, seen.rays.group * len(KINDS) + seen.kind)
    order = np.argsort(key, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(key[order])) + 1):
        if len(rows) == 0 or key[rows[0]] < 0:
            continue
        seen_here = offset[rows][found[rows]]
        few = len(seen_here) < _LEAST_SHARE * len(rows)
        bad[rows] = few or float(np.median(np.abs(seen_here - np.median(seen_here)))) > _MOST_SPREAD * window
    return bad
