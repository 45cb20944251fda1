"""Surfels spread evenly over a hull, closer where it has faces so small that few of them would lie there."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

if TYPE_CHECKING:
    from brepgaussian.splatting.hull import Hull

Array = NDArray[np.float64]

_PACKING = 0.47  # share of the surface under disks of half the distance that dart throwing reaches (measured)
_OVERSAMPLING = 12  # candidates per kept point when spreading points evenly
_ENOUGH = 30  # points on a face: so many outweigh what a label of its own has to save
_ACROSS = 3.0  # points side by side on a strip: with fewer, most of them reach beyond its edges
_CLOSEST = 0.5  # of the usual distance: below that, points are closer than hull's vertices
_SPECK = 2.0  # points' areas: what is smaller is an unevenness of the hull
_SMOOTH_DEG = 15.0  # between normals of neighbouring vertices of one face


def spread(hull: "Hull", count: int, seed: int) -> tuple[Array, Array, float]:
    """About `count` evenly spaced points on the hull: (N, 3) positions, (N, 3) normals, and their distance.

    Dart throwing (Poisson disks) among samples uniform by area; a disk that would touch a kept one is dropped.
    """
    points, normals, distances = _thrown(hull, count, np.ones(len(hull.triangles)), seed)
    return points, normals, float(distances[0])


def spread_closer(hull: "Hull", count: int, seed: int) -> tuple[Array, Array, Array]:
    """As `spread`, but closer on small faces; (N,) distances, one for each point.

    Where no face is small, just what `spread` gives.
    """
    areas, widths = faces_of(hull)
    whole = _areas(hull).sum()
    points = areas * (count / whole)  # (T,) that its face would get
    across = widths / _distance(whole, count)
    share = np.where(
        points < _SPECK, 1.0, np.clip(np.minimum(np.sqrt(points / _ENOUGH), across / _ACROSS), _CLOSEST, 1.0)
    )
    return _thrown(hull, count, share, seed)


def faces_of(hull: "Hull") -> tuple[Array, Array]:
    """(T,) area and (T,) mean width of the smooth face that each triangle of the hull lies on; infinite at edges.

    A face's inside is what joins vertices all of whose neighbours have their direction; so the rows of vertices
    along an edge, whose normals lie between those of its faces, are none. A strip is as wide as twice its area over
    its perimeter.
    """
    count, triangles = len(hull.vertices), hull.triangles
    i, j = _sides(triangles).T
    alike = np.einsum("ec,ec->e", hull.normals[i], hull.normals[j]) > np.cos(np.radians(_SMOOTH_DEG))
    inside = np.ones(count, bool)
    inside[i[~alike]] = inside[j[~alike]] = False
    within = inside[i] & inside[j]
    links = coo_matrix((np.ones(within.sum()), (i[within], j[within])), shape=(count, count))
    part = connected_components(links, directed=False)[1]
    part[~inside] = -1
    of_triangle = part[triangles].max(1)  # those around its inside belong to a face too
    areas = np.bincount(of_triangle + 1, _areas(hull))
    border = _borders(triangles, of_triangle)
    length = np.linalg.norm(hull.vertices[border[:, 0]] - hull.vertices[border[:, 1]], axis=1)
    around = np.bincount(border[:, 2] + 1, length, len(areas))
    areas[0] = np.inf
    widths = 2 * areas / np.maximum(around, np.finfo(float).tiny)
    return areas[of_triangle + 1], widths[of_triangle + 1]


def _borders(triangles: NDArray[np.int64], part: NDArray[np.integer]) -> NDArray[np.int64]:
    """(E, 3) edges between triangles of different parts (T,): both ends and one of the parts, once for each of them."""
    ends, owner = np.sort(_sides(triangles), axis=1), np.tile(part, 3)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    ends, owner = ends[order], owner[order]
    same = (ends[1:] == ends[:-1]).all(axis=1) & (owner[1:] == owner[:-1])
    inner = np.zeros(len(ends), bool)
    inner[1:] |= same
    inner[:-1] |= same
    return np.column_stack([ends[~inner], owner[~inner]])


def _sides(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """(3 T, 2) ends of the triangles' sides: all first ones, all second ones, all third ones."""
    return np.concatenate([triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])


def _areas(hull: "Hull") -> Array:
    """(T,) of the triangles."""
    a, b, c = (hull.vertices[hull.triangles[:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def _distance(area: float, count: int) -> float:
    """Distance of so many points that are spread evenly over an area."""
    return float(np.sqrt(_PACKING * area / count * 4 / np.pi))


def _thrown(hull: "Hull", count: int, share: Array, seed: int) -> tuple[Array, Array, Array]:
    """Points, normals, and distances, which on each triangle are a `share` (T,) of the usual one."""
    from scipy.spatial import cKDTree

    rng = np.random.default_rng(seed)
    areas = _areas(hull)
    wanted = areas / share**2
    draws = round(count * _OVERSAMPLING * (wanted.sum() / areas.sum()))
    chosen = rng.choice(len(areas), draws, p=wanted / wanted.sum())
    u, v = rng.random((2, len(chosen)))
    flip = u + v > 1
    u[flip], v[flip] = 1 - u[flip], 1 - v[flip]
    weights = np.stack([1 - u - v, u, v], axis=1)  # (M, 3) barycentric
    points = np.einsum("mk,mkc->mc", weights, hull.vertices[hull.triangles[chosen]])
    normals = np.einsum("mk,mkc->mc", weights, hull.normals[hull.triangles[chosen]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    radius = _distance(areas.sum(), count)
    pairs = cKDTree(points).query_pairs(radius, output_type="ndarray")
    radii = radius * share[chosen]
    if (share < 1).any():
        apart = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
        pairs = pairs[apart <= radii[pairs].min(1)]
    kept = _dart_throwing(len(points), pairs)
    return points[kept], normals[kept], radii[kept]


def _dart_throwing(count: int, pairs: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Keep points in their order, each one dropping the later ones that are paired with it."""
    pairs = np.sort(pairs, axis=1)
    pairs = pairs[np.argsort(pairs[:, 0], kind="stable")]
    starts = np.searchsorted(pairs[:, 0], np.arange(count + 1))
    later = pairs[:, 1]
    kept = np.ones(count, bool)
    for i in range(count):
        if kept[i]:
            kept[later[starts[i] : starts[i + 1]]] = False
    return kept
