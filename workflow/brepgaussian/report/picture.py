"""Headless pictures from an input view: shaded triangles, surfels, points and lines on one pixel grid."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.stage1 import Surfels
from brepgaussian.artifacts.views import Views
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.metrics.distances import SampledSurface, to_tensor
from brepgaussian.metrics.mesh import normals as triangle_normals
from brepgaussian.report import colors

_TRIAL_PX = 32  # side of the pictures from which the best view is chosen
_ABOVE_BONUS = 0.4  # nats; a face more or less is worth more
_AGREEMENT = 0.1  # length of the mean of the cameras' unit up vectors
_MARGIN = 0.04  # around the silhouette, share of its box
_LIGHT = np.array([-0.55, -0.75, -0.45])  # in camera axes: right, down, forward
_DISC_SIDES = 10
_DISC_SIGMA = 1.5  # radius at which a surfel is drawn, in standard deviations
SUPERSAMPLING = 2  # per axis, against jagged borders
_CELLS_PER_POINT = 0.7  # cells per axis over the square root of the number of points: two points a cell
_OCCLUSION_TOLERANCE = 0.1  # unit frame: depth of a slanted face within a cell
_HIDDEN_TOLERANCE = 4e-3  # unit frame: a point this far behind the surface is hidden
Array = NDArray[np.float64]
Image = NDArray[np.float64]  # (H, W, 3) in 0..1


@dataclass(frozen=True)
class Frame:
    """A square part of one input view, drawn at its own resolution.

    Attributes:
        cameras: the object's cameras; view: the one that is used.
        left, top, side: the square in the view's pixels.
        size: pixels per side of the picture.
    """

    cameras: Cameras
    view: int
    left: float
    top: float
    side: float
    size: int

    @cached_property
    def rays(self) -> tuple[Array, Array]:
        """The camera's centre (3,) and (N, 3) unit directions, `SUPERSAMPLING`^2 a pixel, row by row."""
        n = self.size * SUPERSAMPLING
        steps = (np.arange(n) + 0.5) / n * self.side
        x, y = np.meshgrid(self.left + steps, self.top + steps)
        return self.cameras.rays(self.view, np.column_stack([x.ravel(), y.ravel()]))

    @property
    def light(self) -> Array:
        """(3,) unit direction towards a light above the camera's left shoulder."""
        return _LIGHT / np.linalg.norm(_LIGHT) @ self.cameras.cam_from_unit[self.view, :3, :3]

    def project(self, points: Array) -> tuple[Array, Array]:
        """(N, 2) positions in picture pixels and (N,) distances from the camera's centre."""
        pixels, _ = self.cameras.project(self.view, points)
        distance = np.linalg.norm(points - self.cameras.centers[self.view], axis=1)
        return (pixels - [self.left, self.top]) / self.side * self.size, distance

    def crop(self, image: NDArray[Any]) -> NDArray[Any]:
        """The square of a (H, W, ...) image by nearest pixels; zero outside the image."""
        steps = np.floor((np.arange(self.size) + 0.5) / self.size * self.side).astype(int)
        rows, columns = int(self.top) + steps, int(self.left) + steps
        inside = [(axis >= 0) & (axis < length) for axis, length in zip((rows, columns), image.shape, strict=False)]
        found = image[np.clip(rows, 0, image.shape[0] - 1)][:, np.clip(columns, 0, image.shape[1] - 1)].copy()
        found[~inside[0]] = 0
        found[:, ~inside[1]] = 0
        return found


def frame_on_object(views: Views, view: int, size: int) -> Frame:
    """A square around the object's silhouette in one view."""
    rows, columns = np.nonzero(views.alpha[view])
    if len(rows) == 0:
        return Frame(views.cameras, view, 0, 0, float(max(views.alpha.shape[1:])), size)
    low = np.array([columns.min(), rows.min()])
    high = np.array([columns.max(), rows.max()]) + 1
    side = np.ceil(float((high - low).max()) * (1 + 2 * _MARGIN))
    left, top = np.floor((low + high - side) / 2)
    return Frame(views.cameras, view, float(left), float(top), float(side), size)


