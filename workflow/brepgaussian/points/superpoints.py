"""Over-segmentation: greedy additive edge contraction (Keuper et al., ICCV 2015) with a bound on the bend."""

import heapq

import numpy as np
from numpy.typing import NDArray

from brepgaussian.points.graph import compact

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def contract(pairs: Index, weights: Array, normals: Array, bend: float) -> Index:
    """Join nodes along the edges of largest positive weight, summing parallel edges.

    Args:
        pairs: (E, 2) nodes; weights: (E,) attraction (> 0) or repulsion (< 0).
        normals: (N, 3) unit.
        bend: cosine; parts whose mean normals differ by more are never joined.

    Returns:
        (N,) part of each node, from 0.
    """
    count = len(normals)
    neighbours: list[dict[int, float]] = [{} for _ in range(count)]
    for (i, j), weight in zip(pairs.tolist(), weights.tolist(), strict=True):
        neighbours[i][j] = neighbours[j][i] = weight
    heap = [(-w, i, j) for (i, j), w in zip(pairs.tolist(), weights.tolist(), strict=True) if w > 0]
    heapq.heapify(heap)
    parent = list(range(count))
    total = [tuple(n) for n in normals.tolist()]
    while heap:
        negative, i, j = heapq.heappop(heap)
        if neighbours[i].get(j) != -negative or parent[i] != i or parent[j] != j:
            continue  # out of date
        a, b = total[i], total[j]
        dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        lengths = (a[0] ** 2 + a[1] ** 2 + a[2] ** 2) * (b[0] ** 2 + b[1] ** 2 + b[2] ** 2)
        if dot <= 0 or dot * dot < bend * bend * lengths:
            continue  # may be retried when one of them has grown and the edge has changed
        if len(neighbours[i]) < len(neighbours[j]):
            i, j = j, i
        parent[j] = i
        total[i] = (a[0] + b[0], a[1] + b[1], a[2] + b[2])
        mine, theirs = neighbours[i], neighbours[j]
        del mine[j], theirs[i]
        for other, weight in theirs.items():
            joint = mine.get(other, 0.0) + weight
            mine[other] = joint
            links = neighbours[other]
            del links[j]
            links[i] = joint
            if joint > 0:
                heapq.heappush(heap, (-joint, min(i, other), max(i, other)))
        neighbours[j] = {}
    root = np.arange(count)
    for node in range(count):
        top = node
        while parent[top] != top:
            top = parent[top]
        root[node] = top
    return compact(root)
