"""Rows of `results/benchmark/labels.csv`: how good the labels and edges of points are, trained or simulated."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from brepgaussian.artifacts.base import Provenance
from brepgaussian.artifacts.masks import Masks
from brepgaussian.artifacts.points import Points, read_points
from brepgaussian.artifacts.stage1 import Evidence
from brepgaussian.artifacts.stage2 import Stage2
from brepgaussian.artifacts.truth import Truth, read_truth
from brepgaussian.artifacts.views import read_views
from brepgaussian.errors import InputError
from brepgaussian.metrics.patches import columns, score_labels
from brepgaussian.points import simulate
from brepgaussian.points.stage import make_points
from brepgaussian.settings.points import PointsSettings

NOISES = {"low": (0.0015, 2.0), "medium": (0.003, 4.5), "high": (0.005, 7.0)}  # unit frame, degrees
SURFELS = 6000
MISSED_STEP, SPLIT = 2.5, 0.05  # grey levels below which a border is missed, share of regions cut in two


def score(points: Points, truth: Truth) -> dict[str, float]:
    """Patch and edge columns of labelled points, and `point_accuracy`: mean distance to the true surface."""
    row = columns("patch", score_labels(points.xyz, points.label, truth.points, truth.point_face))
    on = points.curve >= 0
    row |= columns("edge", score_labels(points.xyz[on], points.curve[on], truth.curve_points, truth.curve_id))
    _, index = cKDTree(truth.points).query(points.xyz)
    offset = points.xyz.astype(np.float64) - truth.points[index]
    row["point_accuracy"] = float(np.abs((offset * truth.normals[index]).sum(1)).mean())
    return row


def benchmark_points(
    points_path: str | Path, truth_path: str | Path, *, name: str, group: str = "", noise: str = "trained",
    patches: str = "",
) -> dict[str, Any]:  # fmt: skip
    """One row for the `points.ply` of an object.

    Args:
        points_path: what to score; truth_path: `truth.h5`.
        name, group: of the object.
        noise: what the surfels suffer from; patches: which masks voted.
    """
    row = score(read_points(points_path), read_truth(truth_path))
    return {"object": name, "group": group, "noise": noise, "patches": patches} | row


def benchmark_simulated(
    views_path: str | Path, truth_path: str | Path, settings: PointsSettings, *, group: str = "",
    noises: Sequence[str] = tuple(NOISES), threads: int = 1,
) -> list[dict[str, Any]]:  # fmt: skip
    """One row per noise for surfels and masks that are simulated from the truth.

    Args:
        views_path: `views.h5`; truth_path: `truth.h5` with face ids.
        settings: of the stage. The features are uninformative, so they weigh nothing.
        group: of the object.
        noises: of `NOISES`.
        threads: of the stage.

    Raises:
        InputError: the truth has no face ids.
    """
    views, truth = read_views(views_path), read_truth(truth_path)
    if truth.face_ids is None:
        raise InputError("has no face ids", file=truth_path, fix="make it with views.face_ids: true")
    patches = simulate.masks(truth.face_ids, views.luminance, MISSED_STEP, SPLIT, settings.seed)
    rows = []
    for noise in noises:
        sigma, degrees = NOISES[noise]
        surfels = simulate.surfels(truth, SURFELS, sigma, float(np.radians(degrees)), settings.seed)
        with tempfile.TemporaryDirectory() as folder:
            where = Path(folder)
            provenance = Provenance(views.object_name)
            quiet = np.zeros(len(patches), np.float32)
            Masks(simulate.edges(patches), patches, quiet).write(where / "masks.h5", provenance)
            surfels.write(where / "stage1.ply")
            Evidence().write(where / "stage1.h5", provenance)
            Stage2(np.ones((len(surfels.centers), 1), np.float32), patches).write(where / "stage2.h5", provenance)
            points = make_points(
                views_path, where / "masks.h5", where / "stage1.ply", where / "stage1.h5", where / "stage2.h5",
                where / "points.ply", settings, threads,
            )  # fmt: skip
        head = {"object": views.object_name, "group": group, "noise": noise, "patches": "simulated"}
        rows.append(head | score(points, truth))
    return rows
