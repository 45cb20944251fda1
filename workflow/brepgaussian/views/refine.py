"""Splitting of triangles until no edge is longer than a limit, so that light can vary within a face."""

import numpy as np
from numpy.typing import NDArray

from brepgaussian.views.mesh import FaceMesh

Array = NDArray[np.float64]
_ROUNDS = 24  # each halves the longest edge


def split_long_edges(mesh: FaceMesh, limit: float) -> FaceMesh:
    """A conforming refinement: every edge longer than `limit` (unit frame) gets its middle as a vertex.

    Triangles with one, two or three split edges become two, three or four, so long thin triangles are cut
    across and not into ever thinner ones. New vertices lie on the old triangles.
    """
    vertices, triangles = mesh.vertices, mesh.triangles.astype(np.int64)
    face, normals = mesh.triangle_face, mesh.corner_normals
    for _ in range(_ROUNDS):
        ends = np.roll(triangles, -1, axis=1)
        long = np.linalg.norm(vertices[triangles] - vertices[ends], axis=2) > limit  # (T, 3)
        if not long.any():
            break
        low, high = np.minimum(triangles, ends)[long], np.maximum(triangles, ends)[long]
        unique, inverse = np.unique(low * len(vertices) + high, return_inverse=True)
        middle = np.full(triangles.shape, -1, np.int64)
        middle[long] = len(vertices) + inverse
        pairs = np.column_stack([unique // len(vertices), unique % len(vertices)])
        vertices = np.concatenate([vertices, vertices[pairs].mean(axis=1)])
        triangles, face, normals = _split(triangles, face, normals, middle)
    return FaceMesh(vertices, triangles.astype(np.int32), face, normals, mesh.surfaces)


def _split(
    triangles: NDArray[np.int64],
    face: NDArray[np.int32],
    normals: Array,
    middle: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int32], Array]:
    """Split by the vertex in the middle of edge k (from corner k to k + 1) of each triangle, -1 for none."""
    has = middle >= 0
    count = has.sum(axis=1)
    # Turn each triangle so that its pattern starts at corner 0: the one split edge, or the two, or any.
    start = np.where(count == 2, np.argmin(has, axis=1) + 1, np.argmax(has, axis=1)) % 3
    turn = (start[:, None] + np.arange(3)) % 3
    t, m = np.take_along_axis(triangles, turn, 1), np.take_along_axis(middle, turn, 1)
    n = np.take_along_axis(normals, turn[:, :, None], 1)
    h = n + np.roll(n, -1, axis=1)  # normals in the middle of edge k
    h /= np.maximum(np.linalg.norm(h, axis=2, keepdims=True), 1e-300)
    node, normal = np.concatenate([t, m], axis=1), np.concatenate([n, h], axis=1)  # corners 0..2, middles 3..5
    patterns = {
        0: ((0, 1, 2),),
        1: ((0, 3, 2), (3, 1, 2)),
        2: ((3, 1, 4), (0, 3, 4), (0, 4, 2)),
        3: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    }
    shapes = [(k, np.flatnonzero(count == k), list(p)) for k, pattern in patterns.items() for p in pattern]
    return (
        np.concatenate([node[rows][:, p] for _, rows, p in shapes]),
        np.concatenate([face[rows] for _, rows, _ in shapes]),
        np.concatenate([normal[rows][:, p] for _, rows, p in shapes]),
    )
