"""Planes that a curved label has swallowed: where images show no border, merging stops at what one primitive allows.

A plane and the fillet beside it may both lie near one torus. The graph cut knows better, but only chooses among the
labels that there are; here it gets the planes under curved labels as further ones (proposals, as PEARL has them).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.log import get_logger
from brepgaussian.points.batchfit import Noise
from brepgaussian.points.cut import REACH, STRAY, cut, data_costs, pair_weights, refit
from brepgaussian.points.graph import Graph, Index, largest_connected
from brepgaussian.points.merge import Models, Nodes, parts_of
from brepgaussian.points.pearl import expand
from brepgaussian.settings.points import PointsSettings

Array = NDArray[np.float64]
log = get_logger("points")

_GROWTH = 3  # expansions of a plane under a curved label
_UNCOVERED = 65.0  # what it must save beyond a label's cost: errors are smooth, a strip of any curved face saves some
_TRIALS = 64  # planes tried under a label
_SIGMAS = 2.0  # of the noise, for a node to lie on a plane
_ROUNDS, _FEW = 4, 12  # of refitting, and nodes from which on they tell the plane
_NEAR = 2.0  # spacings over which a trial's normal is averaged
_LEAST_SHARE = 0.15  # of a label's nodes on one plane: a small piece of any face is about flat
_MOST_SHARE = 0.8  # then the plane is the label
_TURNED = np.cos(np.radians(20.0))  # by which half of the other nodes face away from it: less is a bulging plane


def uncover_planes(
    nodes: Nodes, graph: Graph, labels: Index, noise: Noise, spacing: float, settings: PointsSettings
) -> Index:
    """The labels, with planes that curved ones had swallowed where all costs together are lower for it."""
    weights = pair_weights(graph)

    def cost(labels: Index, models: Models) -> float:
        data = data_costs(nodes, labels, models, noise, spacing)
        return _total(data, graph, weights, labels) + settings.label_cost * (labels.max() + 1)

    smallest, seed = settings.smallest_patch, settings.seed
    models = refit(nodes, labels, noise, seed)
    best = cost(labels, models)
    for piece in planar_pieces(nodes, graph, labels, models, noise, spacing, smallest, seed):
        new = labels.max() + 1
        found = labels.copy()
        found[piece] = new
        for _ in range(_GROWTH):  # before the cut, in which others would take the piece back
            data = data_costs(nodes, found, refit(nodes, found, noise, seed), noise, spacing)
            grown = expand(data, graph.pairs, weights, found, new, REACH)
            found = grown if len(np.unique(grown)) == len(np.unique(found)) else found
        found = cut(nodes, graph, found, refit(nodes, found, noise, seed), noise, spacing, settings.label_cost)
        if len(parts_of(found)) <= new:  # the piece, or a label, was dropped
            continue
        taken = np.flatnonzero(found == new)
        strays = np.setdiff1d(taken, largest_connected(graph, taken, len(found)))
        found[strays] = labels[strays]
        after = cost(found, refit(nodes, found, noise, seed))
        log.info("plane of %d nodes under label %d: cost %.1f for %.1f", len(piece), labels[piece[0]], after, best)
        if after < best - _UNCOVERED:
            labels, best = found, after
    return labels


def _total(data: Array, graph: Graph, weights: Array, labels: Index) -> float:
    """Costs of nodes and cut pairs."""
    known = labels >= 0
    chosen = np.where(known, np.minimum(data[np.arange(len(labels)), np.maximum(labels, 0)], STRAY), STRAY)
    one, other = labels[graph.pairs].T
    return float(chosen.sum() + weights[one != other].sum())


def planar_pieces(
    nodes: Nodes, graph: Graph, labels: Index, models: Models, noise: Noise, spacing: float, smallest: int, seed: int
) -> list[Index]:
    """Nodes of the largest plane under each curved label, where there is one.

    Args:
        nodes, graph: of the object.
        labels: (N,) from 0, -1 = none; models: one per label.
        noise: of the nodes; spacing: of the nodes, unit frame.
        smallest: nodes of a piece; seed: of the trials.
    """
    pieces = []
    rng = np.random.default_rng(seed)
    for k, part in enumerate(parts_of(labels)):
        if models.kinds[k] == "plane":
            continue
        piece = _largest_plane(nodes, part[nodes.core[part]], noise, spacing, rng)
        if len(piece) >= smallest:
            piece = largest_connected(graph, piece, len(labels))
        rest = np.setdiff1d(part, piece)
        if len(piece) >= smallest and _LEAST_SHARE <= len(piece) / len(part) < _MOST_SHARE:
            facing = nodes.normals[piece].mean(axis=0)
            if np.median(nodes.normals[rest] @ facing) < _TURNED * np.linalg.norm(facing):
                pieces.append(piece)
    return pieces


def _largest_plane(nodes: Nodes, part: Index, noise: Noise, spacing: float, rng: np.random.Generator) -> Index:
    """The nodes of a part that lie on one plane and face as it does, for the best of some planes through nodes."""
    best = np.zeros(0, np.int64)
    if not len(part):
        return best
    xyz, normals = nodes.xyz[part], nodes.normals[part]
    tree = cKDTree(xyz)
    for trial in rng.choice(len(part), min(_TRIALS, len(part)), replace=False):
        on = np.zeros(len(part), bool)
        on[tree.query_ball_point(xyz[trial], _NEAR * spacing)] = True
        for _ in range(_ROUNDS):
            middle = xyz[on].mean(axis=0)
            normal = normals[on].mean(axis=0)
            if on.sum() > _FEW:  # enough to tell the plane better than normals do
                axis = np.linalg.svd(xyz[on] - middle, full_matrices=False)[2][2]
                normal = axis * (1.0 if axis @ normal >= 0 else -1.0)
            normal = normal / max(float(np.linalg.norm(normal)), 1e-9)
            lies = np.abs((xyz - middle) @ normal) < _SIGMAS * noise.distance
            on = lies & (normals @ normal > np.cos(_SIGMAS * noise.normal))
            if on.sum() <= len(best) // 2:
                break
        if on.sum() > len(best):
            best = part[on]
    return best
