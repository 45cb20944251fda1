"""Steps in grey where a solid has no edge: a groove that is missing, a slot that passes for a smooth wall.

A smooth face has smooth shades, but for what its neighbours throw at it close to where they meet. A step that several
views show in one place, clear of all edges, is an edge of something else.
"""

from weakref import ref

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.artifacts.views import OPAQUE
from brepgaussian.brep.refine.looks import LEAST_FACING, clear_of_edges, largest_areas
from brepgaussian.brep.refine.visibility import Scene, look
from brepgaussian.brep.structure import Structure
from brepgaussian.geometry.pixels import inner_distance
from brepgaussian.geometry.rows import distinct
from brepgaussian.splatting.concave import Images as Shown

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_BLUR = 1.0  # px, of the gradient
_STEEP = 2.0  # tolerances per px, by which a step's gradient exceeds
_ASIDE = 3.0  # px, what it is that far before and behind it: smooth shades are as steep there
_CLEAR_PX = 5.0  # from all edges: light that is thrown back falls off steeply up to there from a foot
_AROUND = 8  # directions in which a face has to go on that far
_SLOPE = 4.0  # px per px that it may recede there: more is its own contour
_PLACE_PX = 3.0  # side of a place, in footprints of a pixel
_LEAST_VIEWS = 3  # that show a step in one place,
_LEAST_SHARE = 0.3  # and of those that see it: grooves' have .64 in the median, smooth shades near grazes .17

_LAST: list[tuple["ref[Shown]", Indices]] = []  # what `image_steps` gave last: many solids are asked of one object


def stepped(scene: Scene, structure: Structure, shown: Shown, poses: Array) -> float:
    """Area (px^2) of the largest connected places on a face where views show steps clear of all edges.

    Args:
        scene: the solid's triangulation.
        structure: its edges and faces.
        shown: views, their greys, and by how many of these one place may differ.
        poses: (V, 3) image corrections.
    """
    footprint = shown.views.cameras.footprint()
    at = image_steps(shown)
    pixels = at[:, [2, 1]].astype(np.float64) + 0.5
    centers, directions = look(shown.views.cameras, at[:, 0], pixels, poses)
    triangle, distance = scene.hit(centers, directions)
    facing = np.abs(np.einsum("ri,ri->r", directions, scene.normals[triangle]))
    kept = np.flatnonzero((triangle >= 0) & (facing > LEAST_FACING))
    points = centers[kept] + distance[kept, None] * directions[kept]
    clear = clear_of_edges(points, structure, _CLEAR_PX * footprint)
    kept, points = kept[clear], points[clear]
    face, far = scene.face[triangle[kept]], distance[kept]
    whole = np.ones(len(kept), bool)
    for turn in 2 * np.pi * np.arange(_AROUND) / _AROUND:
        aside = pixels[kept] + _CLEAR_PX * np.array([np.cos(turn), np.sin(turn)])
        there, away = scene.cast(*look(shown.views.cameras, at[kept, 0], aside, poses))
        whole &= (there == face) & (np.abs(away - far) < _SLOPE * _CLEAR_PX * footprint)
    place = np.floor(points[whole] / (_PLACE_PX * footprint)).astype(np.int64)
    found, which, _ = distinct(np.column_stack([place, face[whole]]))  # (P, 4) places
    views = np.bincount(distinct(np.column_stack([which, at[kept[whole], 0]]))[0][:, 0], minlength=len(found))
    some = np.flatnonzero(views >= _LEAST_VIEWS)
    if not len(some):
        return 0.0
    one = np.flatnonzero(whole)[np.unique(which, return_index=True)[1][some]]  # a point of each
    sighted = watching(scene, points[one], scene.normals[triangle[kept[one]]], shown)
    most = views[some] >= _LEAST_SHARE * sighted
    area = largest_areas(found[some[most]], len(structure.faces))
    return float(area.max()) * _PLACE_PX**2


def watching(scene: Scene, places: Array, normals: Array, shown: Shown) -> Indices:
    """(N,) how many views see places (N, 3) of the solid, with normals (N, 3), not at a graze."""
    cameras = shown.views.cameras
    reach = _PLACE_PX * cameras.footprint()
    count = np.zeros(len(places), np.int64)
    for center in cameras.centers:
        sight = places - center
        far = np.linalg.norm(sight, axis=1)
        directions = sight / far[:, None]
        faced = np.abs(np.einsum("ni,ni->n", directions, normals)) > LEAST_FACING
        count += faced & (np.abs(scene.hit(np.broadcast_to(center, places.shape), directions)[1] - far) < reach)
    return count


def image_steps(shown: Shown) -> Indices:
    """(S, 3) view, row and column of the pixels inside the object at which its greys have a step."""
    if not _LAST or _LAST[0][0]() is not shown:
        found = [_steps(*image, shown.tolerance) for image in zip(shown.luminance, shown.views.alpha, strict=True)]
        rows = [np.column_stack([np.full(len(at), view), at]) for view, at in enumerate(found)]
        _LAST[:] = [(ref(shown), np.concatenate([np.zeros((0, 3), np.int64), *rows]))]
    return _LAST[0][1]


def _steps(luminance: NDArray[np.float32], alpha: NDArray[np.uint8], tolerance: float) -> Indices:
    """(S, 2) row and column of the pixels of one image (H, W) at which a gradient is a ridge."""
    opaque = alpha > OPAQUE
    if not opaque.any():
        return np.zeros((0, 2), np.int64)
    box = ndimage.find_objects(opaque.astype(np.int8))[0]
    grey = luminance[box].astype(np.float64)
    deep = inner_distance(opaque[box]) > _CLEAR_PX
    down, right = (ndimage.gaussian_filter(grey, _BLUR, order=order) for order in ((1, 0), (0, 1)))
    steep = np.hypot(down, right)
    at = np.argwhere(deep & (steep > _STEEP * tolerance))
    size = steep[tuple(at.T)]
    way = np.column_stack([down[tuple(at.T)], right[tuple(at.T)]]) / np.maximum(size, 1e-9)[:, None]

    def along(px: float) -> Array:
        return np.asarray(ndimage.map_coordinates(steep, (at + px * way).T, order=1, mode="nearest"))

    ridge = size - np.maximum(along(_ASIDE), along(-_ASIDE)) > _STEEP * tolerance
    at = at[ridge & (size >= along(1.0)) & (size >= along(-1.0))]
    return np.asarray(at + [part.start for part in box], np.int64)
