"""Surfels, masks and features to labelled samples: what stage 2 repairs masks with and the stage `points` refines."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.artifacts.stage1 import Evidence, Surfels
from brepgaussian.artifacts.views import Views
from brepgaussian.log import get_logger
from brepgaussian.points.batch_rows import evaluate
from brepgaussian.points.densify import Samples, densify
from brepgaussian.points.features import label_by_features
from brepgaussian.points.graph import Graph, Index, neighbour_pairs, spacing_of, thin
from brepgaussian.points.labels import Labelling, label_nodes
from brepgaussian.points.merge import Nodes
from brepgaussian.points.shading import gradients
from brepgaussian.points.votes import agreement, core, observe
from brepgaussian.settings.points import PointsSettings

Array = NDArray[np.float64]
log = get_logger("points")
_LEAST_VIEWS, _SAME_REGION = 3, 0.6  # views, and their share, in which neighbours lie in one region: no border between


@dataclass(frozen=True)
class Gathered:
    """Samples of surfels, and what is known about the nodes among them; labels follow from it.

    Attributes:
        samples: N samples, the surfels' centres first; spacing: typical distance between neighbours, unit frame.
        nodes: K samples on which labels are computed; node_spacing: between these; graph: of neighbouring nodes.
        features: (K, D) of the nodes' surfels, None where there are none yet.
        told: (K,) nodes that lie exactly on a wall which stage 1 has told.
    """

    samples: Samples
    spacing: float
    nodes: Nodes
    node_spacing: float
    graph: Graph
    features: NDArray[np.float32] | None
    told: NDArray[np.bool_]


@dataclass(frozen=True)
class Labelled:
    """Labels of gathered samples.

    Attributes:
        label: (N,) the samples' patches from 0, -1 = none.
        nodes: labels of the nodes and their primitives.
    """

    label: Index
    nodes: Labelling


def gather(
    views: Views,
    patches: NDArray[np.int16],
    surfels: Surfels,
    evidence: Evidence,
    settings: PointsSettings,
    features: NDArray[np.float32] | None = None,
) -> Gathered:
    """Sample the surfels and collect what views, features and stage 1 say about neighbouring samples.

    Args:
        views: images and cameras.
        patches: (V, H, W) region ids that vote, 0 = none.
        surfels: at least one.
        evidence: of stage 1, for the faces that it confirmed.
        settings: of the stage `points`.
        features: (N, D) of the surfels, or None where there are none yet; `labels: features` needs them.
    """
    samples = densify(surfels, settings)
    spacing = spacing_of(samples.xyz)
    centers = len(surfels.centers)  # one node a surfel: samples of one surfel share its errors
    chosen = thin(samples.xyz[:centers] if centers >= settings.nodes // 2 else samples.xyz, settings.nodes)
    log.info("%d surfels, %d points, %d nodes", len(surfels.centers), len(samples), len(chosen))
    xyz, normals = samples.xyz[chosen], samples.normals[chosen]
    pairs, distance = neighbour_pairs(xyz, normals, settings.neighbours)
    seen = observe(views, patches, xyz, normals, samples.xyz, spacing, settings.border_px)
    same, both = agreement(seen.regions, pairs)
    owner = samples.surfel[chosen]
    extra, told = np.zeros(len(pairs)), np.zeros(len(chosen), bool)
    if features is not None:
        extra = _features(features, owner, pairs) * settings.features_weight
    if len(evidence.face_id) == len(surfels.centers):
        extra = extra + _faces(evidence.face_id[owner], pairs) * settings.faces_weight
        told = evidence.face_id[owner] >= len(evidence.face_planes)  # lies exactly on a wall, close to edges or not
    graph = Graph(pairs, distance, same * settings.votes_weight, both * settings.votes_weight, extra)
    shared = np.where(both >= _LEAST_VIEWS, same / np.maximum(both, 1), 0.0)
    slopes = gradients(xyz, normals, seen.grey, pairs, np.where(shared > _SAME_REGION, shared, 0.0))
    sure = core(seen, pairs, shared > _SAME_REGION) | told
    wall = np.where(told, evidence.face_id[owner], -1) if told.any() else None
    nodes = Nodes(xyz, normals, np.where(told, 1.0, seen.trust), sure, seen.grey, slopes, wall)
    known = None if features is None else features[owner]
    return Gathered(samples, spacing, nodes, spacing_of(xyz), graph, known, told)


def label_samples(gathered: Gathered, settings: PointsSettings) -> Labelled:
    """Label the samples by patch."""
    nodes, graph = gathered.nodes, gathered.graph
    if settings.labels == "features" and gathered.features is not None:
        result = label_by_features(
            nodes, graph, gathered.features, settings.features_distance, settings.smallest_patch, settings.seed
        )
    else:
        result = label_nodes(nodes, graph, gathered.node_spacing, settings)
    return Labelled(spread(gathered.samples, nodes.xyz, result, gathered.node_spacing), result)


def same_patches(one: Index, other: Index) -> bool:
    """Whether two labellings (N,) have the same patches, but for points at their borders."""
    both = (one >= 0) & (other >= 0)
    if not both.any() or one.max() != other.max():
        return False
    shared = np.zeros((one.max() + 1, other.max() + 1), np.int64)
    np.add.at(shared, (one[both], other[both]), 1)
    return bool((shared.argmax(0)[shared.argmax(1)] == np.arange(len(shared))).all())  # each the other's largest part


def _features(features: NDArray[np.float32], owner: Index, pairs: Index) -> Array:
    """(E,) similarity of the stage-2 features, about -1 across patches and 0 within, relative to what is usual."""
    f = features[owner].astype(np.float64)
    f /= np.maximum(np.linalg.norm(f, axis=1, keepdims=True), 1e-9)
    cosine = np.einsum("ij,ij->i", f[pairs[:, 0]], f[pairs[:, 1]])
    return np.clip((cosine - 0.7) / 0.3, -1, 1) if len(pairs) and np.median(cosine) > 0.7 else np.zeros(len(pairs))


def _faces(face: NDArray[np.int32], pairs: Index) -> Array:
    """(E,) 1 within a face that stage 1 confirmed, -1 between two of them, else 0."""
    a, b = face[pairs[:, 0]], face[pairs[:, 1]]
    return np.where((a < 0) | (b < 0), 0.0, np.where(a == b, 1.0, -1.0))


def spread(samples: Samples, node_xyz: Array, result: Labelling, spacing: float) -> Index:
    """Labels of all points: of the labels of its nearest nodes, the one whose primitive is nearest."""
    k = min(6, len(node_xyz))
    distance, index = cKDTree(node_xyz).query(samples.xyz, k=k)
    distance, index = distance.reshape(len(samples), k), index.reshape(len(samples), k)
    candidates = result.labels[index]  # (N, k)
    cost = np.full((len(samples), k), np.inf)
    for label in range(len(result.models.kinds)):
        rows, columns = np.nonzero(candidates == label)
        if not len(rows):
            continue
        where = np.unique(rows)
        d, n = evaluate(str(result.models.kinds[label]), result.models.rows[label][None], samples.xyz[where][None])
        turn = ((n[0] - samples.normals[where]) ** 2).sum(1) / result.noise.normal**2
        value = 0.5 * np.minimum((d[0] / result.noise.distance) ** 2 + 0.3 * turn, 12.0)
        cost[rows, columns] = value[np.searchsorted(where, rows)]
    cost += 0.7 * (distance / spacing) ** 2
    best = candidates[np.arange(len(samples)), cost.argmin(1)]
    best[distance[:, 0] > 5 * spacing] = -1
    return best