def best_view(views: Views, surface: SampledSurface, face: NDArray[np.integer]) -> int:
    """The view that tells most about a solid: the largest entropy of its faces' visible areas.

    Views from above are preferred a little, as people draw things.

    Args:
        views: the input views.
        surface: the solid's triangles; face: (T,) face of each.
    """
    up = upward(views.cameras)
    scores = []
    for view in range(len(views.cameras)):
        frame = frame_on_object(views, view, _TRIAL_PX)
        hit, _ = _cast(*frame.rays, surface)
        counts = np.bincount(face[hit[hit >= 0]]) if (hit >= 0).any() else np.ones(1)
        share = counts[counts > 0] / counts.sum()
        above = float(up @ (views.cameras.centers[view] - 0.5)) > 0
        scores.append(-(share * np.log(share)).sum() + _ABOVE_BONUS * above)
    return int(np.argmax(scores))


def upward(cameras: Cameras) -> Array:
    """(3,) which way is up for most cameras; z if they disagree."""
    up = -cameras.cam_from_unit[:, 1, :3].mean(axis=0)
    length = float(np.linalg.norm(up))
    return up / length if length > _AGREEMENT else np.array([0.0, 0.0, 1.0])


def draw_triangles(frame: Frame, surface: SampledSurface, corner_colors: Array, flat: bool = False) -> Image:
    """Shaded triangles.

    Args:
        frame: the picture.
        surface: the triangles; only its `vertices` and `triangles` are used.
        corner_colors: (T, 3, 3) colour of each triangle's corners, or (T, 3) of each triangle.
        flat: leave out the light.
    """
    origin, directions = frame.rays
    hit, weights = _cast(origin, directions, surface)
    seen = hit >= 0
    image = np.tile(colors.BACKGROUND, (len(hit), 1))
    found = corner_colors[hit[seen]]
    if found.ndim == 3:
        found = np.einsum("nk,nkd->nd", weights[seen], found)
    if not flat:
        normals = triangle_normals(surface.vertices, surface.triangles)[hit[seen]]
        found = colors.shade(found, normals, directions[seen], frame.light)
    image[seen] = found
    n = frame.size
    return image.reshape(n, SUPERSAMPLING, n, SUPERSAMPLING, 3).mean(axis=(1, 3))


def draw_surfels(frame: Frame, surfels: Surfels) -> Image:
    """Surfels as opaque discs in their own colour, those that face the camera."""
    to_camera = frame.cameras.centers[frame.view] - surfels.centers
    front = (surfels.normals * to_camera).sum(axis=1) > 0
    centers, axes = surfels.centers[front].astype(float), surfels.axes[front].astype(float)
    angles = np.arange(_DISC_SIDES) / _DISC_SIDES * 2 * np.pi
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=1)  # (S, 2)
    scaled = axes[:, :, :2] * (surfels.scales[front, None, :] * _DISC_SIGMA)  # (N, 3, 2)
    around = centers[:, None] + np.einsum("ndk,sk->nsd", scaled, rim)  # (N, S, 3)
    vertices = np.concatenate([centers[:, None], around], axis=1).reshape(-1, 3)
    fan = np.array([(0, 1 + i, 1 + (i + 1) % _DISC_SIDES) for i in range(_DISC_SIDES)])
    triangles = (fan[None] + (np.arange(len(centers)) * (_DISC_SIDES + 1))[:, None, None]).reshape(-1, 3)
    discs = SampledSurface(vertices, triangles.astype(np.int32), vertices, vertices)
    painted = np.repeat(np.clip(surfels.colors[front].astype(float), 0, 1), _DISC_SIDES, axis=0)
    return draw_triangles(frame, discs, painted, flat=True)


