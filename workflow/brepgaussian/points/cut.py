"""The graph cut over labels: what a label costs each node, what a border costs, and the primitives of the labels."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.points import batchfit
from brepgaussian.points.batch_rows import evaluate
from brepgaussian.points.batchfit import Noise
from brepgaussian.points.graph import Graph, Index
from brepgaussian.points.merge import KIND_PENALTY, Models, Nodes, Sampler, best_models, flattened, parts_of
from brepgaussian.points.pearl import alpha_expansion

Array = NDArray[np.float64]

REFIT_SAMPLE = 160
SHARE_NEUTRAL = 0.8  # of the votes of a border for one region
REACH = 6.0  # how much dearer a label may be for a node that joins an expansion
_EDGE_NORMALS = 0.25  # share of the normals' cost that is left at an edge
_EDGE_WEIGHT = 0.3  # of a node at an edge: rounded off, it lies on no patch
_NEAR = 4.0  # spacings from a node to the nearest node of a label that it may take
STRAY = 14.0  # cost of a node without a label
_SMOOTH, _SMOOTH_FLOOR = 0.6, 0.06  # cost of cutting a pair within a region, and across a border


def refit(nodes: Nodes, labels: Index, noise: Noise, seed: int) -> Models:
    """The primitive of each label, fitted twice: the second time without what the first explains badly."""
    parts = parts_of(labels)
    if not parts:
        return Models(np.zeros(0, "<U8"), np.zeros((0, 10)), np.zeros(0))
    sets = Sampler(nodes, seed)(parts, REFIT_SAMPLE)
    models = best_models(sets, noise)
    costs = np.concatenate(
        [
            batchfit.costs(str(models.kinds[k]), models.rows[k : k + 1], sets.take(np.array([k])), noise)
            for k in range(len(parts))
        ]
    )
    sets = sets.weighted(sets.weights * np.where(costs < 4.0, 1.0, 4.0 / np.maximum(costs, 4.0)))
    return flattened(sets, best_models(sets, noise), noise)


def cut(
    nodes: Nodes, graph: Graph, labels: Index, models: Models, noise: Noise, spacing: float, label_cost: float
) -> Index:
    """Graph cut over all labels, then labels that do not pay their cost are dropped."""
    data = data_costs(nodes, labels, models, noise, spacing)
    weights = pair_weights(graph)
    start = np.where(labels >= 0, labels, data.argmin(1))
    found = alpha_expansion(data, graph.pairs, weights, start, reach=REACH)
    return drop_labels(data, graph, weights, found, label_cost)


def data_costs(nodes: Nodes, labels: Index, models: Models, noise: Noise, spacing: float) -> Array:
    """(N, L) cost of each label for each node; beyond a label's neighbours it is prohibitive.

    Near edges the normals are blurred, so there the distance decides.
    """
    data = np.full((len(nodes.xyz), len(models.kinds)), 1e6)
    believe = np.where(nodes.core, _EDGE_NORMALS + (1 - _EDGE_NORMALS) * nodes.trust, 0.0)
    weigh = np.where(nodes.core, 1.0, _EDGE_WEIGHT)
    for k, (kind, row) in enumerate(zip(models.kinds, models.rows, strict=True)):
        members = nodes.xyz[labels == k]
        if not len(members):
            continue
        close = cKDTree(members).query(nodes.xyz, distance_upper_bound=_NEAR * spacing)[0] < np.inf
        around = np.bincount(labels[close & (labels >= 0)], minlength=len(models.kinds)) > 0
        near = np.flatnonzero(close | (around[labels] & (labels >= 0)))
        sets = nodes.sets(near[None], np.ones((1, len(near))))
        distance, normal = evaluate(str(kind), row[None], sets.points)
        turn = ((normal[0] - nodes.normals[near]) ** 2).sum(1) / noise.normal**2
        value = 0.5 * ((distance[0] / noise.distance) ** 2 + believe[near] * turn)
        value += 0.5 * believe[near] * batchfit.shading_costs(str(kind), row[None], sets, noise)[0]
        data[near, k] = weigh[near] * batchfit.soften(value) + KIND_PENALTY[str(kind)]
    return data


def pair_weights(graph: Graph) -> Array:
    """(E,) cost of cutting a pair: high where the images show one region, low across their borders."""
    share = (graph.same + 2 * SHARE_NEUTRAL) / (graph.both + 2)
    weight = _SMOOTH_FLOOR + _SMOOTH * np.clip((share - 0.2) / 0.8, 0, 1) ** 2
    near = np.median(graph.distance) / np.maximum(graph.distance, 1e-9) if len(graph.distance) else graph.distance
    return weight * np.clip(near, 0.3, 1.5) * np.exp(np.clip(graph.extra, -1.5, 0.5))


def drop_labels(data: Array, graph: Graph, weights: Array, labels: Index, label_cost: float) -> Index:
    """Drop labels, smallest first, that save less than a label costs."""
    sizes = np.bincount(labels, minlength=data.shape[1])
    links = graph.matrix(weights, len(labels))
    data = np.minimum(data, STRAY)
    for k in np.argsort(sizes, kind="stable"):
        members = np.flatnonzero(labels == k)
        if not len(members) or (labels[labels >= 0] == k).all():
            continue
        rivals = data[members].copy()
        rivals[:, k] = np.inf
        around = links[members].tocoo()
        other = labels[around.col]
        outside = (other != k) & (other >= 0)
        pull = np.zeros_like(rivals)
        np.add.at(pull, (around.row[outside], other[outside]), around.data[outside])
        choice = (rivals - pull).argmin(1)
        rows = np.arange(len(members))
        new, gain = rivals[rows, choice], pull[rows, choice]
        change = new.sum() - data[members, k].sum() - gain.sum()
        if change < label_cost:
            labels = labels.copy()
            labels[members] = np.where(new >= STRAY, -1, choice)
    return labels
