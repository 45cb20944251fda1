"""What points and silhouettes say about facets and cells."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.brep.cells import OUTSIDE, Arrangement
from brepgaussian.brep.offcuts import Offcut
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.silhouettes import Silhouettes

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_COLUMNS = 40  # a side, along each axis, for the volume samples of cells
_PIECES = 3  # volume samples on each column's stretch within a cell
_OFFSET = 0.37  # of a column in its grid square: keeps columns off walls at round coordinates
_LEAST_COSINE = 0.3  # between a point's normal and its facet's: a vote needs to know its side


@dataclass(frozen=True)
class Evidence:
    """Evidence in units of area (unit frame squared).

    Attributes:
        coverage: (F,) share of each facet within reach of its patch's points.
        outward: (F,) signed votes, positive where points say that the facet's normal points out.
        free: (C,) volume of each cell that some camera sees through.
        volume: (C,) volume of each cell as sampled.
    """

    coverage: Array
    outward: Array
    free: Array
    volume: Array


def gather(
    arrangement: Arrangement, patches: Sequence[Patch], silhouettes: Silhouettes | None, gone: Sequence[Offcut] = ()
) -> Evidence:
    """Collect all evidence; `gone` are the places that fillets, which are no patches, will take off or fill in."""
    count = len(arrangement.facets)
    covered, votes = np.zeros(count), np.zeros(count)
    sampled = np.bincount(arrangement.sample_facet, arrangement.sample_weight, count)
    on = _facets_by_patch(arrangement, len(patches))
    seen = np.zeros(len(arrangement.samples), bool)
    for index, patch in enumerate(patches):
        chosen = np.flatnonzero(np.isin(arrangement.sample_facet, on[index]))
        if not len(chosen) or patch.cap:
            continue
        reach = patch.reach + patch.sigma
        near = cKDTree(patch.xyz).query(arrangement.samples[chosen], distance_upper_bound=reach)[0] <= reach
        seen[chosen[near]] = True
        votes += _votes(arrangement, patch, chosen, near, count)
        beside = _beside(arrangement.samples[chosen], index, gone) & ~near
        seen[chosen[beside]] = True
        votes += _assumed(arrangement, patch, chosen[beside], count)
    np.add.at(covered, arrangement.sample_facet[seen], arrangement.sample_weight[seen])
    free, volume = cell_volumes(arrangement, silhouettes, gone)
    return Evidence(covered / np.maximum(sampled, 1e-300), votes, free, volume)


def _facets_by_patch(arrangement: Arrangement, patches: int) -> list[Indices]:
    found: list[list[int]] = [[] for _ in range(patches)]
    for facet, owners in enumerate(arrangement.origins):
        for owner in owners:
            found[owner].append(facet)
    return [np.array(f, np.int64) for f in found]


def _votes(arrangement: Arrangement, patch: Patch, chosen: Indices, near: NDArray[np.bool_], count: int) -> Array:
    """(F,) signed votes of one patch's points on its own facets; each stands for its share of the covered area."""
    limit = patch.reach + 3 * patch.sigma
    distance, nearest = cKDTree(arrangement.samples[chosen]).query(patch.xyz, distance_upper_bound=limit)
    hit = np.isfinite(distance)
    if not hit.any():
        return np.zeros(count)
    at = chosen[nearest[hit]]
    cosine = np.einsum("ij,ij->i", arrangement.sample_normals[at], patch.normals[hit])
    share = arrangement.sample_weight[chosen][near].sum() / len(patch.xyz)
    sure = np.abs(cosine) > _LEAST_COSINE
    return np.bincount(arrangement.sample_facet[at[sure]], np.sign(cosine[sure]) * share, count).astype(float)


def _beside(samples: Array, index: int, gone: Sequence[Offcut]) -> NDArray[np.bool_]:
    """(N,) which samples (N, 3) of a patch's facets lie between a fillet beside it and the sharp edge."""
    result = np.zeros(len(samples), bool)
    for place in (g for g in gone if index in g.owners):
        result |= place.holds(samples)
    return result


def _assumed(arrangement: Arrangement, patch: Patch, chosen: Indices, count: int) -> Array:
    """(F,) signed votes of samples that lie on a patch's face, though no points do."""
    normals = patch.surface.normals(arrangement.samples[chosen])
    side = np.sign(np.einsum("ij,ij->i", arrangement.sample_normals[chosen], normals))
    return np.bincount(arrangement.sample_facet[chosen], side * arrangement.sample_weight[chosen], count).astype(float)


