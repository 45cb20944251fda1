"""Renderings of a solid: ray cast, exact normals, antialiased at edges, the visible face of every pixel."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.geometry.cameras import Cameras
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.degrade import degrade
from brepgaussian.views.lighting import Bounce, bounce, cast, direct, display, make_scene
from brepgaussian.views.mesh import FaceMesh
from brepgaussian.views.refine import split_long_edges

Array = NDArray[np.float64]
LIGHT_SPACING = 0.04  # unit frame; triangles that carry bounced light are no longer than this
_CHUNK = 1 << 15  # rays at a time: their arrays stay in the processor's cache
_BORDER_PX = 3  # around the projected box
# The pixel filter of the published images: a Blackman-Harris window, 3 px wide (Blender's default). Measured on
# their alpha channels: 2.4 levels rms from this filter, 12.6 from a box of 1 px.
_FILTER_WIDTH_PX = 3.0
_FILTER_REACH = 3  # pixels a side: an edge farther than 1 px from the centre weighs less than half a level
_BLACKMAN_HARRIS = (0.35875, -0.48829, 0.14128, -0.01168)
_GOLDEN = (np.sqrt(5) - 1) / 2  # of the Fibonacci lattice: an even pattern of any number of points


@dataclass(frozen=True)
class Rendering:
    """Images of all views.

    Attributes:
        rgb: (V, H, W, 3) uint8, 0 where alpha is 0.
        alpha: (V, H, W) uint8 coverage.
        face_ids: (V, H, W) int16 face seen by the ray through the pixel's centre, -1 background.
    """

    rgb: NDArray[np.uint8]
    alpha: NDArray[np.uint8]
    face_ids: NDArray[np.int16]


def render(
    mesh: FaceMesh, coarse: FaceMesh, cameras: Cameras, settings: ViewsSettings, threads: int, views: Iterable[int]
) -> Rendering:
    """Render views of a solid.

    Args:
        mesh: fine triangulation in the unit frame.
        coarse: coarse triangulation of the same solid, for bounced light.
        cameras: all cameras.
        settings: subsamples, interreflection, noise, jpeg_quality, seed.
        threads: for ray casting.
        views: iterates the indices of all views (a progress bar, say).
    """
    count, height, width = len(cameras), cameras.height, cameras.width
    light: Bounce | None = None
    if settings.interreflection > 0:
        mesh = split_long_edges(mesh, LIGHT_SPACING)
        light = bounce(mesh, split_long_edges(coarse, LIGHT_SPACING), settings.interreflection, threads)
    painter = _Painter(mesh, light, threads)
    rgb = np.zeros((count, height, width, 3), np.uint8)
    alpha = np.zeros((count, height, width), np.uint8)
    ids = np.full((count, height, width), -1, np.int16)
    for view in views:
        grey, alpha[view], ids[view] = _render_view(painter, cameras, view, settings.subsamples)
        rgb[view] = degrade(np.repeat(grey[:, :, None], 3, axis=2), alpha[view], settings, view)
    return Rendering(rgb, alpha, ids)


def face_ids(
    vertices: Array, triangles: NDArray[np.integer], owner: NDArray[np.integer], cameras: Cameras, threads: int
) -> NDArray[np.int16]:
    """(V, H, W) face seen through each pixel's centre, -1 background, of any triangle mesh (T,) owned by faces."""
    mesh = FaceMesh(vertices, triangles.astype(np.int32), owner.astype(np.int32), np.zeros((0, 3, 3)), ())
    scene = make_scene(mesh, threads)
    ids = np.full((len(cameras), cameras.height, cameras.width), -1, np.int16)
    for view in range(len(cameras)):
        window = _window(vertices, cameras, view)
        centers = _centers(window)
        center, directions = cameras.rays(view, centers)
        hit, found, _ = cast(scene, np.broadcast_to(center, directions.shape), directions, threads)
        seen = np.full(len(centers), -1, np.int16)
        seen[hit] = owner[found]
        ids[view][window] = seen.reshape(ids[view][window].shape)
    return ids


