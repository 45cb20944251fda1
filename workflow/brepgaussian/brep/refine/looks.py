"""What the pixels of all views show of a solid, clear of its edges: places of its faces and their greys."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from brepgaussian.artifacts.views import OPAQUE
from brepgaussian.brep.refine.visibility import Scene, look
from brepgaussian.brep.structure import Structure
from brepgaussian.geometry.chains import resample
from brepgaussian.splatting.concave import Images as Shown
from brepgaussian.splatting.parallax import Looks

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_CLEAR_PX = 2.5  # footprints from all edges, where a pixel shows two faces or the edge may be off
LEAST_FACING = 0.25  # cosine between a ray and the normal: at a graze a pixel is many places
_NEIGHBOUR = 2.3  # places apart: one that nobody asked may lie between


def looks(scene: Scene, structure: Structure, shown: Shown, poses: Array, stride: int) -> Looks:
    """Rays through every few pixels of all views, but for grazes and what lies beside an edge.

    Args:
        scene: the solid's triangulation.
        structure: its edges.
        shown: views and their greys.
        poses: (V, 3) image corrections.
        stride: pixels from one ray to the next.
    """
    cameras = shown.views.cameras
    found = (np.nonzero(alpha[::stride, ::stride] > OPAQUE) for alpha in shown.views.alpha)
    at = [np.column_stack([np.full(len(rows), k), stride * rows, stride * columns])
          for k, (rows, columns) in enumerate(found)]  # fmt: skip
    view, row, column = np.concatenate(at).T
    if not len(view):
        none = np.zeros((0, 3))
        return Looks(np.zeros(0, np.int64), none, none, none, np.zeros(0))
    centers, directions = look(cameras, view, np.column_stack([column, row]) + 0.5, poses)
    triangle, distance = scene.hit(centers, directions)
    facing = np.einsum("ri,ri->r", directions, scene.normals[triangle])
    kept = np.flatnonzero((triangle >= 0) & (np.abs(facing) > LEAST_FACING))
    points = centers[kept] + distance[kept, None] * directions[kept]
    clear = clear_of_edges(points, structure, _CLEAR_PX * cameras.footprint())
    kept, points = kept[clear], points[clear]
    grey = shown.luminance[view[kept], row[kept], column[kept]].astype(float)
    return Looks(scene.face[triangle[kept]], points, scene.normals[triangle[kept]], directions[kept], grey)


def clear_of_edges(points: Array, structure: Structure, distance: float) -> NDArray[np.bool_]:
    """(N,) which points (N, 3) lie at least so far from all edges, unit frame."""
    lines, apart = [np.zeros((0, 3))], distance / _CLEAR_PX
    for edge in structure.edges:
        steps = np.linalg.norm(np.diff(edge.polyline, axis=0), axis=1)
        lines.append(resample(edge.polyline, max(1, int(np.ceil(steps.sum() / apart)))))
    edges = np.concatenate(lines)
    if not len(edges):
        return np.ones(len(points), bool)
    return np.isinf(cKDTree(edges).query(points, distance_upper_bound=distance)[0])


def largest_areas(places: Indices, faces: int) -> Indices:
    """(F,) number of the largest connected set of (N, 4) places on each face, which their last column names."""
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
