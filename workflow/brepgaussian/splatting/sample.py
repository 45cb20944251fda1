"""Multilinear interpolation between the values of images and volumes, in C++: scipy's takes four times as long."""

from ctypes import c_double, c_int64

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brepgaussian.splatting.library import Floats, load, pointer


def sample(values: NDArray[np.floating] | NDArray[np.uint8], at: ArrayLike, outside: float = 0.0) -> Floats:
    """Values of a grid between its points.

    Args:
        values: (R, C) or (K, R, C); an image of bytes as it is, anything else as float32.
        at: (N, 2) or (N, 3) fractional indices.
        outside: the value where an index lies outside of the grid.

    Returns:
        (N,) float32.
    """
    as_bytes = values.dtype == np.uint8 and values.ndim == 2
    grid = np.ascontiguousarray(values, None if as_bytes else np.float32)
    places = np.ascontiguousarray(at, np.float64)
    if grid.ndim not in (2, 3) or places.ndim != 2 or places.shape[1] != grid.ndim:
        raise ValueError(f"cannot look up places of shape {places.shape} in a grid of shape {grid.shape}")
    result = np.empty(len(places), np.float32)
    if not grid.size:
        result[:] = outside
        return result
    count, beyond = c_int64(len(places)), c_double(outside)
    if grid.ndim == 2:
        rows, columns = grid.shape
        size = int(as_bytes), c_int64(rows), c_int64(columns)
        load().bg_bilinear(pointer(grid), *size, count, pointer(places), beyond, pointer(result))
    else:
        shape = np.array(grid.shape, np.int64)
        load().bg_trilinear(pointer(grid), pointer(shape), count, pointer(places), beyond, pointer(result))
    return result
