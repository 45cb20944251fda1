"""Plain triangle meshes: subdivision, samples, nearest points, volume. Numpy only."""

import numpy as np
from numpy.typing import NDArray

# A stream of its own: with the truth's, equal triangles would get equal samples, and distances between the
# two clouds would come out below what independent samples give.
_STREAM = 1
Array = NDArray[np.float64]
Triangles = NDArray[np.int32]


def edges_of(triangles: Triangles) -> tuple[Triangles, NDArray[np.intp], NDArray[np.intp]]:
    """Distinct edges of triangles.

    Returns:
        (E, 2) vertex pairs, smaller first; (T, 3) index of sides 01, 12, 20; (E,) number of triangles at each.
    """
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].astype(np.int64), axis=2).reshape(-1, 2)
    base = int(sides.max(initial=0)) + 1
    keys, back, uses = np.unique(sides[:, 0] * base + sides[:, 1], return_inverse=True, return_counts=True)
    edges = np.column_stack([keys // base, keys % base]).astype(np.int32)
    return edges, back.reshape(-1, 3), uses


def subdivide(triangles: Triangles, middle: Triangles) -> Triangles:
    """Replace triangles whose sides have a middle vertex by two, three or four.

    Args:
        triangles: (T, 3) vertices; middle: (T, 3) vertex in the middle of sides 01, 12, 20, or -1.
    """
    count = (middle >= 0).sum(axis=1)
    result = [triangles[count == 0]]
    for shift in range(3):  # the one split side, or the one whole side, is turned to the front
        t, m = np.roll(triangles, -shift, axis=1), np.roll(middle, -shift, axis=1)
        one = (count == 1) & (m[:, 0] >= 0)
        (a, b, c), ab = t[one].T, m[one, 0]
        result += [np.column_stack([a, ab, c]), np.column_stack([ab, b, c])]
        two = (count == 2) & (m[:, 0] < 0)
        (a, b, c), bc, ca = t[two].T, m[two, 1], m[two, 2]
        result += [np.column_stack([a, b, bc]), np.column_stack([a, bc, ca]), np.column_stack([ca, bc, c])]
    (a, b, c), (ab, bc, ca) = triangles[count == 3].T, middle[count == 3].T
    corners = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([*result, *(np.column_stack(corner) for corner in corners)]).astype(np.int32)


def split_long(vertices: Array, triangles: Triangles, longest: float) -> tuple[Array, Triangles]:
    """Halve edges until none is longer than `longest`; the surface stays the same."""
    while True:
        edges, sides, _ = edges_of(triangles)
        long = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1) > longest
        if not long.any():
            return vertices, triangles
        new = np.full(len(edges), -1, np.int32)
        new[long] = len(vertices) + np.arange(np.count_nonzero(long))
        vertices = np.concatenate([vertices, vertices[edges[long]].mean(axis=1)])
        triangles = subdivide(triangles, new[sides])


def sample_triangles(
    vertices: Array, triangles: Triangles, count: int, seed: int
) -> tuple[Array, NDArray[np.int64], Array]:
    """Sample triangles uniformly by area.

    Returns:
        (N, 3) points, (N,) triangle of each, (N, 3) its barycentric coordinates.
    """
    cumulative = np.cumsum(areas(vertices, triangles))
    rng = np.random.default_rng([_STREAM, seed])
    # One sample in each of `count` equal shares of the area: every face gets its due to within one point.
    stratified = (np.arange(count) + rng.random(count)) / count * cumulative[-1]
    index = np.minimum(np.searchsorted(cumulative, stratified, side="right"), len(triangles) - 1)
    root, second = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.column_stack([1 - root, root * (1 - second), root * second])  # (N, 3)
    return np.einsum("nk,nkd->nd", weights, vertices[triangles[index]]), index, weights


def areas(vertices: Array, triangles: Triangles) -> Array:
    """(T,) areas."""
    return np.linalg.norm(_cross(vertices, triangles), axis=1) / 2


def normals(vertices: Array, triangles: Triangles) -> Array:
    """(T, 3) unit normals by the right-hand rule; zero for a triangle without area."""
    cross = _cross(vertices, triangles)
    length = np.linalg.norm(cross, axis=1, keepdims=True)
    return cross / np.where(length > 0, length, 1)


def volume(vertices: Array, triangles: Triangles) -> float:
    """Volume inside closed, outward-oriented triangles (divergence theorem)."""
    a, b, c = np.moveaxis(vertices[triangles] - vertices.mean(axis=0), 1, 0)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def distance_to(points: Array, corners: Array) -> Array:
    """(N,) distance of (N, 3) points to one triangle each, given by (N, 3, 3) corners."""
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    square = np.einsum("nd,nd->n", normal, normal)
    best = np.full(len(points), np.inf)
    inside = square > 0
    for p, q in ((a, b), (b, c), (c, a)):
        side, offset = q - p, points - p
        length = np.einsum("nd,nd->n", side, side)
        t = np.clip(np.einsum("nd,nd->n", offset, side) / np.where(length > 0, length, 1), 0, 1)
        best = np.minimum(best, np.linalg.norm(offset - t[:, None] * side, axis=1))
        inside &= np.einsum("nd,nd->n", np.cross(side, offset), normal) >= 0
    height = np.abs(np.einsum("nd,nd->n", points - a, normal)) / np.sqrt(np.where(square > 0, square, 1))
    return np.where(inside, height, best)


def _cross(vertices: Array, triangles: Triangles) -> Array:
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    return np.cross(b - a, c - a)
