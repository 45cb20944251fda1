"""Open borders: where a patch's points end and no neighbour begins. Something is missing there."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.brep.patches import Patch, touch

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_WINDOW = 2.2  # of reach: holds about 30 points, random voids are rarely as wide
_GAP = np.radians(130.0)  # an empty sector this wide makes a border point (180 at a straight border, 70 inside)
_MOST_NEAR = 64  # neighbours looked at
_TOUCH = 2.0  # of reach: both patches may end this much short of their common edge
_LEAST_OPEN = 6  # a few stray border points open nothing


def open_points(patches: Sequence[Patch]) -> list[Indices]:
    """For each patch the indices of its points on an open border."""
    everything = np.concatenate([*(p.xyz for p in patches), np.zeros((0, 3))])
    owner = np.repeat(np.arange(len(patches)), [len(p.xyz) for p in patches])
    if not len(everything):
        return []
    tree = cKDTree(everything)
    result = []
    for index, patch in enumerate(patches):
        border = border_points(patch)
        limit = _TOUCH * patch.reach
        distance, near = tree.query(patch.xyz[border], min(_MOST_NEAR, len(everything)), distance_upper_bound=limit)
        found = np.isfinite(distance)
        other = owner[np.where(found, near, 0)] != index
        alone = border[~(found & other).reshape(len(border), -1).any(axis=1)]
        result.append(alone if len(alone) >= _LEAST_OPEN else alone[:0])
    return result


def continuing(patches: Sequence[Patch], borders: Sequence[Indices]) -> list[int]:
    """Patches that end where their neighbours' open borders begin: their surfaces pass through these.

    Half a chamfer ends in borders too short to be told from stray points; what it leaves open beside it is not.
    """
    open_ones = [(patch, patch.xyz[border]) for patch, border in zip(patches, borders, strict=True) if len(border)]
    return [
        index
        for index, patch in enumerate(patches)
        if not len(borders[index]) and any(_goes_on(patch, other, places) for other, places in open_ones)
    ]


def _goes_on(patch: Patch, other: Patch, places: Array) -> bool:
    """Whether a patch touches another one, and its surface passes through places (N, 3) on the other's border."""
    off = np.abs(patch.surface.signed_distance(places))
    return bool(np.sum(off <= max(patch.reach, other.reach)) >= _LEAST_OPEN) and touch(other, patch)


def border_points(patch: Patch) -> Indices:
    """Indices of the points of a patch with a wide empty sector around them, within the surface."""
    window = _WINDOW * patch.reach
    pairs = cKDTree(patch.xyz).query_pairs(window, output_type="ndarray")
    if not len(pairs):
        return np.arange(len(patch.xyz))
    both = np.concatenate([pairs, pairs[:, ::-1]])
    normals = patch.surface.normals(patch.xyz)
    helper = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    x = np.cross(helper, normals)
    x /= np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300)
    y = np.cross(normals, x)
    offset = patch.xyz[both[:, 1]] - patch.xyz[both[:, 0]]
    angle = np.arctan2(np.einsum("ij,ij->i", offset, y[both[:, 0]]), np.einsum("ij,ij->i", offset, x[both[:, 0]]))
    order = np.lexsort((angle, both[:, 0]))
    source, angle = both[order, 0], angle[order]
    first = np.append(True, source[1:] != source[:-1])
    start = np.flatnonzero(first)
    count = np.diff(np.append(start, len(source)))
    following = np.append(angle[1:], 0.0)
    last = start + count - 1
    following[last] = angle[start] + 2 * np.pi
    gap = np.full(len(patch.xyz), 2 * np.pi)
    gap[source[start]] = np.maximum.reduceat(following - angle, start)
    return np.flatnonzero(gap > _GAP)


def clusters(points: Array, distance: float) -> list[Indices]:
    """Groups of points that hang together by steps of at most `distance`, largest first."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    pairs = cKDTree(points).query_pairs(distance, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points),) * 2)
    count, label = connected_components(graph, directed=False)
    groups = [np.flatnonzero(label == k) for k in range(count)]
    return sorted(groups, key=lambda g: (-len(g), int(g[0])))
