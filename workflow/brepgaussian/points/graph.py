"""The graph of nodes: an even subset of the points and their neighbours, with what is known about each pair."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Graph:
    """Neighbouring nodes, each pair once.

    Attributes:
        pairs: (E, 2) node indices, first < second; distance: (E,) between them.
        same, both: (E,) votes: views where they share a region, views where both have one.
        extra: (E,) further evidence for (> 0) or against (< 0) a common patch.
    """

    pairs: Index
    distance: Array
    same: Array
    both: Array
    extra: Array

    def matrix(self, values: Array, count: int) -> csr_matrix:
        """Symmetric (count, count) sparse matrix of values per pair."""
        i, j = self.pairs.T
        rows, columns = np.concatenate([i, j]), np.concatenate([j, i])
        return coo_matrix((np.concatenate([values, values]), (rows, columns)), shape=(count, count)).tocsr()


def thin(xyz: Array, count: int) -> Index:
    """Indices of about `count` evenly spread points: one per cell of a grid, the one nearest to its middle."""
    if len(xyz) <= count:
        return np.arange(len(xyz))
    low, high = 1e-4, float(np.ptp(xyz, axis=0).max()) + 1e-9
    chosen = np.arange(min(count, len(xyz)))
    for _ in range(18):  # bisection on the cell's size
        size = np.sqrt(low * high)
        chosen = _one_per_cell(xyz, size)
        if abs(len(chosen) - count) < 0.02 * count:
            break
        low, high = (size, high) if len(chosen) > count else (low, size)
    return chosen


def _one_per_cell(xyz: Array, size: float) -> Index:
    scaled = (xyz - xyz.min(0)) / size
    cell = np.floor(scaled).astype(np.int64)
    off = ((scaled - cell - 0.5) ** 2).sum(1)
    key = (cell[:, 0] << 42) + (cell[:, 1] << 21) + cell[:, 2]
    order = np.lexsort((off, key))
    first = np.concatenate([[True], np.diff(key[order]) != 0])
    return np.sort(order[first])


def spacing_of(xyz: Array) -> float:
    """Typical distance to a neighbour: side of the square that stands for one point, from 6 neighbours."""
    if len(xyz) < 2:
        return 1.0
    k = min(7, len(xyz))
    distance = cKDTree(xyz).query(xyz, k=k)[0][:, -1]
    return float(max(np.median(distance) * np.sqrt(np.pi / (k - 1)), 1e-6))


def neighbour_pairs(xyz: Array, normals: Array, k: int) -> tuple[Index, Array]:
    """Pairs of nearest neighbours whose normals do not oppose (the two sides of a thin wall), first < second."""
    k = min(k + 1, len(xyz))
    if k < 2:
        return np.zeros((0, 2), np.int64), np.zeros(0)
    distance, index = cKDTree(xyz).query(xyz, k=k)
    i = np.repeat(np.arange(len(xyz)), k - 1)
    j, d = index[:, 1:].ravel(), distance[:, 1:].ravel()
    lower, upper = np.minimum(i, j), np.maximum(i, j)
    _, first = np.unique(lower * len(xyz) + upper, return_index=True)
    pairs, d = np.column_stack([lower, upper])[first], d[first]
    reach = 3.0 * float(np.median(d))  # a stray point far from all is no neighbour
    keep = (np.einsum("ij,ij->i", normals[pairs[:, 0]], normals[pairs[:, 1]]) > -0.3) & (d <= reach)
    keep &= pairs[:, 0] != pairs[:, 1]
    return pairs[keep], d[keep]


def components(pairs: Index, labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Split labels into connected parts: (N,) part of each node, -1 where the label is -1."""
    joined = (labels[pairs[:, 0]] == labels[pairs[:, 1]]) & (labels[pairs[:, 0]] >= 0)
    i, j = pairs[joined].T
    links = coo_matrix((np.ones(len(i)), (i, j)), shape=(len(labels), len(labels)))
    part = connected_components(links, directed=False)[1].astype(np.int64)
    part[labels < 0] = -1
    return compact(part)


def compact(labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Renumber labels consecutively from 0, keeping -1."""
    values, inverse = np.unique(labels, return_inverse=True)
    return inverse.reshape(labels.shape).astype(np.int64) - int(bool(len(values)) and values[0] < 0)


def largest_connected(graph: Graph, piece: Index, count: int) -> Index:
    """The largest connected part of some nodes, of `count` in all."""
    labels = np.full(count, -1)
    labels[piece] = 0
    pieces = components(graph.pairs, labels)[piece]
    return piece[pieces == np.bincount(pieces).argmax()]