class _Painter:
    """Radiance along rays."""

    def __init__(self, mesh: FaceMesh, light: Bounce | None, threads: int) -> None:
        self.mesh, self.light, self.threads = mesh, light, threads
        self.scene = make_scene(mesh, threads)

    def shade(self, cameras: Cameras, view: int, pixels: Array) -> tuple[NDArray[np.int16], Array]:
        """(N,) face ids, -1 for a miss, and (N,) linear radiance, 0 for a miss, through (N, 2) pixel positions."""
        return self._all(cameras, view, pixels, None)

    def refine(
        self, cameras: Cameras, view: int, pixels: Array, known: tuple[NDArray[np.int16], Array]
    ) -> tuple[NDArray[np.int16], Array]:
        """The same, where `known` holds (H, W) face ids and radiances at pixel centres.

        A ray that meets the face which its pixel's centre sees takes that pixel's radiance: within half a pixel it
        changes by far less than a grey level, and most rays are spared the shading.
        """
        return self._all(cameras, view, pixels, known)

    def _all(
        self, cameras: Cameras, view: int, pixels: Array, known: tuple[NDArray[np.int16], Array] | None
    ) -> tuple[NDArray[np.int16], Array]:
        faces, radiance = np.full(len(pixels), -1, np.int16), np.zeros(len(pixels))
        for start in range(0, len(pixels), _CHUNK):
            part = slice(start, start + _CHUNK)
            center, directions = cameras.rays(view, pixels[part])
            origins = np.broadcast_to(center, directions.shape)
            hit, triangles, weights = cast(self.scene, origins, directions, self.threads)
            seen = self.mesh.triangle_face[triangles].astype(np.int16)
            value, new = np.zeros(len(seen)), np.ones(len(seen), bool)
            if known is not None:
                row, column = _cells(pixels[part][hit], cameras)
                new = known[0][row, column] != seen
                value[~new] = known[1][row[~new], column[~new]]
            if new.any():
                value[new] = self._radiance(triangles[new], weights[new])
            faces[part][hit], radiance[part][hit] = seen, value
        return faces, radiance

    def _radiance(self, triangles: NDArray[np.int64], weights: Array) -> Array:
        points, normals = self.mesh.points_at(triangles, weights)
        radiance = direct(points, normals)
        return radiance if self.light is None else radiance + self.light.at(triangles, weights)


def _cells(pixels: Array, cameras: Cameras) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Row and column of the pixels that hold (N, 2) positions, clipped to the image."""
    cell = np.floor(pixels).astype(np.int64)
    return np.clip(cell[:, 1], 0, cameras.height - 1), np.clip(cell[:, 0], 0, cameras.width - 1)


def _render_view(
    painter: _Painter, cameras: Cameras, view: int, subsamples: int
) -> tuple[Array, NDArray[np.uint8], NDArray[np.int16]]:
    """Grey levels (H, W) float, alpha and face ids of one view."""
    shape = (cameras.height, cameras.width)
    radiance, coverage, ids = np.zeros(shape), np.zeros(shape), np.full(shape, -1, np.int16)
    window = _window(painter.mesh.vertices, cameras, view)
    faces, values = painter.shade(cameras, view, _centers(window))
    inner = ids[window].shape
    ids[window], radiance[window] = faces.reshape(inner), values.reshape(inner)
    coverage[window] = ids[window] >= 0
    rows, columns = np.nonzero(_near_edges(ids))
    if len(rows) and subsamples > 1:
        offsets = _pattern(subsamples**2)
        samples = (np.column_stack([columns + 0.5, rows + 0.5])[:, None] + offsets).reshape(-1, 2)
        sub_faces, sub_values = painter.refine(cameras, view, samples, (ids, radiance))
        seen = (sub_faces >= 0).reshape(len(rows), -1)
        coverage[rows, columns] = seen.mean(axis=1)
        radiance[rows, columns] = sub_values.reshape(len(rows), -1).sum(axis=1) / np.maximum(seen.sum(axis=1), 1)
    grey = np.zeros(shape)
    grey[window] = display(radiance[window])
    return grey, np.rint(255 * coverage).astype(np.uint8), ids


def _near_edges(faces: NDArray[np.int16]) -> NDArray[np.bool_]:
    """Pixels with another face (or the background) within reach of the pixel filter."""
    low = ndimage.minimum_filter(faces, _FILTER_REACH, mode="nearest")
    high = ndimage.maximum_filter(faces, _FILTER_REACH, mode="nearest")
    return low != high


def _pattern(count: int) -> Array:
    """Offsets (N, 2) from a pixel's centre, about `count` of them, distributed as the pixel filter.

    They are symmetric and hold the centre itself, so that at a straight border a pixel is covered by more than
    half exactly if its centre is, as in the published images.
    """
    x = np.linspace(0, 1, 2001)
    density = np.array(_BLACKMAN_HARRIS) @ np.cos(2 * np.pi * np.arange(4)[:, None] * x)
    cumulative = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
    half = np.arange(count // 2) + 0.5
    uniform = np.column_stack([half / (2 * len(half)), (half * _GOLDEN) % 1])
    offsets = (np.interp(uniform, cumulative / cumulative[-1], x) - 0.5) * _FILTER_WIDTH_PX
    return np.concatenate([np.zeros((1, 2)), offsets, -offsets])


def _window(vertices: Array, cameras: Cameras, view: int) -> tuple[slice, slice]:
    """Rows and columns that hold the projected vertices."""
    pixels, _ = cameras.project(view, vertices)
    low = np.clip(np.floor(pixels.min(axis=0)) - _BORDER_PX, 0, (cameras.width, cameras.height)).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0)) + _BORDER_PX, 0, (cameras.width, cameras.height)).astype(int)
    return slice(low[1], high[1]), slice(low[0], high[0])


def _centers(window: tuple[slice, slice]) -> Array:
    """(N, 2) pixel centres of a window, row by row."""
    rows, columns = np.mgrid[window]
    return np.column_stack([columns.ravel() + 0.5, rows.ravel() + 0.5])
