"""A contact sheet of one object: from an input view to the solid, all from the same camera."""

from pathlib import Path
from typing import Any

import numpy as np

from brepgaussian.artifacts.base import atomic
from brepgaussian.report import colors
from brepgaussian.report.content import Content
from brepgaussian.report.picture import (
    Frame,
    Image,
    draw_points,
    draw_surfels,
    draw_triangles,
    frame_on_object,
    runs,
    visible,
)
from brepgaussian.settings.report import ReportSettings

_DPI = 100
_TITLE_PX = 30
_COLUMNS = 4
_NO, _SEEN, _ALL = "no curves", "visible curves", "all curves and corners"


def make_sheet(content: Content, out_png: str | Path, settings: ReportSettings) -> None:
    """Draw the contact sheet.

    Args:
        content: the object's artifacts.
        out_png: the picture.
        settings: settings of the stage.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    view = content.view
    frame = frame_on_object(content.views, view, settings.panel_px)
    panels = _panels(content, frame)
    rows = -(-len(panels) // _COLUMNS)
    width, height = _COLUMNS * settings.panel_px, rows * (settings.panel_px + _TITLE_PX)
    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor="white")
    FigureCanvasAgg(figure)
    for i, (title, image, lines) in enumerate(panels):
        row, column = divmod(i, _COLUMNS)
        bottom = 1 - (row + 1) * (settings.panel_px + _TITLE_PX) / height
        axes = figure.add_axes((column / _COLUMNS, bottom, 1 / _COLUMNS, settings.panel_px / height))
        axes.imshow(image, extent=(0, frame.size, frame.size, 0), interpolation="nearest")
        axes.set(xlim=(0, frame.size), ylim=(frame.size, 0))
        axes.axis("off")
        if lines != _NO:
            _draw_curves(axes, content, frame, hidden=lines == _ALL)
        if lines == _ALL:
            _draw_corners(axes, content, frame)
        axes.set_title(title, fontsize=11, color=tuple(colors.INK), pad=5)
    with atomic(out_png) as temporary:
        figure.savefig(temporary, dpi=_DPI, metadata={"Software": None})  # no versions: the same bytes everywhere


def _panels(content: Content, frame: Frame) -> list[tuple[str, Image, str]]:
    """Title, picture and whether curves and corners are drawn over it."""
    view, surface = frame.view, content.solid.surface
    points, white = content.points, np.ones((frame.size, frame.size, 3))
    patch = points.label >= 0
    steel = np.tile(colors.STEEL, (len(surface.triangles), 1))
    panels = [
        (f"input, view {view + 1} of {len(content.views.cameras)}", _photo(content, frame), _NO),
        ("edges", 1 - np.repeat(frame.crop(content.masks.edges[view])[..., None] / 255.0, 3, axis=2), _NO),
        ("patches" if content.repaired is None else "patches, repaired", _patches(content, frame), _NO),
        (f"{len(content.surfels.centers):,} surfels", draw_surfels(frame, content.surfels), _NO),
        (
            f"{np.count_nonzero(patch):,} points, {len(np.unique(points.label[patch]))} labels",
            draw_points(
                frame,
                points.xyz[patch].astype(float),
                points.normals[patch].astype(float),
                colors.patch_colors(points.label[patch]),
            ),
            _NO,
        ),
        (f"{len(content.brep.curves)} curves, {len(content.brep.corners)} corners", white, _ALL),
        (
            f"solid, {len(np.unique(content.solid.face))} faces",
            draw_triangles(frame, surface, steel),
            _SEEN,
        ),
    ]
    return [*panels, _last(content, frame)]


def _last(content: Content, frame: Frame) -> tuple[str, Image, str]:
    """Errors against the truth, or the faces in colours where there is none."""
    if content.errors is None:
        painted = colors.patch_colors(content.solid.face)
        return "faces", draw_triangles(frame, content.solid.surface, painted), _NO
    vertices, triangles = content.solid.fine
    end = colors.error_end(content.errors)
    surface = type(content.solid.surface)(vertices, triangles, vertices, vertices)
    painted = colors.error_colors(content.errors, end)[triangles]
    return f"error, 0 to {end:g} (dark red)", draw_triangles(frame, surface, painted), _NO


def _photo(content: Content, frame: Frame) -> Image:
    """The view over white."""
    rgb = frame.crop(content.views.rgb[frame.view]) / 255.0
    alpha = frame.crop(content.views.alpha[frame.view])[..., None] / 255.0
    return rgb * alpha + colors.BACKGROUND * (1 - alpha)


def _patches(content: Content, frame: Frame) -> Image:
    """The view's regions in colours, a little of the photograph showing through."""
    masks = content.masks.patches if content.repaired is None else content.repaired
    ids = frame.crop(masks[frame.view]).astype(int)
    painted = colors.patch_colors(ids.ravel() - 1).reshape(*ids.shape, 3)
    outside = frame.crop(content.views.alpha[frame.view]) == 0
    painted[(ids == 0) & outside] = colors.BACKGROUND
    return painted


def _draw_curves(axes: Any, content: Content, frame: Frame, hidden: bool) -> None:
    """Curves; hidden parts, if wanted, pale and dotted."""
    for curve in content.brep.curves:
        if len(curve.points) < 2:
            continue
        pixels, _ = frame.project(curve.points)
        for start, stop, seen in runs(visible(frame, curve.points, content.solid.surface)):
            if seen:
                axes.plot(*pixels[start:stop].T, color=tuple(colors.INK), linewidth=1.4 if hidden else 1.0, zorder=3)
            elif hidden:
                axes.plot(*pixels[start:stop].T, color="0.72", linewidth=0.8, linestyle=(0, (3, 2)), zorder=2)


def _draw_corners(axes: Any, content: Content, frame: Frame) -> None:
    """Corners; hidden ones pale."""
    if len(content.brep.corners) == 0:
        return
    pixels, _ = frame.project(content.brep.corners)
    near = visible(frame, content.brep.corners, content.solid.surface)
    axes.scatter(*pixels[~near].T, s=9, color="0.72", zorder=4, linewidths=0)
    axes.scatter(*pixels[near].T, s=16, color=tuple(colors.CORNER), zorder=5, linewidths=0)
