"""The stage `masks`: an edge map and patch masks of every view."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np

from brepgaussian.artifacts.base import Provenance
from brepgaussian.artifacts.masks import Masks
from brepgaussian.artifacts.truth import Truth, read_truth
from brepgaussian.artifacts.views import Views, read_views
from brepgaussian.errors import SettingsError
from brepgaussian.log import get_logger, progress
from brepgaussian.masks.detectors import EDGES, PATCHES
from brepgaussian.masks.steps import crop as crop_view
from brepgaussian.settings.base import digest
from brepgaussian.settings.masks import MasksSettings
from brepgaussian.views.noise import for_steps


def make_masks(
    views_path: str | Path,
    out_path: str | Path,
    settings: MasksSettings,
    threads: int = 1,
    truth_path: str | Path | None = None,
) -> Masks:
    """Make `masks.h5` from `views.h5`.

    Args:
        views_path: the object's `views.h5`.
        out_path: where `masks.h5` goes.
        settings: chooses the detectors (`edges`, `patches`) and their thresholds.
        threads: views worked on at the same time.
        truth_path: the object's `truth.h5`; read only by the `truth` patch detector.

    Raises:
        InputError: a chosen detector lacks what it needs (edge maps, weights, known faces).
        ToolError: a chosen detector's library is not installed.
        ArtifactError: an input file is missing or damaged.
    """
    views = read_views(views_path)
    truth = read_truth(truth_path) if settings.patches == "truth" and truth_path is not None else None
    masks = detect(views, settings, threads, truth)
    masks.write(out_path, Provenance(views.object_name, digest(settings)))
    return masks


def detect(views: Views, settings: MasksSettings, threads: int = 1, truth: Truth | None = None) -> Masks:
    """Edge maps, patch masks and image noise of all views of one object."""
    if settings.edges == "regions" and settings.patches == "sam":
        raise SettingsError(
            "masks.edges: regions needs patches, and masks.patches: sam needs edges",
            fix="choose masks.edges: classical with sam",
        )
    views = for_steps(views)
    patch_detector = PATCHES[settings.patches](views, settings, truth)
    edge_detector = EDGES[settings.edges](views, settings)
    cv2.setNumThreads(threads)
    shape = views.alpha.shape
    edges, patches = np.zeros(shape, np.uint8), np.zeros(shape, np.int16)
    noise = np.zeros(shape[0], np.float32)

    def work(view: int) -> None:
        crop = crop_view(views.grey(view), views.alpha[view])
        if crop is None:
            return
        noise[view] = crop.noise
        if edge_detector.needs_patches:
            patches[view] = patch_detector.patches(view, crop, None)
            edges[view] = edge_detector.edges(view, crop, patches[view])
        else:
            edges[view] = edge_detector.edges(view, crop, None)
            patches[view] = patch_detector.patches(view, crop, edges[view])

    with ThreadPoolExecutor(max(threads, 1)) as pool:
        for _ in progress(pool.map(work, range(shape[0])), "masks", total=shape[0]):
            pass
    get_logger("masks").info(
        "%s: %d views, noise %.2f grey levels, %.1f regions a view",
        views.object_name,
        shape[0],
        float(np.median(noise)),
        float(np.mean([len(np.unique(p)) - 1 for p in patches])),
    )
    return Masks(edges, patches, noise)
