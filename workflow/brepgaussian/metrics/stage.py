"""Stage `metrics`: one row of scores for one object and variant."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from brepgaussian.artifacts.brep import read_brep
from brepgaussian.artifacts.points import Points, read_points
from brepgaussian.artifacts.truth import Truth, read_truth
from brepgaussian.artifacts.views import read_views
from brepgaussian.geometry.topology import count_topology, sharp_curves
from brepgaussian.log import get_logger
from brepgaussian.metrics import patches, solid
from brepgaussian.metrics.benchmarks import total
from brepgaussian.metrics.columns import OK
from brepgaussian.metrics.distances import SampledSurface, cloud_distance, surface_distance
from brepgaussian.metrics.sampling import sample_surface
from brepgaussian.metrics.table import collect, write_rows
from brepgaussian.metrics.topology import topology_match
from brepgaussian.metrics.triangulation import triangulate
from brepgaussian.metrics.volume import volume_iou
from brepgaussian.settings.metrics import MetricsSettings

__all__ = ["collect", "score_object"]

log = get_logger("metrics")


def score_object(
    *,
    object_name: str,
    variant: str,
    views_path: str | Path,
    truth_path: str | Path | None,
    points_path: str | Path,
    step_path: str | Path,
    brep_h5: str | Path,
    out_csv: str | Path,
    settings: MetricsSettings,
    seconds: float | None = None,
    peak_mb: float | None = None,
    benchmark_files: Sequence[str | Path] = (),
    threads: int = 1,
) -> None:
    """Score one object and write a one-row `metrics.csv`; see docs/metrics.md for the columns.

    Args:
        object_name: name in `config/objects.tsv`.
        variant: name of the variant.
        views_path: `views.h5`.
        truth_path: `truth.h5`, or None: the columns that need a truth stay empty.
        points_path: `points.ply`.
        step_path: `brep.step`, in the world frame.
        brep_h5: `brep.h5`.
        out_csv: the row to write.
        settings: settings of the stage.
        seconds: time of all stages of this object; by default from `benchmark_files`.
        peak_mb: largest memory of them; by default from `benchmark_files`.
        benchmark_files: Snakemake's benchmark tables of the stages.
        threads: threads of nearest-point and ray queries; the result does not depend on it.
    """
    log.info("%s, %s: %s", object_name, variant, settings)
    views = read_views(views_path)
    truth = read_truth(truth_path) if truth_path is not None else None
    row: dict[str, Any] = {"object": object_name, "variant": variant, "status": OK, "views": len(views.cameras)}
    measured_s, measured_mb = total(benchmark_files)
    row |= {"seconds": seconds if seconds is not None else measured_s}
    row |= {"peak_mb": peak_mb if peak_mb is not None else measured_mb}
    row |= score_report(read_brep(brep_h5).report)
    shape = solid.read_step(step_path, views.world_from_unit, views.unit)
    row |= score_solid(shape, truth, settings, threads)
    if truth is not None:
        row |= score_points(read_points(points_path), truth)
    write_rows([row], out_csv)


def score_report(report: dict[str, Any]) -> dict[str, Any]:
    """Columns that need no truth: what the brep stage measured against the images."""
    return {
        "silhouette_px": report.get("silhouette_px"),
        "mask_iou": report.get("mask_iou"),
        "fallback": bool(report.get("fallback", False)),
    }


def score_points(points: Points, truth: Truth) -> dict[str, float]:
    """Columns `patch_...` and `edge_...` (the paper's tables 1 and 2)."""
    by_patch = patches.score_labels(points.xyz, points.label, truth.points, truth.point_face)
    by_edge = patches.score_labels(points.xyz, points.curve, truth.curve_points, truth.curve_id)
    return patches.columns("patch", by_patch) | patches.columns("edge", by_edge)


def score_solid(shape: Any, truth: Truth | None, settings: MetricsSettings, threads: int = 1) -> dict[str, Any]:
    """Columns of a solid in the unit frame: its health and, with a truth, distances, topology, volume (table 3)."""
    health = solid.check(shape)
    counts = count_topology(shape)
    row: dict[str, Any] = {"valid": health.valid, "closed": health.closed, "solids": health.solids}
    row |= {"faces": len(counts.face_types), "edges": counts.edge_count, "vertices": counts.vertex_count}
    if truth is None:
        return row
    mesh = triangulate(shape, settings.deflection)
    result = sample_surface(mesh, settings.samples, settings.seed, threads)
    row |= score_shape(result, sharp_curves(shape).points, truth, volume=health.closed, settings=settings)
    row |= {
        "faces_truth": len(truth.face_types),
        "edges_truth": truth.edge_count if truth.edge_count >= 0 else None,
        "vertices_truth": truth.vertex_count if truth.vertex_count >= 0 else None,
        "topology_match": topology_match(counts.face_types, counts.face_pairs, truth.face_types, truth.face_pairs),
    }
    return row


def score_shape(
    result: SampledSurface, curve_points: np.ndarray, truth: Truth, *, volume: bool, settings: MetricsSettings
) -> dict[str, Any]:
    """Columns `surface_...`, `curve_...`, `volume_iou` and `normal_consistency` of any surface.

    Args:
        result: the surface to score.
        curve_points: (M, 3) samples of its sharp curves.
        truth: the known model.
        volume: whether the result is closed, so that it has a volume.
        settings: settings of the stage.
    """
    model = SampledSurface(truth.mesh_vertices, truth.mesh_triangles, truth.points, truth.normals, result.threads)
    cloud, exact = cloud_distance(result.points, truth.points), surface_distance(result, model)
    curve = cloud_distance(curve_points, truth.curve_points)
    return {
        "surface_cd_sum": cloud.cd_sum,
        "surface_cd_avg": cloud.cd_avg,
        "surface_cd_exact": exact.cd_exact,
        "surface_hd": cloud.hd,
        "surface_hd99": cloud.hd99,
        "surface_hd_exact": exact.hd_exact,
        "curve_cd_sum": curve.cd_sum,
        "curve_cd_avg": curve.cd_avg,
        "curve_hd": curve.hd,
        "curve_hd99": curve.hd99,
        "normal_consistency": exact.normal_consistency,
        "volume_iou": volume_iou(result, model, settings.volume_grid, settings.seed) if volume else None,
    }
