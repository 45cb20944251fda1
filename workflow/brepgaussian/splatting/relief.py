"""Relief: a hull's surface moved to the depth that parallax tells, where its radiance changes.

In inner corners, beside bosses and between ribs a hull bulges, and no lid is there that could be opened. But light
that faces throw at each other gives such places gradients, and greys that follow the slant of the views tell how much
deeper or higher the surface lies (`splatting.parallax`). What surely lies elsewhere is moved, with what is around it,
and looked at again.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from brepgaussian.artifacts.views import OPAQUE
from brepgaussian.geometry.pixels import inner_distance
from brepgaussian.log import get_logger
from brepgaussian.splatting.concave import Images
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.faces import Face, assign
from brepgaussian.splatting.parallax import Depths, Looks, depths

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

_STRIDE_PX = 2  # between pixels that are asked, more
_MOST_RAYS = 1_000_000  # where there are more clear pixels than these by far
_CLEAR_PX = 2.5  # from borders of the masks' regions, where a pixel shows two faces
_LEAST_FACING = 0.25  # cosine between a ray and the normal: at a graze a pixel is many places
_SIDES_PX = (12.0, 8.0, 5.0)  # of places, one after the other: large ones tell more, small ones more sharply
_ROUNDS = 4  # at most for each
_LEAST_GAIN = 0.9  # of the misfit that another round has to leave at most
_FARTHEST_PX = 4.0  # that a place is moved in one round: radiance is linear over little more
_REACH_PX = 7.5  # around places that lie elsewhere, within which the surface moves
_ALIKE = 0.7  # cosine between the normals of a vertex and of the place that it belongs to
_LEAST_ERROR_PX = 0.2  # of a depth: root mean square measured on surface that is right
_STIFFNESS = 2.0  # 1 / px^2: weight of the difference between neighbouring vertices, beside one over a depth's variance
_BEND = 8  # power of the cosine between neighbours' normals by which it falls: other faces don't follow
_REST = 0.05  # 1 / px^2: weight of staying where nothing is told
_THINNEST = 0.3  # of what lies behind a vertex, that it may move into in one round
_INSIDE_VOXELS = 0.1  # below a vertex: its own triangles don't count
_BAND_VOXELS = 4  # around what has moved, in which the field is made anew

logger = get_logger("stage1")


def relieve(images: Images, patches: NDArray[np.integer], faces: list[Face], hull: Volume) -> Volume:
    """The hull with what parallax shows elsewhere moved there; the same object if that is nothing.

    Args:
        images: of all views.
        patches: (V, H, W) region ids of the masks, 0 = none.
        faces: planar faces that were confirmed; they stay but where places on them lie elsewhere.
        hull: what silhouettes and openings leave.
    """
    clear = [_clear(regions, alpha) for regions, alpha in zip(patches, images.views.alpha, strict=True)]
    for side in _SIDES_PX:
        before = _Surface(*hull.mesh())
        after = _relieved(before, images, clear, side, faces, hull.spacing)
        if after is not before:
            hull = _followed(hull, before, after)
    return hull


@dataclass(frozen=True)
class _Surface:
    """A mesh: `vertices` (K, 3) and `triangles` (T, 3)."""

    vertices: Array
    triangles: NDArray[np.int64]

    @cached_property
    def scene(self) -> Scene:
        return Scene(self.vertices, self.triangles)

    @property
    def normals(self) -> Array:
        """(K, 3) outward unit normals."""
        return self.scene.normals


def _clear(regions: NDArray[np.integer], alpha: NDArray[np.uint8]) -> Bools:
    """(H, W) pixels clear of the borders of regions and of the silhouette."""
    same = ndimage.minimum_filter(regions, 3) == ndimage.maximum_filter(regions, 3)
    within: Bools = inner_distance(same & (regions > 0) & (alpha > OPAQUE)) > _CLEAR_PX
    return within


def _relieved(
    surface: _Surface, images: Images, clear: list[Bools], side_px: float, faces: list[Face], spacing: float
) -> _Surface:
    """The surface moved as long as fewer of its places of one size lie elsewhere."""
    footprint = images.views.cameras.footprint()
    held = assign(faces, surface.vertices, surface.normals, spacing) >= 0
    best, least = surface, np.inf
    for _ in range(_ROUNDS + 1):
        found = depths(_looks(surface.scene, images, clear), footprint, images.tolerance, side_px)
        misfit = float(np.minimum(np.abs(found.depth[found.off]), _FARTHEST_PX).sum())
        logger.info(
            "places of %.0f px: %d of %d lie elsewhere, by %.1f px in all",
            side_px, found.off.sum(), len(found.depth), misfit,
        )  # fmt: skip
        if misfit < least:
            best = surface
        if misfit > _LEAST_GAIN * least or not found.off.any():
            break
        least = misfit
        surface = _moved(surface, found, footprint, side_px, held, spacing)
    return best


def _looks(scene: Scene, images: Images, clear: list[Bools]) -> Looks:
    """Rays through every few clear pixels of all views."""
    cameras = images.views.cameras
    stride = max(_STRIDE_PX, int(np.sqrt(sum(free.sum() for free in clear) / _MOST_RAYS)))
    parts = []
    for view, free in enumerate(clear):
        row, column = (stride * k for k in np.nonzero(free[::stride, ::stride]))
        center, directions = cameras.rays(view, np.column_stack([column, row]) + 0.5)
        ray, points, normals = scene.seen(np.broadcast_to(center, directions.shape), directions)
        kept = np.einsum("ri,ri->r", directions[ray], normals) < -_LEAST_FACING
        grey = images.luminance[view, row[ray], column[ray]].astype(float)
        parts.append([rows[kept] for rows in (points, normals, directions[ray], grey)])
    points, normals, directions, grey = (np.concatenate(rows) for rows in zip(*parts, strict=True))
    return Looks(np.zeros(len(points), np.int64), points, normals, directions, grey)


def _moved(surface: _Surface, found: Depths, footprint: float, side_px: float, held: Bools, spacing: float) -> _Surface:
    """The surface with its vertices moved along their normals: told depths, and what is smooth between them."""
    vertices, normals = surface.vertices, surface.normals
    off = cKDTree(found.centres[found.off]).query(vertices)[0] / footprint
    free = (off < side_px + _REACH_PX) & (~held | (off < side_px))
    told = np.flatnonzero(found.told)
    distance, nearest = cKDTree(found.centres[told]).query(vertices)
    place = told[nearest]
    own = (distance < side_px * footprint) & (np.einsum("vi,vi->v", normals, found.normals[place]) > _ALIKE)
    weight = np.where(own, 1 / (found.sigma[place] ** 2 + _LEAST_ERROR_PX**2), _REST)
    target = np.where(own, np.clip(found.depth[place], -_FARTHEST_PX, _FARTHEST_PX), 0.0)
    depth = _smooth(surface, free, weight, target)
    depth[free] = np.minimum(depth[free], _THINNEST / footprint * _thickness(surface, free, spacing))
    return replace(surface, vertices=vertices - footprint * depth[:, None] * normals)


def _thickness(surface: _Surface, chosen: Bools, spacing: float) -> Array:
    """(N,) how much of the solid lies behind each chosen vertex, unit frame."""
    inward = -surface.normals[chosen]
    start = surface.vertices[chosen] + _INSIDE_VOXELS * spacing * inward
    found = surface.scene.distances(start, inward).astype(np.float64)
    return np.where(np.isfinite(found), found, 0.0)


def _smooth(surface: _Surface, free: Bools, weight: Array, target: Array) -> Array:
    """(K,) values of a membrane on a mesh: near its targets, zero where it isn't free."""
    result: Array = np.zeros(len(free))
    inside = np.flatnonzero(free)
    if not len(inside):
        return result
    triangles, normals = surface.triangles, surface.normals
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])  # each edge twice
    ends = ends[free[ends].any(axis=1)]
    alike = np.einsum("ei,ei->e", normals[ends[:, 0]], normals[ends[:, 1]]).clip(0) ** _BEND
    links = sparse.coo_matrix((_STIFFNESS / 2 * alike, ends.T), shape=(len(free), len(free)))
    links = (links + links.T).tocsr()
    matrix = (sparse.diags(np.asarray(links.sum(axis=1)).ravel() + weight) - links).tocsr()
    result[inside] = spsolve(matrix[inside][:, inside].tocsc(), (weight * target)[inside])
    return result


def _followed(hull: Volume, before: _Surface, after: _Surface) -> Volume:
    """The hull with the field of a surface that has moved, where it has."""
    way = after.vertices - before.vertices
    length = np.linalg.norm(way, axis=1)
    moved = np.flatnonzero(length > 0)
    near = np.zeros(hull.field.shape, bool)
    for share in np.linspace(0, 1, int(np.ceil(length.max() / hull.spacing)) + 1):
        cells = np.round((before.vertices[moved] + share * way[moved] - hull.origin) / hull.spacing).astype(int)
        near[tuple(np.clip(cells, 0, np.array(near.shape) - 1).T)] = True
    near = ndimage.binary_dilation(near, iterations=_BAND_VOXELS)
    field = hull.field.copy()
    field[near] = -after.scene.signed_distance(hull.origin + hull.spacing * np.argwhere(near))
    return hull.with_field(field)
