"""What the stage works on: the point cloud with its neighbourhoods, and patches of it with their surfaces."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from brepgaussian.artifacts.points import Points
from brepgaussian.geometry import independence
from brepgaussian.geometry.fit import residuals
from brepgaussian.geometry.fit_choose import CUT, EFFECTIVE, JUDGED, KEPT, TRIMMED
from brepgaussian.geometry.independence import own_among, shared_errors
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_ROUNDED = 2.0  # spacings from a curve within which points are rounded off
_INNER_SHARE, _INNER_COUNT = 0.5, 30  # of a patch's points that must be left without them
STRAY_SHARE = 0.03  # of a label: smaller islands are wrong labels
TOUCHING = 3  # neighbour pairs that make two patches adjacent
STRAY_COUNT = 8  # points; so are islands below this, unless the label is not much larger


@dataclass(frozen=True)
class Noise:
    """Noise of the points.

    Attributes:
        distance: in the unit frame, turn: of the normals in radians (both rms).
        own: share of the errors' variance that neighbours do not have in common, 0 = none (points of surfels).
    """

    distance: float
    turn: float
    own: float = 0.0


@dataclass(frozen=True)
class Cloud:
    """Labelled points in double precision with their neighbourhoods.

    Attributes:
        xyz, normals: (N, 3); label: (N,); edge: (N,) edge value in 0..1;
        neighbours: (N, K) indices of the nearest points; spacing: median distance to the nearest labelled point.
        inner: (N,) whether a point is far enough from the curves between the patches, or on one: surfels round
            sharp edges off, so what lies just beside them makes a torus of every chamfer.
    """

    xyz: Array
    normals: Array
    label: Indices
    edge: Array
    neighbours: Indices
    spacing: float
    inner: NDArray[np.bool_]


@dataclass(frozen=True)
class Patch:
    """Points of one face with the surface fitted to them.

    Attributes:
        labels: labels of `points.ply` that were joined in it, ascending.
        members: (M,) indices of its points, strays left out.
        surface: oriented surface.
        rms, turn: trimmed root mean squares of the members' distances and normal angles.
    """

    labels: tuple[int, ...]
    members: Indices
    surface: Surface
    rms: float
    turn: float

    def on(self, surface: Surface, cloud: Cloud) -> "Patch":
        """The same points with another surface."""
        rms, turn = spreads(surface, cloud, self.members)
        return replace(self, surface=surface, rms=rms, turn=turn)


def make_cloud(points: Points, neighbours: int) -> Cloud:
    """Double-precision copy of the points with their nearest neighbours."""
    xyz = points.xyz.astype(np.float64)
    normals = points.normals.astype(np.float64)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    label, edge = points.label.astype(np.int64), points.edge.astype(np.float64)
    count = min(neighbours, max(len(xyz) - 1, 0))
    if count == 0:
        return Cloud(xyz, normals, label, edge, np.zeros((len(xyz), 0), np.int64), 0.0, np.ones(len(xyz), bool))
    distance, index = cKDTree(xyz).query(xyz, k=count + 1)
    spacing = float(np.median(distance[:, 1]))
    inner = np.ones(len(xyz), bool)
    on_curve = points.curve >= 0
    if on_curve.any():
        far = cKDTree(xyz[on_curve]).query(xyz, distance_upper_bound=_ROUNDED * spacing)[0] == np.inf
        inner = far | on_curve
    return Cloud(xyz, normals, label, edge, index[:, 1:].astype(np.int64), spacing, inner)


def clear_of_edges(cloud: Cloud, members: Indices) -> Indices:
    """The members that are not rounded off, or all where too few are left."""
    inner = members[cloud.inner[members]]
    return inner if len(inner) >= max(_INNER_SHARE * len(members), _INNER_COUNT) else members


def islands(cloud: Cloud, members: Indices) -> list[Indices]:
    """Connected pieces of a set of points in the neighbour graph, largest first, ties by first index."""
    position = np.full(len(cloud.xyz), -1, np.int64)
    position[members] = np.arange(len(members))
    columns = position[cloud.neighbours[members]]
    row, k = np.nonzero(columns >= 0)
    graph = coo_matrix((np.ones(len(row), np.int8), (row, columns[row, k])), shape=(len(members),) * 2)
    number, piece = connected_components(graph, directed=False)
    pieces = [members[piece == i] for i in range(number)]
    return sorted(pieces, key=lambda p: (-len(p), int(p[0])))


def without_strays(cloud: Cloud, members: Indices) -> list[Indices]:
    """Islands of a label that are large enough to be part of a face, largest first."""
    pieces = islands(cloud, members)
    enough = max(STRAY_SHARE * len(members), min(STRAY_COUNT, 0.5 * len(members)))
    return [p for p in pieces if len(p) >= enough] or pieces[:1]


def contacts(cloud: Cloud, owner: Indices, count: int) -> NDArray[np.int64]:
    """(P, P) symmetric numbers of neighbour pairs between patches.

    Args:
        cloud: the points.
        owner: (N,) patch of each point, -1 for none.
        count: number of patches P.
    """
    first = np.repeat(owner, cloud.neighbours.shape[1])
    second = owner[cloud.neighbours].ravel()
    across = (first >= 0) & (second >= 0) & (first != second)
    table = np.zeros((count, count), np.int64)
    np.add.at(table, (first[across], second[across]), 1)
    return table + table.T


def adjacent(patches: Sequence[Patch], cloud: Cloud) -> NDArray[np.bool_]:
    """(P, P) symmetric: which patches touch."""
    return contacts(cloud, owners(patches, len(cloud.xyz)), len(patches)) >= TOUCHING


def owners(patches: Sequence[Patch], total: int) -> Indices:
    """(N,) index of the patch that holds each point, -1 for none."""
    owner = np.full(total, -1, np.int64)
    for i, patch in enumerate(patches):
        owner[patch.members] = i
    return owner


def spreads(surface: Surface, cloud: Cloud, members: Indices) -> tuple[float, float]:
    """Trimmed root mean squares of distances and angles, scaled to what Gaussian noise would give untrimmed."""
    distance, turn = residuals(surface, cloud.xyz[members], cloud.normals[members])
    return trimmed_rms(distance), trimmed_rms(turn)


def own_errors(patch: Patch, cloud: Cloud, noise: Noise) -> float:
    """Share of a patch's errors that is every point's own: they may be smooth where others' are not."""
    if noise.own == 0 or len(patch.members) < JUDGED:
        return 0.0
    cut = CUT * max(noise.distance, patch.rms)
    return own_among(noise.own, *shared_errors(patch.surface, cloud.xyz[patch.members], cut))


def observations(patch: Patch, cloud: Cloud, noise: Noise) -> float:
    """Number of independent observations of a patch's shape.

    Errors that neighbours have in common count as `EFFECTIVE` observations however many points there are.
    """
    return independence.observations(len(patch.members), own_errors(patch, cloud, noise), EFFECTIVE)


def trimmed_rms(values: Array) -> float:
    """Root mean square of the smallest `KEPT` share over `TRIMMED`: sigma of Gaussian values despite outliers."""
    count = max(1, int(np.ceil(KEPT * len(values))))
    return float(np.sqrt(np.mean(np.partition(values, count - 1)[:count] ** 2)) / TRIMMED)


def thinned(members: Indices, most: int) -> Indices:
    """At most `most` of the members, spread over their whole range by a fixed shuffle."""
    if len(members) <= most:
        return members
    return np.sort(np.random.default_rng(len(members)).choice(members, most, replace=False))
