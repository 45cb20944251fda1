"""Renderings of a solid: ray cast, exact normals, antialiased at edges, the visible face of every pixel."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.geometry.cameras import Cameras
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.lighting import Bounce, bounce, cast, direct, display, make_scene
from brepgaussian.views.mesh import FaceMesh
from brepgaussian.views.refine import split_long_edges

Array = NDArray[np.float64]
LIGHT_SPACING = 0.04  # unit frame; triangles that carry bounced light are no longer than this
_BORDER_PX = 2  # around the projected box
# The pixel filter of the published images: a Blackman-Harris window over 1.5 px (Blender's default).
_FILTER_WIDTH_PX = 1.5
_BLACKMAN_HARRIS = (0.35875, -0.48829, 0.14128, -0.01168)
# Additive recurrence with the plastic number: an even two-dimensional pattern of any number of points.
_PLASTIC = (0.7548776662466927, 0.5698402909980532)


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
        rgb[view] = _degrade(grey, alpha[view], settings, view)
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

    def __call__(self, center: Array, directions: Array) -> tuple[NDArray[np.int16], Array]:
        """(N,) face ids, -1 for a miss, and (N,) linear radiance, 0 for a miss."""
        origins = np.broadcast_to(center, directions.shape)
        hit, triangles, weights = cast(self.scene, origins, directions, self.threads)
        faces, radiance = np.full(len(directions), -1, np.int16), np.zeros(len(directions))
        if not hit.any():
            return faces, radiance
        faces[hit] = self.mesh.triangle_face[triangles]
        points, normals = self.mesh.points_at(triangles, weights)
        shade = direct(points, normals)
        if self.light is not None:
            shade += self.light.at(triangles, weights)
        radiance[hit] = shade
        return faces, radiance


def _render_view(
    painter: _Painter, cameras: Cameras, view: int, subsamples: int
) -> tuple[Array, NDArray[np.uint8], NDArray[np.int16]]:
    """Grey levels (H, W) float, alpha and face ids of one view."""
    shape = (cameras.height, cameras.width)
    grey, alpha, ids = np.zeros(shape), np.zeros(shape), np.full(shape, -1, np.int16)
    window = _window(painter.mesh.vertices, cameras, view)
    centers = _centers(window)
    center, directions = cameras.rays(view, centers)
    faces, radiance = painter(center, directions)
    inner = grey[window].shape
    coverage, faces2d = (faces >= 0).astype(float), faces.reshape(inner)
    edge = np.flatnonzero(_near_edges(faces2d).ravel())
    if len(edge) and subsamples > 1:
        offsets = _pattern(subsamples**2)
        samples = (centers[edge][:, None] + offsets[None]).reshape(-1, 2)
        center, directions = cameras.rays(view, samples)
        sub_faces, sub_radiance = painter(center, directions)
        seen = (sub_faces >= 0).reshape(len(edge), -1)
        coverage[edge] = seen.mean(axis=1)
        radiance[edge] = sub_radiance.reshape(len(edge), -1).sum(axis=1) / np.maximum(seen.sum(axis=1), 1)
    alpha[window] = coverage.reshape(inner)
    grey[window] = display(radiance).reshape(inner)
    ids[window] = faces2d
    return grey, np.rint(255 * alpha).astype(np.uint8), ids


def _near_edges(faces: NDArray[np.int16]) -> NDArray[np.bool_]:
    """Pixels with another face (or the background) among their eight neighbours."""
    low = ndimage.minimum_filter(faces, 3, mode="nearest")
    high = ndimage.maximum_filter(faces, 3, mode="nearest")
    return low != high


def _pattern(count: int) -> Array:
    """(count, 2) offsets from a pixel's centre, distributed as the pixel filter."""
    x = np.linspace(0, 1, 2001)
    density = sum(a * np.cos(2 * np.pi * k * x) for k, a in enumerate(_BLACKMAN_HARRIS))
    cumulative = np.cumsum(density)
    cumulative = (cumulative - cumulative[0]) / (cumulative[-1] - cumulative[0])
    index = np.arange(count)[:, None] + 0.5
    uniform = (index * np.array(_PLASTIC)) % 1
    uniform[:, 0] = index[:, 0] / count  # a lattice: exactly even along one axis
    return (np.interp(uniform, cumulative, x) - 0.5) * _FILTER_WIDTH_PX


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


def _degrade(grey: Array, alpha: NDArray[np.uint8], settings: ViewsSettings, view: int) -> NDArray[np.uint8]:
    """Noise and JPEG, where asked for; then (H, W, 3) uint8 with black where nothing is."""
    image = np.repeat(grey[:, :, None], 3, axis=2)
    if settings.noise > 0:
        random = np.random.default_rng([settings.seed, view])
        image = image + random.normal(0, settings.noise, image.shape)
    quantised = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    quantised[alpha == 0] = 0
    if settings.jpeg_quality > 0:
        import cv2

        _, code = cv2.imencode(".jpg", quantised, [cv2.IMWRITE_JPEG_QUALITY, settings.jpeg_quality])
        quantised = np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR), np.uint8)
        quantised[alpha == 0] = 0
    return quantised
