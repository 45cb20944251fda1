"""Patch labels from all evidence: votes of the masks, normals, primitives, features; their number is unknown.

Recipe: superpoints by greedy contraction, merged while one primitive explains both, then labels and
primitives in turns by graph cut, merged again; the noise is estimated in between.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.geometry.surfaces import Surface, surface_from_row
from brepgaussian.log import get_logger
from brepgaussian.points import batchfit
from brepgaussian.points.batch_rows import evaluate
from brepgaussian.points.batchfit import Noise
from brepgaussian.points.bridges import joined
from brepgaussian.points.cut import REFIT_SAMPLE, SHARE_NEUTRAL, cut, refit
from brepgaussian.points.graph import Graph, Index, compact, components
from brepgaussian.points.merge import Merger, Models, Nodes, Sampler, best_models, parts_of
from brepgaussian.points.shading import fit_shading
from brepgaussian.points.split import uncover_planes, uncover_strips
from brepgaussian.points.superpoints import contract
from brepgaussian.settings.points import PointsSettings

Array = NDArray[np.float64]
log = get_logger("points")

NOISE_FLOOR = Noise(0.0015, np.radians(2.5))  # smooth errors that the scatter about a primitive does not show
NOISE_CEILING = Noise(0.006, np.radians(8.0))
_PAIR_TO_SURFACE = 2.0  # smooth errors: a patch deviates by more than neighbours differ
_TURN = np.radians(9.0)  # a turn between neighbours that speaks neither for nor against one patch
_BEND = np.cos(np.radians(11.0))  # parts of a superpoint agree this well, so a fillet starts as strips
_NORMAL_WEIGHT, _FULL_VIEWS = 1.5, 8.0
_QUANTILE = 0.7  # of the residuals that tell the noise
_NORMAL_QUANTILE, _RAYLEIGH_QUANTILE = 1.0364, 1.5518  # of |x| and of the length of a 2D vector, unit sigma
_GRADIENT_FLOOR = 20.0  # grey levels per unit length: light from neighbouring faces
_LARGE = 40  # nodes of a part that tells about the noise
_BRIDGE = 6.0  # spacings over which pieces of one surface are tried as one patch
_CLEARANCE = 0.3  # of the noise: primitives of many points lie this well


@dataclass(frozen=True)
class Labelling:
    """Labels of nodes and their primitives.

    Attributes:
        labels: (N,) from 0, -1 = none.
        models: one per label.
        noise: the final estimate.
    """

    labels: Index
    models: Models
    noise: Noise


def label_nodes(nodes: Nodes, graph: Graph, spacing: float, settings: PointsSettings) -> Labelling:
    """Label nodes of an object with an unknown number of patches."""
    smallest, seed = settings.smallest_patch, settings.seed
    noise = pair_noise(nodes, graph)
    inner = nodes.core[graph.pairs].all(1)
    labels = contract(graph.pairs[inner], affinity(nodes, graph)[inner], nodes.normals, float(_BEND))
    labels = _with_walls(nodes, graph, _drop_small(np.where(nodes.core, labels, -1), 3))
    log.info("superpoints: %d, noise %.4f, %.1f deg", labels.max() + 1, noise.distance, np.degrees(noise.normal))
    if labels.max(initial=-1) < 0:  # too few nodes for parts: one patch per connected piece, or one at all
        labels = _drop_small(components(graph.pairs, np.zeros(len(nodes.xyz), np.int64)), 3)
    if labels.max(initial=-1) < 0:
        labels = np.zeros(len(nodes.xyz), np.int64)
    noise = surface_noise(nodes, labels, noise, seed)
    labels = Merger(nodes, graph, labels, noise, seed).run()
    noise = surface_noise(nodes, labels, noise, seed)
    log.info("merged: %d parts, noise %.4f, %.1f deg", labels.max() + 1, noise.distance, np.degrees(noise.normal))
    models = Models(np.zeros(0, "<U8"), np.zeros((0, 10)), np.zeros(0))
    for turn in range(3):
        large = _drop_small(labels, smallest)
        labels = large if large.max() >= 0 else labels
        labels = Merger(nodes, _bridged(nodes, graph, labels, spacing), labels, noise, seed).run()
        models = refit(nodes, labels, noise, seed)
        labels = cut(nodes, graph, labels, models, noise, spacing, settings.label_cost)
        labels = compact(components(graph.pairs, labels))
        labels = absorb(graph, labels, smallest)
        if turn < 2:
            labels = Merger(nodes, graph, labels, noise, seed).run()
        log.info("cut %d: %d labels", turn, labels.max() + 1)
    labels = join_pieces(nodes, graph, labels, noise, spacing, seed)
    labels = uncover_planes(nodes, graph, labels, noise, spacing, settings)
    labels = uncover_strips(nodes, graph, labels, noise, spacing, settings)
    models = refit(nodes, labels, noise, seed)
    return Labelling(labels, models, noise)


def join_pieces(nodes: Nodes, graph: Graph, labels: Index, noise: Noise, spacing: float, seed: int) -> Index:
    """One label for the pieces of one surface that are connected more narrowly than the nodes show."""
    groups = Merger(nodes, _bridged(nodes, graph, labels, spacing), labels, noise, seed).run()
    surfaces = _surfaces(refit(nodes, labels, noise, seed))
    shared = _surfaces(refit(nodes, groups, noise, seed))
    parent = np.arange(labels.max() + 1)
    for group in range(groups.max() + 1):
        members = np.unique(labels[(groups == group) & (labels >= 0)])
        for a in members:
            for b in members[members > a]:
                distance = cKDTree(nodes.xyz[labels == a]).query(nodes.xyz[labels == b])[0].min()
                if parent[a] != parent[b] and distance < _BRIDGE * spacing:
                    margin = _CLEARANCE * noise.distance
                    if joined(nodes.xyz, labels, int(a), int(b), shared[group], surfaces, spacing, margin):
                        parent[parent == parent[b]] = parent[a]
    return compact(np.where(labels >= 0, parent[np.maximum(labels, 0)], -1))


def _surfaces(models: Models) -> list[Surface]:
    return [surface_from_row(str(kind), row) for kind, row in zip(models.kinds, models.rows, strict=True)]


def _bridged(nodes: Nodes, graph: Graph, labels: Index, spacing: float) -> Graph:
    """The graph with links over the gaps between near parts, so that pieces of one surface can share a label."""
    labelled = np.flatnonzero(labels >= 0)
    links = []
    for k, part in enumerate(parts_of(labels)):
        rest = labelled[labels[labelled] > k]
        if not len(rest):
            continue
        distance, index = cKDTree(nodes.xyz[part]).query(nodes.xyz[rest], distance_upper_bound=_BRIDGE * spacing)
        near = np.isfinite(distance)
        _, first = np.unique(labels[rest[near]], return_index=True)
        links += [(part[index[near][f]], rest[near][f]) for f in first]
    if not links:
        return graph
    pairs = np.array(links)
    zero = np.zeros(len(pairs))
    return Graph(
        np.concatenate([graph.pairs, pairs]),
        np.concatenate([graph.distance, zero]),
        np.concatenate([graph.same, zero]),
        np.concatenate([graph.both, zero]),
        np.concatenate([graph.extra, zero]),
    )


def pair_noise(nodes: Nodes, graph: Graph) -> Noise:
    """Noise from medians over neighbouring pairs: robust to edges, blind to smooth errors (hence the factor)."""
    if not len(graph.pairs):
        return NOISE_FLOOR
    i, j = graph.pairs.T
    step = nodes.xyz[j] - nodes.xyz[i]
    mean = nodes.normals[i] + nodes.normals[j]
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-9)
    rise = np.median(np.abs((step * mean).sum(1))) / 0.6745 / np.sqrt(2)
    turn = np.median(np.linalg.norm(nodes.normals[i] - nodes.normals[j], axis=1)) / 1.1774 / np.sqrt(2)
    # chord of a 2D normal deviation: rms = sqrt(2) sigma
    return _bounded(_PAIR_TO_SURFACE * float(rise), _PAIR_TO_SURFACE * float(turn) * np.sqrt(2))


def surface_noise(nodes: Nodes, labels: Index, noise: Noise, seed: int) -> Noise:
    """Noise from the residuals of the larger parts against their primitives."""
    parts = [p for p in parts_of(labels) if len(p) >= _LARGE]
    if not parts:
        return noise
    models = best_models(Sampler(nodes, seed)(parts, REFIT_SAMPLE), noise)
    distances, turns, slopes = [], [], []
    shading = fit_shading(nodes.normals, nodes.grey, nodes.trust)
    trial = Noise(noise.distance, noise.normal, 1.0, shading)
    for k, part in enumerate(parts):
        part = part[nodes.core[part]] if nodes.core[part].any() else part
        sets = nodes.sets(part[None], np.ones((1, len(part))))
        d, m = evaluate(str(models.kinds[k]), models.rows[k : k + 1], sets.points)
        distances.append(np.abs(d[0]))
        turns.append(np.linalg.norm(m[0] - sets.normals[0], axis=1))
        if shading is not None:
            known = np.isfinite(sets.gradients[0, :, 0])
            off = batchfit.shading_residuals(str(models.kinds[k]), models.rows[k : k + 1], sets, trial)[0, known]
            slopes.append(np.sqrt(off))
    # quantiles over all their nodes: errors have heavy tails, yet a part that is two faces must not count
    rise, turn = (float(np.quantile(np.concatenate(v), _QUANTILE)) for v in (distances, turns))
    estimate = _bounded(rise / _NORMAL_QUANTILE, turn / _RAYLEIGH_QUANTILE * np.sqrt(2))
    slope = np.concatenate(slopes) if slopes else np.zeros(0)
    if shading is None or not len(slope):
        return estimate
    gradient = max(float(np.quantile(slope, _QUANTILE)) / _RAYLEIGH_QUANTILE * np.sqrt(2), _GRADIENT_FLOOR)
    return Noise(estimate.distance, estimate.normal, gradient, shading)


def _bounded(distance: float, normal: float) -> Noise:
    return Noise(
        float(np.clip(distance, NOISE_FLOOR.distance, NOISE_CEILING.distance)),
        float(np.clip(normal, NOISE_FLOOR.normal, NOISE_CEILING.normal)),
    )


def affinity(nodes: Nodes, graph: Graph) -> Array:
    """(E,) attraction of neighbours: votes, angle between the normals, further evidence."""
    i, j = graph.pairs.T
    share = graph.same / np.maximum(graph.both, 1)
    sure = np.minimum(nodes.trust[i], nodes.trust[j])
    votes = (share - SHARE_NEUTRAL) * np.minimum(graph.both, _FULL_VIEWS) / _FULL_VIEWS
    angle = np.arccos(np.clip((nodes.normals[i] * nodes.normals[j]).sum(1), -1, 1))
    return votes + sure * _NORMAL_WEIGHT * np.clip(1 - angle / _TURN, -1, 1) + graph.extra


def _with_walls(nodes: Nodes, graph: Graph, labels: Index) -> Index:
    """Superpoints and, of nodes in none, those of one wall: around a narrow hole no two normals are alike."""
    if nodes.wall is None:
        return labels
    left = np.where((labels < 0) & nodes.core, nodes.wall, -1)
    parts = _drop_small(components(graph.pairs, left), 3)
    return compact(np.where(parts >= 0, parts + labels.max(initial=-1) + 1, labels))


def _drop_small(labels: Index, smallest: int) -> Index:
    sizes = np.bincount(labels[labels >= 0], minlength=1)
    return compact(np.where((labels >= 0) & (sizes[np.maximum(labels, 0)] >= smallest), labels, -1))


def absorb(graph: Graph, labels: Index, smallest: int) -> Index:
    """Nodes of parts that are too small go to the neighbouring part that most of their links lead to."""
    kept = _drop_small(labels, smallest)
    if kept.max() < 0:
        return labels
    for _ in range(6):
        missing = kept < 0
        if not missing.any():
            break
        i, j = graph.pairs.T
        one = np.concatenate([i, j])
        other = np.concatenate([j, i])
        use = missing[one] & (kept[other] >= 0)
        if not use.any():
            break
        key = one[use] * (kept.max() + 1) + kept[other[use]]
        values, counts = np.unique(key, return_counts=True)
        node, label = np.divmod(values, kept.max() + 1)
        order = np.lexsort((label, -counts, node))
        first = np.concatenate([[True], np.diff(node[order]) != 0])
        kept[node[order][first]] = label[order][first]
    return compact(kept)