def cell_volumes(
    arrangement: Arrangement, silhouettes: Silhouettes | None, gone: Sequence[Offcut] = ()
) -> tuple[Array, Array]:
    """(C,) volume seen through by a camera and (C,) whole volume of each cell, from columns along three axes.

    Where fillets will take something off (`gone`), cells are not seen through; where they will fill it in, they are.
    """
    free, volume = np.zeros(arrangement.cells), np.zeros(arrangement.cells)
    for axis in range(3):
        points, cell, weight = column_samples(arrangement, axis)
        volume += np.bincount(cell, weight, arrangement.cells) / 3
        if silhouettes is not None and len(points):
            empty = silhouettes.empty(points)
            for place in gone:
                empty[place.holds(points)] = not place.material
            free += np.bincount(cell, weight * empty, arrangement.cells) / 3
    return free, volume


def column_samples(arrangement: Arrangement, axis: int) -> tuple[Array, Indices, Array]:
    """Points inside cells along a grid of columns: (N, 3), (N,) cell, (N,) volume that each stands for.

    Between two neighbouring hits a column lies in the cell behind the first and before the second; where
    the two disagree (a graze), the stretch is dropped.
    """
    nodes, triangles = arrangement.nodes, arrangement.triangles
    across = [(axis + 1) % 3, (axis + 2) % 3]
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    step = (high - low)[across] / _COLUMNS
    corners = (nodes[triangles][:, :, across] - low[across]) / step - _OFFSET  # columns at integers
    column, height, source, rising = _hits(corners, nodes[triangles][:, :, axis])
    order = np.lexsort((source, height, column))
    column, height, source, rising = column[order], height[order], source[order], rising[order]
    facet = arrangement.triangle_facet[source]
    above = np.where(rising, arrangement.front[facet], arrangement.back[facet])
    below = np.where(rising, arrangement.back[facet], arrangement.front[facet])
    good = (column[:-1] == column[1:]) & (above[:-1] == below[1:]) & (above[:-1] != OUTSIDE)
    first = np.flatnonzero(good)
    bottom, top, cell = height[first], height[first + 1], above[first]
    places = (np.arange(_PIECES) + 0.5) / _PIECES
    along = bottom[:, None] + (top - bottom)[:, None] * places  # (S, P)
    points = np.empty((*along.shape, 3))
    grid = np.column_stack(np.divmod(column[first], _COLUMNS))
    points[..., across] = (low[across] + (grid + _OFFSET) * step)[:, None, :]
    points[..., axis] = along
    weight = np.repeat((top - bottom) * step[0] * step[1] / _PIECES, _PIECES)
    return points.reshape(-1, 3), np.repeat(cell, _PIECES), weight


def _hits(corners: Array, heights: Array) -> tuple[Indices, Array, Indices, NDArray[np.bool_]]:
    """Where columns at integer (i, j) pierce triangles: column, height, triangle, whether the normal rises."""
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    double = e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]
    low = np.maximum(np.ceil(corners.min(axis=1)), 0).astype(np.int64)
    high = np.minimum(np.floor(corners.max(axis=1)), _COLUMNS - 1).astype(np.int64)
    size = np.maximum(high - low + 1, 0)
    counts = np.where(np.abs(double) > 1e-12, size[:, 0] * size[:, 1], 0)
    source = np.repeat(np.arange(len(corners)), counts)
    order = np.arange(len(source)) - np.repeat(np.cumsum(counts) - counts, counts)
    i = low[source, 0] + order // np.maximum(size[source, 1], 1)
    j = low[source, 1] + order % np.maximum(size[source, 1], 1)
    dx, dy = i - corners[source, 0, 0], j - corners[source, 0, 1]
    a = (dx * e2[source, 1] - dy * e2[source, 0]) / double[source]
    b = (e1[source, 0] * dy - e1[source, 1] * dx) / double[source]
    inside = (a >= 0) & (b >= 0) & (a + b <= 1)
    source, a, b = source[inside], a[inside], b[inside]
    z = heights[source]
    height = z[:, 0] + a * (z[:, 1] - z[:, 0]) + b * (z[:, 2] - z[:, 0])
    return (i * _COLUMNS + j)[inside], height, source, double[source] > 0
