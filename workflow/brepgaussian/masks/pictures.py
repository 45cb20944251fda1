"""Pictures of masks beside the truth, for the report and for looking before believing."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.base import atomic
from brepgaussian.artifacts.views import Views
from brepgaussian.errors import ToolError

_GAP = 6  # px between panels
_TITLE = 22  # px above each column
_TINT = 0.55  # share of the id's colour over the image


def palette(count: int) -> NDArray[np.uint8]:
    """(count, 3) uint8 RGB colours by the golden angle, well apart for neighbouring ids; the first is black."""
    hue = (np.arange(count) * 0.61803398875) % 1.0
    saturation = np.where(np.arange(count) % 2 == 0, 0.85, 0.55)
    value = np.where(np.arange(count) % 3 == 0, 0.95, 0.75)
    sector = (hue[:, None] * 6 + np.array([5.0, 3.0, 1.0])) % 6
    rgb = value[:, None] * (1 - saturation[:, None] * np.clip(np.minimum(sector, 4 - sector), 0, 1))
    colors = np.rint(255 * rgb).astype(np.uint8)
    colors[0] = 0
    return colors


def draw_comparison(
    path: str | Path, views: Views, columns: Mapping[str, NDArray], chosen: Sequence[int] | None = None, size: int = 320
) -> None:
    """Write a PNG with one row a view and one column a kind of mask, cut to the object.

    Args:
        path: the PNG to write.
        views: the images, shown in the first column.
        columns: title to (V, H, W) array: uint8 edge maps are drawn as they are, other integers as ids over the
            image (negative and 0 = none; add 1 to face ids that start at 0).
        chosen: the views to show; four evenly spaced ones by default.
        size: of a panel, px.

    Raises:
        ToolError: the file cannot be written.
    """
    if chosen is None:
        chosen = np.unique(np.linspace(0, len(views.names) - 1, 4).astype(int)).tolist()
    rows = [_row(views, columns, view, size) for view in chosen]
    titles = np.full((_TITLE, rows[0].shape[1], 3), 255, np.uint8)
    for i, title in enumerate(("image", *columns)):
        origin = (_GAP + i * (size + _GAP), _TITLE - 6)
        cv2.putText(titles, title, origin, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
    sheet = np.concatenate([titles, *rows])
    with atomic(path) as temporary:
        if not cv2.imwrite(str(temporary), sheet[:, :, ::-1]):
            raise ToolError("cannot be written as a picture", file=path, fix="give a path that ends in .png")


def _row(views: Views, columns: Mapping[str, NDArray], view: int, size: int) -> NDArray[np.uint8]:
    box = _square(views.alpha[view] > 0)
    image = views.rgb[view].copy()
    image[views.alpha[view] < 128] = 255
    panels = [image]
    for array in columns.values():
        mask = array[view]
        if mask.dtype == np.uint8:
            panels.append(np.repeat(255 - mask[:, :, None], 3, axis=2))
            continue
        ids = np.maximum(mask, 0).astype(np.int64)
        tint = palette(int(ids.max()) + 1)[ids]
        mixed = np.where(ids[:, :, None] > 0, _TINT * tint + (1 - _TINT) * image, image)
        panels.append(mixed.astype(np.uint8))
    gap = np.full((size, _GAP, 3), 255, np.uint8)
    cells: list[NDArray[np.uint8]] = [gap]
    for panel in panels:
        cell = cv2.resize(np.ascontiguousarray(panel[box]), (size, size), interpolation=cv2.INTER_AREA)
        cells += [np.asarray(cell, np.uint8), gap]
    return np.concatenate([np.concatenate(cells, 1), np.full((_GAP, _width(cells), 3), 255, np.uint8)])


def _width(cells: list[NDArray[np.uint8]]) -> int:
    return sum(cell.shape[1] for cell in cells)


def _square(mask: NDArray[np.bool_]) -> tuple[slice, slice]:
    """A square window around the object, as large as the image allows."""
    height, width = mask.shape
    if not mask.any():
        return slice(0, height), slice(0, width)
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    side = min(max(rows[-1] - rows[0], columns[-1] - columns[0]) + 1 + 2 * _GAP, height, width)
    top = int(np.clip((rows[0] + rows[-1] - side) // 2, 0, height - side))
    left = int(np.clip((columns[0] + columns[-1] - side) // 2, 0, width - side))
    return slice(top, top + side), slice(left, left + side)
