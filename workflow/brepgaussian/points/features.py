"""Patch labels from the stage-2 features alone, as in the paper: for its tables, not for the default."""

import numpy as np
from numpy.typing import NDArray

from brepgaussian.log import get_logger
from brepgaussian.points.graph import Graph, Index
from brepgaussian.points.labels import Labelling, absorb, pair_noise, refit
from brepgaussian.points.merge import Nodes

log = get_logger("points")


def label_by_features(
    nodes: Nodes, graph: Graph, features: NDArray[np.float32], distance: float, smallest: int, seed: int
) -> Labelling:
    """Cluster the features of neighbouring nodes: average linkage on cosine distances, then small clusters go.

    Args:
        nodes, graph: the nodes and their neighbours.
        features: (N, D) of the nodes.
        distance: cosine distance at which clusters stay apart.
        smallest: nodes; smaller clusters are absorbed by their neighbours.
        seed: for the fits.
    """
    from sklearn.cluster import AgglomerativeClustering

    unit = features / np.maximum(np.linalg.norm(features, axis=1, keepdims=True), 1e-9)
    if len(unit) < 2 or not len(graph.pairs):
        labels = np.zeros(len(unit), np.int64)
    else:
        links = _linked(graph, len(unit))
        model = AgglomerativeClustering(
            n_clusters=None, metric="cosine", linkage="average", distance_threshold=distance, connectivity=links
        )
        labels = model.fit(unit.astype(np.float64)).labels_.astype(np.int64)
    labels = absorb(graph, labels, smallest)
    noise = pair_noise(nodes, graph)
    log.info("clusters of features: %d", labels.max() + 1)
    return Labelling(labels, refit(nodes, labels, noise, seed), noise)


def _linked(graph: Graph, count: int):  # type: ignore[no-untyped-def]
    """The neighbours as a connected graph: components are chained by weak links, which clustering asks for."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    matrix = graph.matrix(np.ones(len(graph.pairs)), count)
    _, part = connected_components(matrix, directed=False)
    first: Index = np.unique(part, return_index=True)[1]
    a, b = first[:-1], first[1:]
    chain = coo_matrix((np.ones(2 * len(a)), (np.concatenate([a, b]), np.concatenate([b, a]))), shape=matrix.shape)
    return (matrix + chain).tocsr()
