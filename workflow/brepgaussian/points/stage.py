"""The `points` stage: surfels, masks and features to a labelled point cloud."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian import threads as thread_binding
from brepgaussian.artifacts.masks import read_masks
from brepgaussian.artifacts.points import Points
from brepgaussian.artifacts.stage1 import read_evidence, read_surfels
from brepgaussian.artifacts.stage2 import read_stage2
from brepgaussian.artifacts.views import read_views
from brepgaussian.errors import ArtifactError
from brepgaussian.geometry.surfaces import Surface, surface_from_row
from brepgaussian.log import get_logger
from brepgaussian.points import batchfit
from brepgaussian.points.anchor import anchor_surfaces, follow
from brepgaussian.points.curves import Curve, find_curves
from brepgaussian.points.densify import Samples, densify
from brepgaussian.points.features import label_by_features
from brepgaussian.points.graph import Graph, Index, neighbour_pairs, spacing_of, thin
from brepgaussian.points.labels import Labelling, label_nodes
from brepgaussian.points.merge import Nodes
from brepgaussian.points.shading import gradients
from brepgaussian.points.snap import snap
from brepgaussian.points.votes import agreement, core, observe
from brepgaussian.settings.points import PointsSettings

Array = NDArray[np.float64]
log = get_logger("points")
_LEAST_VIEWS, _SAME_REGION = 3, 0.6  # views, and their share, in which neighbours lie in one region: no border between


def make_points(
    views_path: str | Path,
    masks_path: str | Path,
    stage1_ply: str | Path,
    stage1_h5: str | Path,
    stage2_path: str | Path,
    out_path: str | Path,
    settings: PointsSettings,
    threads: int = 1,
) -> Points:
    """Sample the surfels, label the samples by patch and by curve, write `points.ply`.

    Args:
        views_path, masks_path, stage1_ply, stage1_h5, stage2_path: artifacts of the stages before.
        out_path: `points.ply` to write.
        settings: of this stage.
        threads: of the numeric libraries.

    Returns:
        What was written.

    Raises:
        ArtifactError: an input is missing, damaged, or the inputs do not belong together.
    """
    thread_binding.bind(threads)
    surfels = read_surfels(stage1_ply)
    evidence, stage2 = read_evidence(stage1_h5), read_stage2(stage2_path)
    views = read_views(views_path)
    patches = stage2.patches if settings.regions == "stage2" else read_masks(masks_path).patches
    if not len(surfels.centers):
        raise ArtifactError("holds no surfels", file=stage1_ply, fix="rerun stage 1, check the silhouettes")
    if len(stage2.features) != len(surfels.centers):
        raise ArtifactError("has features for another number of surfels", file=stage2_path, fix="rerun stage 2")
    if patches.shape != views.alpha.shape:
        raise ArtifactError("has masks of another size than the views", file=stage2_path, fix="rerun masks, stage 2")

    samples = densify(surfels, settings)
    spacing = spacing_of(samples.xyz)
    centers = len(surfels.centers)  # one node a surfel: samples of one surfel share its errors
    chosen = thin(samples.xyz[:centers] if centers >= settings.nodes // 2 else samples.xyz, settings.nodes)
    node_spacing = spacing_of(samples.xyz[chosen])
    log.info("%d surfels, %d points, %d nodes", len(surfels.centers), len(samples), len(chosen))
    xyz, normals = samples.xyz[chosen], samples.normals[chosen]
    pairs, distance = neighbour_pairs(xyz, normals, settings.neighbours)
    seen = observe(views, patches, xyz, normals, samples.xyz, spacing, settings.border_px)
    same, both = agreement(seen.regions, pairs)
    owner = samples.surfel[chosen]
    extra = _features(stage2.features, owner, pairs) * settings.features_weight
    if len(evidence.face_id) == len(surfels.centers):
        extra = extra + _faces(evidence.face_id[owner], pairs) * settings.faces_weight
    graph = Graph(pairs, distance, same * settings.votes_weight, both * settings.votes_weight, extra)
    shared = np.where(both >= _LEAST_VIEWS, same / np.maximum(both, 1), 0.0)
    slopes = gradients(xyz, normals, seen.grey, pairs, np.where(shared > _SAME_REGION, shared, 0.0))
    nodes = Nodes(xyz, normals, seen.trust, core(seen, pairs, shared > _SAME_REGION), seen.grey, slopes)
    if settings.labels == "features":
        result = label_by_features(
            nodes, graph, stage2.features[owner], settings.features_distance, settings.smallest_patch, settings.seed
        )
    else:
        result = label_nodes(nodes, graph, node_spacing, settings.smallest_patch, settings.seed)
    label = spread(samples, xyz, result, node_spacing)
    surfaces = [
        surface_from_row(str(kind), row) for kind, row in zip(result.models.kinds, result.models.rows, strict=True)
    ]
    curves: list[Curve] = []
    if settings.curve_spacing > 0:
        curves = find_curves(xyz, result.labels, surfaces, node_spacing, settings.curve_spacing)
    if curves and settings.snap_curves:
        edges = read_masks(masks_path).edges
        dense = samples.xyz
        curves = snap(curves, surfaces, views.cameras, edges, dense, spacing)
        anchored = anchor_surfaces(surfaces, xyz, result.labels, curves)
        samples = replace(samples, xyz=follow(samples.xyz, label, surfaces, anchored))
        xyz = follow(xyz, result.labels, surfaces, anchored)
        surfaces = anchored
        curves = find_curves(xyz, result.labels, surfaces, node_spacing, settings.curve_spacing)
        curves = snap(curves, surfaces, views.cameras, edges, dense, spacing)
    points = assemble(samples, label, curves, surfaces)
    points.write(out_path)
    return points


def assemble(samples: Samples, label: Index, curves: list[Curve], surfaces: list[Surface]) -> Points:
    """The labelled samples, then the points of the curves (edge value 1, label of the first of the two patches)."""
    on = [c.points for c in curves]
    normals = [surfaces[c.pair[0]].normals(c.points) for c in curves]
    counts = [len(p) for p in on]
    return Points(
        np.concatenate([samples.xyz, *on]).astype(np.float32),
        np.concatenate([samples.normals, *normals]).astype(np.float32),
        np.concatenate([samples.edge, np.ones(sum(counts))]).astype(np.float32),
        np.concatenate([label, np.repeat([c.pair[0] for c in curves], counts)]).astype(np.int32),
        np.concatenate([np.full(len(label), -1), np.repeat(np.arange(len(curves)), counts)]).astype(np.int32),
    )


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
        d, n = batchfit.evaluate(
            str(result.models.kinds[label]), result.models.rows[label][None], samples.xyz[where][None]
        )
        turn = ((n[0] - samples.normals[where]) ** 2).sum(1) / result.noise.normal**2
        value = 0.5 * np.minimum((d[0] / result.noise.distance) ** 2 + 0.3 * turn, 12.0)
        cost[rows, columns] = value[np.searchsorted(where, rows)]
    cost += 0.7 * (distance / spacing) ** 2
    best = candidates[np.arange(len(samples)), cost.argmin(1)]
    best[distance[:, 0] > 5 * spacing] = -1
    return best
