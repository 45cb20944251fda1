"""Faces that a label has swallowed: where images show no border, merging stops at what one primitive allows.

A plane and the fillet beside it may both lie near one torus. The graph cut knows better, but only chooses among the
labels that there are; here it gets the planes under curved labels as further ones (proposals, as PEARL has them).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.log import get_logger
from brepgaussian.points.batch_rows import evaluate
from brepgaussian.points.batchfit import Noise
from brepgaussian.points.cut import REACH, STRAY, cut, data_costs, pair_weights, refit
from brepgaussian.points.graph import Graph, Index, components, largest_connected
from brepgaussian.points.merge import Models, Nodes, parts_of
from brepgaussian.points.pearl import expand
from brepgaussian.points.superpoints import contract
from brepgaussian.settings.points import PointsSettings

Array = NDArray[np.float64]
log = get_logger("points")

_GROWTH = 3  # expansions of a plane under a curved label
_UNCOVERED = 65.0  # what it must save beyond a label's cost: errors are smooth, a strip of any curved face saves some
_TRIALS = 64  # planes tried under a label
_SIGMAS = 2.0  # of the noise, for a node to lie on a plane
_ROUNDS, _FEW = 4, 12  # of refitting, and nodes from which on they tell the plane
_OFF, _ACROSS = 3.0, np.cos(np.radians(45.0))  # of the noise, and of what turns a node, that no rounded edge has
_ONE_FACE = np.cos(np.radians(30.0))  # between neighbours of a strip: normals beside its edges are turned
_NEAR = 2.0  # spacings over which a trial's normal is averaged
_LEAST_SHARE = 0.15  # of a label's nodes on one plane: a small piece of any face is about flat
_MOSTLY = 0.5  # of a label's nodes, clear of borders: these tell a plane best
_MOST_SHARE = 0.8  # then the plane is the label
_TURNED = np.cos(np.radians(20.0))  # by which half of the other nodes face away from it: less is a bulging plane


def uncover_planes(
    nodes: Nodes, graph: Graph, labels: Index, noise: Noise, spacing: float, settings: PointsSettings
) -> Index:
    """The labels, with planes that curved ones had swallowed where all costs together are lower for it."""
    smallest, seed = settings.smallest_patch, settings.seed
    models = refit(nodes, labels, noise, seed)
    pieces = planar_pieces(nodes, graph, labels, models, noise, spacing, smallest, seed)
    return _with_pieces(pieces, _UNCOVERED, _speaking(nodes, pieces), graph, labels, noise, spacing, settings)


def uncover_strips(
    nodes: Nodes, graph: Graph, labels: Index, noise: Noise, spacing: float, settings: PointsSettings
) -> Index:
    """The labels, with the narrow faces that others had swallowed where all costs together are lower for it.

    On the edge faces of a sheet every node is near a border in most views, so that none speaks for a patch.
    """
    models = refit(nodes, labels, noise, settings.seed)
    pieces = turned_pieces(nodes, graph, labels, models, noise, settings.smallest_patch)
    return _with_pieces(pieces, 0.0, _speaking(nodes, pieces), graph, labels, noise, spacing, settings)


def _speaking(nodes: Nodes, pieces: list[Index]) -> Nodes:
    """Nodes of which those in pieces speak for a patch, however near a border they are."""
    speaking = nodes.core.copy()
    speaking[np.concatenate([np.zeros(0, np.int64), *pieces])] = True
    return replace(nodes, core=speaking)


def _with_pieces(
    pieces: list[Index],
    margin: float,
    nodes: Nodes,
    graph: Graph,
    labels: Index,
    noise: Noise,
    spacing: float,
    settings: PointsSettings,
) -> Index:
    """The labels, with those pieces as further ones that save `margin` beyond a label's cost."""
    weights, seed = pair_weights(graph), settings.seed

    def cost(labels: Index, models: Models) -> float:
        data = data_costs(nodes, labels, models, noise, spacing)
        return _total(data, graph, weights, labels) + settings.label_cost * (labels.max() + 1)

    best = cost(labels, refit(nodes, labels, noise, seed))
    for piece in pieces:
        new = labels.max() + 1
        found = labels.copy()
        found[piece] = new
        for _ in range(_GROWTH):  # before the cut, in which others would take the piece back
            data = data_costs(nodes, found, refit(nodes, found, noise, seed), noise, spacing)
            grown = expand(data, graph.pairs, weights, found, new, REACH)
            found = grown if len(np.unique(grown)) == len(np.unique(found)) else found
        after = cut(nodes, graph, found, refit(nodes, found, noise, seed), noise, spacing, settings.label_cost)
        found = _apart(graph, np.where(found == new, -1, found), after)
        if len(parts_of(found)) <= new:  # the piece, or a label, was dropped
            continue
        taken = np.flatnonzero(found == new)
        strays = np.setdiff1d(taken, largest_connected(graph, taken, len(found)))
        found[strays] = labels[strays]
        new_cost = cost(found, refit(nodes, found, noise, seed))
        log.info("plane of %d nodes under label %d: cost %.1f for %.1f", len(piece), labels[piece[0]], new_cost, best)
        if new_cost < best - margin:
            labels, best = found, new_cost
    return labels


def _apart(graph: Graph, before: Index, after: Index) -> Index:
    """Labels after a cut, with two faces of one surface apart as before: no node knows on which one it is."""
    result = after.copy()
    part = components(graph.pairs, after)
    for lost in np.setdiff1d(before[before >= 0], after):
        members = (before == lost) & (part >= 0)
        for k in np.unique(part[members]):
            inside = part == k
            if 2 * np.count_nonzero(inside & members) > np.count_nonzero(inside):
                result[inside] = lost
    return result


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
        core = part[nodes.core[part]]  # of two narrow faces under one label hardly any node is
        piece = _largest_plane(nodes, core if len(core) >= _MOSTLY * len(part) else part, noise, spacing, rng)
        if len(piece) >= smallest:
            piece = largest_connected(graph, piece, len(labels))
        rest = np.setdiff1d(part, piece)
        if len(piece) >= smallest and _LEAST_SHARE <= len(piece) / len(part) < _MOST_SHARE:
            facing = nodes.normals[piece].mean(axis=0)
            if np.median(nodes.normals[rest] @ facing) < _TURNED * np.linalg.norm(facing):
                pieces.append(piece)
    return pieces


def turned_pieces(
    nodes: Nodes, graph: Graph, labels: Index, models: Models, noise: Noise, smallest: int
) -> list[Index]:
    """Connected nodes of one direction that lie off their label's surface and face across it, largest first.

    Arguments are those of `planar_pieces`.
    """
    stray = np.zeros(len(labels), bool)
    for k, part in enumerate(parts_of(labels)):
        distance, normal = evaluate(str(models.kinds[k]), models.rows[k : k + 1], nodes.xyz[part][None])
        across = (normal[0] * nodes.normals[part]).sum(axis=1) < _ACROSS
        stray[part] = across & (np.abs(distance[0]) > _OFF * noise.distance)
    i, j = graph.pairs.T
    alike = (nodes.normals[i] * nodes.normals[j]).sum(axis=1) - _ONE_FACE
    both = stray[i] & stray[j]
    piece = np.where(stray, contract(graph.pairs[both], alike[both], nodes.normals, float(_ONE_FACE)), -1)
    found = [np.flatnonzero(piece == k) for k in np.unique(piece[stray])]
    return sorted((p for p in found if len(p) >= smallest), key=lambda p: (-len(p), int(p[0])))


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
