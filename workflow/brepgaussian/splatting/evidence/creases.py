"""Edges where surfels bend: most inner edges show no step in any image, but the faces beside them are known.

Two surfels near each other whose planes turn start a point on the line in which the planes meet. A quadratic
surface is then fitted to the surfels of either side, but for those next to the edge, which hulls and training round
off, and the point moves to where both surfaces meet. On a rounded edge the two surfaces are one, and nothing meets.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.evidence.edges import APART, EdgeCloud, one_a_cell
from brepgaussian.splatting.settle import tangents

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Array = NDArray[np.float64]
Floats = NDArray[np.floating]

# Lengths are in spacings of the surfels where nothing else is said.
_PAIR = 3.0  # surfels of a pair lie no farther apart, nor from the edge between them
_TURN = np.cos(np.radians(25.0))  # the sides of an edge turn by more
_START = 0.4  # between points that are started
_REACH = 4.5  # surfels within this give a side's surface
_MOST = 96  # of them
_SIDE = np.cos(np.radians(25.0))  # a surfel belongs to a side if its normal is within this
_ROUNDED, _RAMP = 1.2, 1.0  # surfels nearer to the edge than the first count little, then more
_LITTLE = 1e-3  # their weight: a narrow face has no others
_FALL = 2.5  # standard deviation of the weight that falls with the distance
_COUNTS = 1e-2  # weight from which a surfel is counted
_LEAST = 4  # surfels of a side
_FLAT, _CURVED = 4.0, 0.3  # how firmly the second derivatives are held at 0
_BENT = 0.5  # a side is curved where that leaves less than this share of the residual
_ROUNDS, _FITS = 4, 3
_OUTLIER = 4.0  # residuals, of their mean
_FINE = 1e-2  # below this no residual is an outlier
_PARALLEL = 0.98  # cosine; planes that turn by less are taken to turn by this: they meet far off
_MOVED = 1.0  # from where the point was started
_ROUGH = 0.002  # unit frame; mean residual of a side
_AROUND = 3.0  # surfels within this, those next to the edge left out, tell an edge from a bend
_EITHER = 0.3  # normals that turn so far from either side's, of the turn between both, are between them or beyond
_BETWEEN = 0.35  # most surfels with such normals: on a cylinder of small radius they are two thirds


def with_creases(views: Views, scene: Scene, centers: Floats, normals: Floats, cloud: EdgeCloud) -> EdgeCloud:
    """Add to an edge cloud the edges at which surfels bend, where it has none and two views or more look.

    Args:
        views: cameras.
        scene: the opened hull, which hides edges.
        centers: (N, 3) of surfels; normals: (N, 3) unit.
        cloud: edges that images show.
    """
    points, directions = creases(centers, normals)
    if not len(points):
        return cloud
    return cloud.completed(views.cameras, scene, points, directions)


def creases(centers: Floats, normals: Floats) -> tuple[Array, Array]:
    """(K, 3) points on the edges at which surfels bend, and (K, 3) unit tangents.

    Args:
        centers: (N, 3) of surfels; normals: (N, 3) unit.
    """
    from scipy.spatial import cKDTree

    nothing = np.zeros((0, 3)), np.zeros((0, 3))
    if len(centers) < _MOST:
        return nothing
    places, facing = np.asarray(centers, np.float64), np.asarray(normals, np.float64)
    tree = cKDTree(places)
    spacing = float(np.median(tree.query(places, k=2)[0][:, 1]))
    if spacing == 0:
        return nothing
    start, pair = _pairs(tree, places, facing, spacing)
    chosen = one_a_cell(start, _START * spacing)
    start, first, second = start[chosen], facing[pair[chosen, 0]], facing[pair[chosen, 1]]
    if not len(start):
        return nothing
    points = start
    for _ in range(_ROUNDS):
        near = _Near.of(points, tree, places, facing, spacing)
        one, other = near.side(first), near.side(second)
        first, second = one.normal, other.normal
        points = points + np.clip(_onto_both(first, second, one.below, other.below), -spacing, spacing)
    good = (np.minimum(one.count, other.count) >= _LEAST) & (np.maximum(one.residual, other.residual) < _ROUGH)
    good &= np.abs(np.einsum("ni,ni->n", first, second)) < _TURN
    good &= np.linalg.norm(points - start, axis=1) < _MOVED * spacing
    good &= near.between(first, second) < _BETWEEN
    points, tangents = points[good], np.cross(first[good], second[good])
    kept = one_a_cell(points, APART)
    return points[kept], tangents[kept] / np.linalg.norm(tangents[kept], axis=1, keepdims=True)


def _pairs(tree: "cKDTree", centers: Array, normals: Array, spacing: float) -> tuple[Array, NDArray[np.int64]]:
    """(P, 3) where the planes of near surfels meet, next to their middle, and (P, 2) indices of the two."""
    i, j = tree.query_pairs(_PAIR * spacing, output_type="ndarray").T
    cosine = np.einsum("ni,ni->n", normals[i], normals[j])
    turned = np.abs(cosine) < _TURN
    i, j = i[turned], j[turned]
    middle = (centers[i] + centers[j]) / 2
    below = (np.einsum("ni,ni->n", normals[k], centers[k] - middle) for k in (i, j))
    points = middle + _onto_both(normals[i], normals[j], *below)
    far = np.maximum(np.linalg.norm(points - centers[i], axis=1), np.linalg.norm(points - centers[j], axis=1))
    near = far < _PAIR * spacing
    return points[near], np.column_stack([i[near], j[near]])


@dataclass(frozen=True)
class _Side:
    """The surface to one side of each point: its (M, 3) unit normal there, how far the point lies below it (M,), unit
    frame, how many surfels tell (M,) and their mean residual (M,), unit frame."""

    normal: Array
    below: Array
    count: NDArray[np.int64]
    residual: Array


@dataclass(frozen=True)
class _Near:
    """Surfels around each point: (M, K, 3) offsets, (M, K) distances, both in spacings, (M, K, 3) normals, weights."""

    offsets: Array
    normals: Array
    distances: Array
    weights: Array
    spacing: float

    @staticmethod
    def of(points: Array, tree: "cKDTree", centers: Array, normals: Array, spacing: float) -> "_Near":
        distance, index = tree.query(points, k=_MOST)
        offsets = (centers[index] - points[:, None]) / spacing
        distance = distance / spacing
        ramp = np.clip((distance - _ROUNDED) / _RAMP, 0, 1) ** 2 + _LITTLE
        weights = (distance < _REACH) * np.exp(-(distance**2) / (2 * _FALL**2)) * ramp
        return _Near(offsets, normals[index], distance, weights, spacing)

    def between(self, first: Array, second: Array) -> Array:
        """(M,) share of the surfels around whose normals are neither of both, but between them or beyond."""
        around = (self.distances > 1) & (self.distances < _AROUND)
        turn = np.maximum(1 - np.einsum("ni,ni->n", first, second), 1e-9)[:, None]
        share = np.einsum("mki,mi->mk", self.normals, second - first) / turn  # 1 or -1 on the sides
        strange = around & (np.abs(np.abs(share) - 1) > _EITHER)
        return np.asarray(strange.sum(axis=1) / np.maximum(around.sum(axis=1), 1))

    def side(self, normal: Array) -> _Side:
        """The quadratic surface through those surfels whose normals are about (M, 3) `normal`."""
        weight = self.weights * (np.einsum("mki,mi->mk", self.normals, normal) > _SIDE)
        mean = np.einsum("mk,mki->mi", weight, self.normals)
        length = np.linalg.norm(mean, axis=1, keepdims=True)
        mean = np.where(length > 1e-9, mean / np.maximum(length, 1e-9), normal)
        first, second = tangents(mean)
        u, v, z = (np.einsum("mki,mi->mk", self.offsets, axis) for axis in (first, second, mean))
        flat, flat_residual = _fitted(u, v, z, weight, _FLAT)
        bent, bent_residual = _fitted(u, v, z, weight, _CURVED)
        curved = bent_residual < _BENT * flat_residual
        height, slope_u, slope_v = np.where(curved[:, None], bent, flat).T[:3, :, None]
        steep = mean - slope_u * first - slope_v * second
        length = np.linalg.norm(steep, axis=1, keepdims=True)
        residual = np.where(curved, bent_residual, flat_residual) * self.spacing
        return _Side(steep / length, (height / length)[:, 0] * self.spacing, (weight > _COUNTS).sum(axis=1), residual)


def _fitted(u: Array, v: Array, z: Array, weight: Array, stiff: float) -> tuple[Array, Array]:
    """(M, 6) Taylor coefficients of the height over the point, and (M,) mean residuals; robust least squares."""
    terms = np.stack([np.ones_like(u), u, v, u * u / 2, u * v, v * v / 2], axis=-1)  # (M, K, 6)
    hold = np.diag([1e-9, 1e-3, 1e-3, stiff, stiff, stiff])
    trusted, total = weight, np.maximum(weight.sum(axis=1), 1e-9)
    for _ in range(_FITS):
        weighted = (trusted[..., None] * terms).transpose(0, 2, 1)  # (M, 6, K)
        fit = np.linalg.solve(weighted @ terms + hold, weighted @ z[..., None])
        residual = np.abs(z - (terms @ fit)[..., 0])
        mean: Array = np.einsum("mk,mk->m", weight, residual) / total
        trusted = weight * np.clip(1 - (residual / (_OUTLIER * mean[:, None] + _FINE)) ** 2, 0, None) ** 2
    return np.asarray(fit[..., 0], np.float64), mean


def _onto_both(first: Array, second: Array, below: Array, other_below: Array) -> Array:
    """(M, 3) the shortest way from points onto two planes each, of unit normals (M, 3), which they lie below (M,)."""
    cosine = np.clip(np.einsum("ni,ni->n", first, second), -_PARALLEL, _PARALLEL)
    square = 1 - cosine**2
    along, across = (below - cosine * other_below) / square, (other_below - cosine * below) / square
    return np.asarray(along[:, None] * first + across[:, None] * second)