def draw_points(frame: Frame, points: Array, normals: Array, point_colors: Array, radius: float = 1.6) -> Image:
    """Points that face the camera as shaded dots, near ones over far ones, without those behind others."""
    directions = points - frame.cameras.centers[frame.view]
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    front = (normals * directions).sum(axis=1) < 0
    front &= _in_front(*frame.project(points), front, frame.size)
    pixels, distance = frame.project(points[front])
    lit = colors.shade(point_colors[front], normals[front], directions[front], frame.light)
    order = np.argsort(-distance, kind="stable")
    n = frame.size * SUPERSAMPLING
    image = np.tile(colors.BACKGROUND, (n * n, 1))
    reach = int(np.ceil(radius * SUPERSAMPLING))
    steps = np.arange(-reach, reach + 1)
    dx, dy = (d.ravel() for d in np.meshgrid(steps, steps))
    disc = dx**2 + dy**2 <= (radius * SUPERSAMPLING) ** 2
    places = np.floor(pixels[order] * SUPERSAMPLING).astype(int)[:, None] + np.column_stack([dx, dy])[disc]
    inside = ((places >= 0) & (places < n)).all(axis=2)
    index = places[..., 1] * n + places[..., 0]
    image[index[inside]] = np.repeat(lit[order], disc.sum(), axis=0).reshape(*index.shape, 3)[inside]
    return image.reshape(frame.size, SUPERSAMPLING, frame.size, SUPERSAMPLING, 3).mean(axis=(1, 3))


def _in_front(pixels: Array, distance: Array, facing: NDArray[np.bool_], size: int) -> NDArray[np.bool_]:
    """(N,) whether no point that faces the camera lies well in front, in a coarse depth buffer."""
    cells = int(np.clip(np.sqrt(facing.sum()) * _CELLS_PER_POINT, 8, size))
    place = np.clip((pixels / size * cells).astype(int), 0, cells - 1)
    depth = np.full((cells, cells), np.inf)
    np.minimum.at(depth, (place[facing, 1], place[facing, 0]), distance[facing])
    return distance < depth[place[:, 1], place[:, 0]] + _OCCLUSION_TOLERANCE


def visible(frame: Frame, points: Array, surface: SampledSurface) -> NDArray[np.bool_]:
    """(N,) whether points on or near a surface are seen by the frame's camera."""
    origin = frame.cameras.centers[frame.view]
    away = points - origin
    distance = np.linalg.norm(away, axis=1)
    rays = np.column_stack([np.tile(origin, (len(points), 1)), away / distance[:, None]])
    hit = surface.scene.cast_rays(to_tensor(rays, np.float32), nthreads=surface.threads)["t_hit"].numpy()
    return distance < hit + _HIDDEN_TOLERANCE


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int, bool]]:
    """Runs of equal flags as (start, stop, flag), each sharing its last point with the next one's first."""
    change = np.flatnonzero(np.diff(flags.astype(int))) + 1
    starts = np.concatenate([[0], change])
    stops = np.concatenate([np.minimum(change + 1, len(flags)), [len(flags)]])
    return [(int(a), int(b), bool(flags[a])) for a, b in zip(starts, stops, strict=True)]


def _cast(origin: Array, directions: Array, surface: SampledSurface) -> tuple[NDArray[np.int64], Array]:
    """(N,) first triangle that each ray hits, -1 for none, and (N, 3) barycentric coordinates."""
    import open3d as o3d

    rays = to_tensor(np.column_stack([np.tile(origin, (len(directions), 1)), directions]), np.float32)
    found = surface.plain_scene.cast_rays(rays, nthreads=surface.threads)
    hit = found["primitive_ids"].numpy().astype(np.int64)
    uv = found["primitive_uvs"].numpy().astype(float)
    hit[hit == o3d.t.geometry.RaycastingScene.INVALID_ID] = -1
    return hit, np.column_stack([1 - uv.sum(axis=1), uv])
