"""Where views disagree about a solid: one place of its surface has one grey, from wherever it is seen.

Edges and silhouettes say nothing about what lies between them: a pocket without its walls, a hole through which another
face shows, a groove with a round bottom. There the views see different things at what should be one place.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from brepgaussian.artifacts.views import Views
from brepgaussian.brep.refine.observe import Images
from brepgaussian.brep.refine.visibility import Scene, look
from brepgaussian.brep.structure import Structure
from brepgaussian.splatting.concave import Images as Shown
from brepgaussian.splatting.concave.radiance import differences

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_STRIDE_PX = 3  # between pixels that are asked
_OPAQUE = 250  # alpha of a pixel that is surely object
_PLACE_PX = 3.0  # side of a place, in footprints of a pixel
_CLEAR_PX = 2.5  # footprints from all edges, where a pixel shows two faces or the edge may be off
_LEAST_FACING = 0.25  # cosine between a ray and the normal: at a graze a pixel is many places
_LEAST_RAYS = 8  # that a place is seen by, before it says anything
_CAP = 3.0  # tolerances; greater differences count no more
_REFUTED = 1.0  # tolerances by which a place's rays differ on average
_SCATTERED = 0.02  # of other faces' places refuted (JPEG rings beside edges, say) make areas twice as large by chance
_NEIGHBOUR = 2.3  # places apart: one that nobody asked may lie between


@dataclass(frozen=True)
class Disagreement:
    """Places that views disagree about.

    Attributes:
        area: of the largest connected ones on a face, px^2 ; less where as many lie scattered on other faces.
        faces: (F,) places on each face.
    """

    area: float
    faces: Indices


def disagreement(scene: Scene, structure: Structure, images: Images, views: Views, poses: Array) -> Disagreement:
    """Where views disagree about a solid.

    Args:
        scene: its triangulation.
        structure: its edges and faces.
        images: for their noise.
        views: images and cameras.
        poses: (V, 3) image corrections.
    """
    count = len(structure.faces)
    shown = Shown.of(views, images.noise)
    footprint = views.cameras.footprint()
    face, points, grey = _seen(scene, shown, poses, _edges(structure, footprint), footprint)
    if not len(face):
        return Disagreement(0.0, np.zeros(count, np.int64))
    side = _PLACE_PX * footprint
    place = np.floor(points / side).astype(np.int64)
    rows = np.column_stack([place, face])
    cost, told = differences(rows, points / side - place - 0.5, grey, shown.tolerance, _CAP)
    found, where, rays = np.unique(rows, axis=0, return_inverse=True, return_counts=True)
    where = where.ravel()
    asked = (np.bincount(where, told) == rays) & (rays >= _LEAST_RAYS)
    refuted = found[asked & (np.bincount(where, cost) > _REFUTED * rays)]
    bad, all_asked = (np.bincount(rows[:, 3], minlength=count) for rows in (refuted, found[asked]))
    elsewhere = (bad.sum() - bad) / np.maximum(all_asked.sum() - all_asked, 1)  # (F,) share on the other faces
    area = _largest(refuted, count) * _PLACE_PX**2 / (1 + elsewhere / _SCATTERED)
    return Disagreement(float(area.max(initial=0.0)), bad)


def _seen(
    scene: Scene, shown: Shown, poses: Array, edges: Array, footprint: float
) -> tuple[Indices, Array, NDArray[np.float64]]:
    """(N,) faces, (N, 3) points and (N,) greys of what the pixels of all views show, clear of edges and grazes."""
    views = shown.views
    at = [
        np.column_stack([np.full(len(rows), view), rows * _STRIDE_PX, columns * _STRIDE_PX])
        for view, (rows, columns) in enumerate(np.nonzero(a[::_STRIDE_PX, ::_STRIDE_PX] > _OPAQUE) for a in views.alpha)
    ]
    view, row, column = np.concatenate(at).T
    if not len(view):
        return np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0)
    centers, directions = look(views.cameras, view, np.column_stack([column, row]) + 0.5, poses)
    triangle, distance = scene.hit(centers, directions)
    facing = np.einsum("ri,ri->r", directions, scene.normals[triangle])
    kept = np.flatnonzero((triangle >= 0) & (np.abs(facing) > _LEAST_FACING))
    points = centers[kept] + distance[kept, None] * directions[kept]
    reach = _CLEAR_PX * footprint
    clear = np.isinf(cKDTree(edges).query(points, distance_upper_bound=reach)[0]) if len(edges) else np.full(1, True)
    kept, points = kept[clear], points[clear]
    return scene.face[triangle[kept]], points, shown.luminance[view[kept], row[kept], column[kept]].astype(float)


def _edges(structure: Structure, spacing: float) -> Array:
    """(N, 3) points on all edges, at most `spacing` apart."""
    found = [np.zeros((0, 3))]
    for edge in structure.edges:
        line = edge.polyline
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        along = np.linspace(0, length[-1], max(2, int(np.ceil(length[-1] / spacing)) + 1))
        found.append(np.column_stack([np.interp(along, length, line[:, k]) for k in range(3)]))
    return np.concatenate(found)


def _largest(places: Indices, faces: int) -> Indices:
    """(F,) size of the largest connected set of (N, 4) places on each face, which their last column names."""
    result = np.zeros(faces, np.int64)
    if not len(places):
        return result
    near = cKDTree(places[:, :3]).query_pairs(_NEIGHBOUR, output_type="ndarray")
    pairs = near[places[near[:, 0], 3] == places[near[:, 1], 3]]
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(places), len(places)))
    label = connected_components(graph, directed=False)[1]
    first = np.unique(label, return_index=True)[1]
    np.maximum.at(result, places[first, 3], np.bincount(label))
    return result
