"""Pieces of one surface whose connection is narrower than the points show: decided by the primitives.

Two pieces are one patch if a path on their common surface joins them without crossing a neighbouring
primitive, as where a chamfer gets narrow; pieces that meet in a point, or on both sides of a slot, stay two.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from brepgaussian.geometry.surfaces import Surface
from brepgaussian.points.graph import Index

Array = NDArray[np.float64]
_CELLS = 4.0  # test points per spacing
_AROUND = 3.0  # spacings beside the gap that a path may use
_SIDE = 5.0  # spacings around the gap in which nodes tell on which side of a neighbour the patch lies
_LEAST_SIDE = 3  # nodes
_ONE_SIDED = 0.8  # mean sign of the nodes' distances beyond which they all lie on one side


def joined(
    xyz: Array, labels: Index, one: int, other: int, surface: Surface, surfaces: list[Surface], spacing: float,
    margin: float,
) -> bool:  # fmt: skip
    """Whether two pieces of a surface are connected.

    Args:
        xyz: (N, 3) nodes; labels: (N,) their patches.
        one, other: the two pieces.
        surface: the primitive of both; surfaces: of all labels.
        spacing: of the nodes.
        margin: a path keeps this distance from every neighbour.
    """
    first, second = xyz[labels == one], xyz[labels == other]
    distance, index = cKDTree(second).query(first)
    i = int(distance.argmin())
    a, b = first[i], second[index[i]]
    middle, gap = (a + b) / 2, float(distance[i])
    grid = _patch(surface, middle, gap / 2 + _AROUND * spacing, spacing / _CELLS)
    near = np.linalg.norm(xyz - middle, axis=1) < gap / 2 + _SIDE * spacing
    own = near & ((labels == one) | (labels == other))
    free = np.ones(len(grid), bool)
    for k in np.unique(labels[near & (labels >= 0) & ~own]):
        side = surfaces[k].signed_distance(xyz[own])
        clear = side[np.abs(side) > margin]
        value = surfaces[k].signed_distance(grid)
        if len(clear) >= _LEAST_SIDE and abs(np.sign(clear).mean()) > _ONE_SIDED:
            free &= np.sign(np.median(clear)) * value > margin
        else:  # pieces on both sides: the neighbour is a wall between them as far as it reaches
            close = cKDTree(xyz[labels == k]).query(grid)[0] < _SIDE / 2 * spacing
            free &= ~(close & (np.abs(value) < max(margin, spacing / _CELLS)))
    if not free.any():
        return False
    path = grid[free]
    tree = cKDTree(path)
    links = tree.query_pairs(1.6 * spacing / _CELLS, output_type="ndarray")
    graph = coo_matrix((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(len(path), len(path)))
    part = connected_components(graph, directed=False)[1]
    ends = []
    for piece in (first, second):
        hits = tree.query(piece, distance_upper_bound=spacing / 2)
        ends.append(set(part[hits[1][np.isfinite(hits[0])]].tolist()))
    return bool(ends[0] & ends[1])


def _patch(surface: Surface, middle: Array, radius: float, step: float) -> Array:
    """An even grid of points of a surface around a point near it."""
    count = int(min(np.ceil(radius / step), 60))
    normal = surface.normals(surface.project(middle[None]))[0]
    helper = np.eye(3)[int(np.argmin(np.abs(normal)))]
    x = np.cross(helper, normal)
    x /= np.linalg.norm(x)
    y = np.cross(normal, x)
    u, v = np.meshgrid(*[np.arange(-count, count + 1) * step] * 2)
    keep = u**2 + v**2 <= radius**2
    flat = middle + u[keep][:, None] * x + v[keep][:, None] * y
    return surface.project(flat)
