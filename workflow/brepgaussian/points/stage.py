"""The `points` stage: surfels, masks and features to a labelled point cloud."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brepgaussian import threads as thread_binding
from brepgaussian.artifacts.masks import read_masks
from brepgaussian.artifacts.points import Points, write_points
from brepgaussian.artifacts.stage1 import read_evidence, read_surfels
from brepgaussian.artifacts.stage2 import read_stage2
from brepgaussian.artifacts.views import Views, read_views
from brepgaussian.errors import ArtifactError
from brepgaussian.geometry.surfaces import Surface, surface_from_row
from brepgaussian.points.anchor import FEWER, MOST, anchor_surfaces, drawn_far, follow
from brepgaussian.points.assign import Gathered, Labelled, gather, label_samples, same_patches
from brepgaussian.points.curves import Curve, find_curves
from brepgaussian.points.densify import Samples
from brepgaussian.points.graph import Index
from brepgaussian.points.models import shared_surfaces
from brepgaussian.points.snap import believed, snap
from brepgaussian.points.tips import without_tips
from brepgaussian.settings.points import PointsSettings


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
    """Sample the surfels, label the samples by patch and by curve, write `points.ply` with other labellings beside.

    Args:
        views_path, masks_path, stage1_ply, stage1_h5, stage2_path: artifacts of the stages before.
        out_path: `points.ply` to write.
        settings: of this stage.
        threads: of the numeric libraries.

    Returns:
        What was written, without the other labellings.

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

    gathered = gather(views, patches, surfels, evidence, settings, stage2.features)
    edges = read_masks(masks_path).edges if settings.snap_curves else None
    first = label_samples(gathered, settings)
    points, far = _bordered(gathered, first, views, edges, settings)
    quick = replace(settings, shared_models=False)  # others are not published, only tried
    others = [_bordered(gathered, other, views, edges, quick)[0] for other in _others(gathered, first, settings)]
    if far:  # a border that is none may have drawn faces to it
        others.insert(0, _bordered(gathered, first, views, edges, quick, FEWER)[0])
    write_points(out_path, points, others)
    return points


def _others(gathered: Gathered, first: Labelled, settings: PointsSettings) -> list[Labelled]:
    """Labellings with other patches, by labels that cost less or more."""
    found = [first]
    for cost in settings.other_label_costs if settings.labels == "fused" else ():
        other = label_samples(gathered, replace(settings, label_cost=cost))
        if (other.label >= 0).any() and not any(same_patches(other.label, known.label) for known in found):
            found.append(other)
    return found[1:]


def _bordered(
    gathered: Gathered,
    found: Labelled,
    views: Views,
    edges: NDArray[np.uint8] | None,
    settings: PointsSettings,
    most: float = MOST,
) -> tuple[Points, bool]:
    """Labelled samples with the curves between their patches, moved on to the edge maps (V, H, W) if there are any.

    Patches follow their curves, by `most` at most; with the samples comes whether one of them went far.
    """
    samples, label, result, spacing = gathered.samples, found.label, found.nodes, gathered.spacing
    xyz, node_spacing = gathered.nodes.xyz, gathered.node_spacing
    surfaces = [
        surface_from_row(str(kind), row) for kind, row in zip(result.models.kinds, result.models.rows, strict=True)
    ]
    curves: list[Curve] = []
    far = False
    if settings.curve_spacing > 0:
        curves = find_curves(xyz, result.labels, surfaces, node_spacing, settings.curve_spacing)
    if curves and edges is not None:
        dense = samples.xyz
        curves = believed(snap(curves, surfaces, views.cameras, edges, dense, spacing), surfaces)
        anchored = anchor_surfaces(surfaces, xyz, result.labels, curves, gathered.told, most)
        samples = replace(samples, xyz=follow(samples.xyz, label, surfaces, anchored))
        far = drawn_far(surfaces, anchored, xyz, result.labels)
        xyz = follow(xyz, result.labels, surfaces, anchored)
        surfaces = anchored
        if settings.shared_models:
            surfaces = shared_surfaces(assemble(samples, label, [], surfaces), surfaces)
        curves = find_curves(xyz, result.labels, surfaces, node_spacing, settings.curve_spacing)
        curves = without_tips(curves, xyz, result.labels, surfaces, node_spacing, settings.curve_spacing)
        curves = believed(snap(curves, surfaces, views.cameras, edges, dense, spacing), surfaces)
    return assemble(samples, label, curves, surfaces), far


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
