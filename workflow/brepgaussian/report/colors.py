"""Colours: many distinct ones for patches, a scale for errors, plain shading."""

import colorsys

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_GOLDEN = 0.61803398875  # consecutive hues lie far apart for any number of patches
_LEVELS = ((0.50, 0.90), (0.34, 0.96), (0.58, 0.74))  # saturation and value, in turns

BACKGROUND = np.array([1.0, 1.0, 1.0])
STEEL = np.array([0.70, 0.74, 0.80])  # of a solid without patches
NONE = np.array([0.78, 0.78, 0.78])  # of unassigned points
INK = np.array([0.13, 0.15, 0.19])  # of curves
CORNER = np.array([0.85, 0.20, 0.16])
# Errors from none to the scale's end: blue grey, yellow, orange, dark red.
_ERROR_STOPS = np.array([[0.80, 0.86, 0.92], [0.99, 0.88, 0.45], [0.95, 0.45, 0.15], [0.50, 0.0, 0.10]])

_AMBIENT, _DIFFUSE, _HEADLIGHT = 0.30, 0.58, 0.24


def patch_colors(labels: NDArray[np.integer]) -> Array:
    """(N, 3) colours in 0..1 of (N,) labels; grey for negative ones."""
    labels = np.asarray(labels)
    table = np.array([_distinct(i) for i in range(int(labels.max(initial=-1)) + 1)] + [NONE])
    return table[np.where(labels < 0, len(table) - 1, labels)]


def error_colors(errors: Array, end: float) -> Array:
    """(N, 3) colours of (N,) distances; `end` gets the last colour."""
    position = np.clip(errors / end, 0, 1) * (len(_ERROR_STOPS) - 1)
    stops = np.arange(len(_ERROR_STOPS))
    return np.column_stack([np.interp(position, stops, _ERROR_STOPS[:, k]) for k in range(3)])


def error_end(errors: Array) -> float:
    """A round end of the error scale: the 99.5 % quantile, rounded up to 1, 2 or 5 times a power of ten."""
    largest = max(float(np.quantile(errors, 0.995)) if len(errors) else 0.0, 1e-5)
    power = 10.0 ** np.floor(np.log10(largest))
    return float(next(step * power for step in (1, 2, 5, 10) if step * power >= largest * (1 - 1e-9)))


def shade(colors: Array, normals: Array, directions: Array, light: Array) -> Array:
    """Lit colours (N, 3).

    Args:
        colors: (N, 3) colours of surfaces.
        normals: (N, 3) their unit normals; a surface seen from behind is lit as from the front.
        directions: (N, 3) unit directions of view.
        light: (3,) unit direction towards the light.
    """
    facing = (normals * directions).sum(axis=1)
    front = np.where(facing > 0, -1.0, 1.0)[:, None] * normals
    key = 0.5 + 0.5 * (front @ light)  # half Lambert: no side is black
    return np.clip(colors * (_AMBIENT + _DIFFUSE * key + _HEADLIGHT * np.abs(facing))[:, None], 0, 1)


def _distinct(index: int) -> tuple[float, float, float]:
    saturation, value = _LEVELS[index % len(_LEVELS)]
    return colorsys.hsv_to_rgb((0.58 + index * _GOLDEN) % 1.0, saturation, value)
