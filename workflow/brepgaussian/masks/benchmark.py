"""Rows of `results/benchmark/masks.csv`: how good edge maps and patch masks are, clean and under image noise."""

import dataclasses
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.truth import Truth, read_truth
from brepgaussian.artifacts.views import Views, read_views
from brepgaussian.errors import InputError
from brepgaussian.masks.edges import region_edges
from brepgaussian.masks.evaluate import EdgeScore, RegionScore, score_edges, score_regions
from brepgaussian.masks.stage import detect
from brepgaussian.settings.masks import MasksSettings
from brepgaussian.views.noise import denoised

COLUMNS = (
    "object group noise edges patches repaired edge_f_all edge_f_interior region_f_50 region_f_75 over under seconds"
).split()
_JPEG_QUALITY = 85
_SIGMA = {"sigma2": 2.0, "sigma5": 5.0}
NOISES = ("clean", *_SIGMA, f"jpeg{_JPEG_QUALITY}")

Repair = Callable[[Views, NDArray[np.int16]], NDArray[np.int16]]


def benchmark_masks(
    views_path: str | Path,
    truth_path: str | Path,
    settings: MasksSettings,
    *,
    group: str = "",
    noises: Sequence[str] = NOISES,
    repair: Repair | None = None,
    threads: int = 1,
) -> list[dict[str, Any]]:
    """Score one object's masks under every kind of noise, before repair and, where a repair is given, after it.

    Args:
        views_path: `views.h5` without noise.
        truth_path: `truth.h5` with face ids.
        settings: the detectors.
        group: the object's group, e.g. tuned or holdout.
        noises: of `NOISES`.
        repair: (views, patches) -> repaired (V, H, W) patches, such as `repair.repair` with an object's samples.
        threads: views worked on at the same time.

    Returns:
        One mapping of `COLUMNS` for each noise and each of raw and repaired masks. `seconds` is wall time for all
        views, of the repair alone in a repaired row. A repaired row's edges are the borders of its patches.

    Raises:
        InputError: the truth has no face ids.
    """
    views, truth = read_views(views_path), read_truth(truth_path)
    if truth.face_ids is None:
        raise InputError("has no face ids", file=truth_path, fix="make it with views.face_ids: true")
    rows = []
    for noise in noises:
        noisy = add_noise(views, noise, settings.seed)
        start = time.perf_counter()
        noisy = denoised(noisy, threads)
        masks = detect(noisy, settings, threads, truth)
        seconds = time.perf_counter() - start
        row: dict[str, Any] = {
            "object": views.object_name,
            "group": group,
            "noise": noise,
            "edges": settings.edges,
            "patches": settings.patches,
        }
        scores = score_views(masks.edges, masks.patches, truth)
        rows.append({**row, "repaired": False, **scores, "seconds": round(seconds, 2)})
        if repair is not None:
            start = time.perf_counter()
            patches = repair(noisy, masks.patches)
            seconds = time.perf_counter() - start
            scores = score_views(None, patches, truth)
            row["edges"] = "regions"
            rows.append({**row, "repaired": True, **scores, "seconds": round(seconds, 2)})
    return rows


def score_views(edges: NDArray[np.uint8] | None, patches: NDArray[np.int16], truth: Truth) -> dict[str, float]:
    """Scores of all views of one object, pooled; without an edge map the borders of the patches are scored."""
    assert truth.face_ids is not None
    every, interior, regions = EdgeScore(), EdgeScore(), RegionScore()
    for view, face_ids in enumerate(truth.face_ids):
        edge = region_edges(patches[view], 1) if edges is None else edges[view]
        every += score_edges(edge, face_ids)
        interior += score_edges(edge, face_ids, interior=True)
        regions += score_regions(patches[view], face_ids)
    return {
        "edge_f_all": round(every.f, 4),
        "edge_f_interior": round(interior.f, 4),
        "region_f_50": round(regions.f_50, 4),
        "region_f_75": round(regions.f_75, 4),
        "over": round(regions.over, 4),
        "under": round(regions.under, 4),
    }


def add_noise(views: Views, noise: str, seed: int = 0) -> Views:
    """The same views with noise on their colours: `clean`, `sigma2`, `sigma5` (white, grey levels) or `jpeg85`.

    Raises:
        InputError: an unknown kind of noise.
    """
    if noise == "clean":
        return views
    if noise in _SIGMA:
        rng = np.random.default_rng(seed)
        rgb = np.empty_like(views.rgb)
        for view, image in enumerate(views.rgb):  # view by view: a float copy of all would take gigabytes
            grain = rng.normal(0, _SIGMA[noise], image.shape[:2])[:, :, None]  # grey images stay grey
            rgb[view] = np.clip(np.rint(image + grain), 0, 255)
    elif noise == f"jpeg{_JPEG_QUALITY}":
        rgb = np.stack([_jpeg(image) for image in views.rgb])
    else:
        raise InputError(f"there is no noise {noise!r}", fix=f"use one of: {', '.join(NOISES)}")
    return dataclasses.replace(views, rgb=rgb)


def _jpeg(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    _, code = cv2.imencode(".jpg", np.ascontiguousarray(image[:, :, ::-1]), [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR), np.uint8)[:, :, ::-1]
