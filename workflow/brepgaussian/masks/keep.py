"""Regions that one image shows clearly and the geometry does not know: they stay regions of their own.

Where stage 1 has no geometry for a face (a floor painted on the lid of its pocket), no label can fall on it, and a
projection of labels alone would lose what the image shows plainly.
"""

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

CLEAR_STEP = 8.0  # grey levels: shading and light from other faces hardly make such steps within a face
_CLEAR_NOISE = 4.0  # the same per standard deviation of the image noise
_LEAST_AREA = 300  # px; smaller ones may be a face that is merely misplaced by the samples' error
_LEAST_HALF_WIDTH = 4.0  # px; thinner ones are strips between a border and its projection
_SHARE = 0.8  # of the detected region that lies in one patch, and most of the patch that it may take


def kept_regions(
    patches: NDArray[np.int16],
    detected: NDArray[np.integer],
    ridge: NDArray[np.float32],
    noise: float,
    first: int,
) -> NDArray[np.int32]:
    """Give detected regions that lie within one patch, behind a clear border, ids of their own.

    The largest region of a patch keeps the patch's id.

    Args:
        patches: (h, w) projected patch ids of one view, 0 = none.
        detected: (h, w) region ids of the view's own masks, 0 = none.
        ridge: (h, w) step strength without shading, grey levels.
        noise: standard deviation of the image noise, grey levels.
        first: the first new id.

    Returns:
        (h, w) int32 patch ids; the new ones count up from `first`.
    """
    result = patches.astype(np.int32)
    patch, patch_count = components(patches)
    region, region_count = components(detected)
    table = np.bincount(
        region.ravel().astype(np.int64) * (patch_count + 1) + patch.ravel(),
        minlength=(region_count + 1) * (patch_count + 1),
    ).reshape(region_count + 1, patch_count + 1)
    area, patch_area = table.sum(1), table.sum(0)
    largest = table[1:].argmax(0) + 1 if region_count else np.zeros(patch_count + 1, np.int64)
    clear = max(CLEAR_STEP, _CLEAR_NOISE * noise)
    for index, box in enumerate(ndimage.find_objects(region), start=1):
        home = int(table[index, 1:].argmax()) + 1 if patch_count else 0
        inside = table[index, home]
        if box is None or area[index] < _LEAST_AREA or not home:
            continue
        if inside < _SHARE * area[index] or inside > _SHARE * patch_area[home] or largest[home] == index:
            continue
        window = tuple(slice(max(side.start - 1, 0), side.stop + 1) for side in box)
        mask, within = region[window] == index, patch[window] == home
        if _clearly_bounded(mask, within & (region[window] > 0), ridge[window], clear):
            result[window][mask & within] = first
            first += 1
    return result


def _clearly_bounded(
    mask: NDArray[np.bool_], within: NDArray[np.bool_], ridge: NDArray[np.float32], clear: float
) -> bool:
    """Whether a region is wide enough and its border with the rest of its patch is a clear step."""
    if cv2.distanceTransform(np.pad(mask, 1).astype(np.uint8), cv2.DIST_L2, 5).max() < _LEAST_HALF_WIDTH:
        return False
    kernel = np.ones((3, 3), np.uint8)
    beside = (cv2.dilate(mask.astype(np.uint8), kernel) > 0) & ~mask & within
    if beside.sum() < 2 * _LEAST_HALF_WIDTH:
        return False
    return bool(np.median(np.asarray(cv2.dilate(ridge, kernel))[beside]) >= clear)


def components(raw: NDArray[np.integer]) -> tuple[NDArray[np.int32], int]:
    """Connected components of equal label: (h, w) int32 from 1, 0 where the label is not positive, and their number."""
    result = np.zeros(raw.shape, np.int32)
    count = 0
    for value, box in enumerate(ndimage.find_objects(np.maximum(raw, 0).astype(np.int32)), start=1):
        if box is None:
            continue
        labels, found = ndimage.label(raw[box] == value)
        result[box][labels > 0] = labels[labels > 0] + count
        count += found
    return result, count
