"""Distances on a grid of pixels."""

import cv2
import numpy as np
from numpy.typing import NDArray


def inner_distance(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(H, W) exact distance, pixels, of each place of a mask (H, W) to the nearest one off it; past the border all is.

    OpenCV's, since it is many times faster than scipy's on whole images.
    """
    padded = np.pad(mask, 1).astype(np.uint8)
    return np.asarray(cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1], np.float32)
