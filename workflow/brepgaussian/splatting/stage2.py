"""Stage 2: masks repaired over all views, and patch features learned from them on frozen geometry."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.base import Provenance
from brepgaussian.artifacts.masks import read_masks
from brepgaussian.artifacts.stage1 import Evidence, Surfels, read_evidence, read_surfels
from brepgaussian.artifacts.stage2 import Stage2
from brepgaussian.artifacts.views import Views, read_views
from brepgaussian.errors import StageError
from brepgaussian.log import get_logger, progress
from brepgaussian.masks.repair import repair
from brepgaussian.points.assign import gather, label_samples
from brepgaussian.settings.base import digest
from brepgaussian.settings.points import PointsSettings
from brepgaussian.settings.stage2 import Stage2Settings
from brepgaussian.splatting.contrastive import LOSSES, normalised, through_normalisation
from brepgaussian.splatting.parameters import BETA1, BETA2, EPSILON
from brepgaussian.splatting.samples import Samples, sample_views

_SEEN = 0.05  # summed weight over all samples below which a surfel has learned nothing
_NEIGHBOURS = 8  # surfels whose features an unseen one takes over

logger = get_logger("stage2")


def train_stage2(
    views_path: str | Path,
    masks_path: str | Path,
    stage1_ply: str | Path,
    out_h5: str | Path,
    settings: Stage2Settings,
    threads: int = 1,
) -> None:
    """Repair the masks, learn patch features (paper, section 3.2, stage 2) and write `stage2.h5`.

    Args:
        views_path: `views.h5`.
        masks_path: `masks.h5`.
        stage1_ply: the frozen surfels.
        out_h5: where the features go.
        settings: see `Stage2Settings`.
        threads: CPU threads; the result does not depend on it.

    Raises:
        ArtifactError: an input file is missing or damaged.
        StageError: without repair, no view has two mask regions to tell apart; with it, nothing has a label.
        ToolError: there is no C++ compiler.
    """
    views, masks, surfels = read_views(views_path), read_masks(masks_path), read_surfels(stage1_ply)
    logger.info("settings: %s", settings)
    provenance = Provenance(views.object_name, digest(settings))
    evidence = evidence_beside(stage1_ply)
    patches = repaired(views, masks.patches, surfels, evidence, settings, threads) if settings.repair else masks.patches
    if len(evidence.features) == len(surfels.centers) and len(surfels.centers):
        logger.info("the features were trained together with the geometry: nothing to learn")
        Stage2(evidence.features, patches, settings.repair).write(out_h5, provenance)
        return
    samples = sample_views(views, patches, surfels, settings, threads)
    if not samples and settings.repair:
        logger.info("no view shows two patches: all surfels have the same feature")
        same = normalised(np.ones((len(surfels.centers), settings.dimensions), np.float32))[0]
        Stage2(same, patches, consistent=True).write(out_h5, provenance)
        return
    if not samples:
        raise StageError(
            "has no view with two patch regions", file=masks_path, fix="check the masks stage's result for this object"
        )
    features = learn(samples, len(surfels.centers), settings)
    features = fill_unseen(as_seen(features, samples), samples, surfels)
    Stage2(features, patches, settings.repair).write(out_h5, provenance)


def evidence_beside(stage1_ply: str | Path) -> Evidence:
    """What stage 1 knows beside the surfels, from `stage1.h5` beside the PLY; empty where there is none."""
    beside = Path(stage1_ply).with_suffix(".h5")
    return read_evidence(beside) if beside.exists() else Evidence()


def repaired(
    views: Views,
    patches: NDArray[np.int16],
    surfels: Surfels,
    evidence: Evidence,
    settings: Stage2Settings,
    threads: int,
) -> NDArray[np.int16]:
    """Patch ids that mean the same face in every view: the surfels are labelled once, then projected into all views.

    The labels are provisional: they stand on the masks as detected, normals and primitives; the features come later.
    """
    labels = PointsSettings(seed=settings.seed)
    gathered = gather(views, patches, surfels, evidence, labels)
    found = label_samples(gathered, labels)
    logger.info("provisional patches: %d", int(found.label.max()) + 1)
    return repair(views, gathered.samples.xyz, gathered.samples.normals, found.label, threads, patches)


def learn(samples: list[Samples], count: int, settings: Stage2Settings) -> NDArray[np.float32]:
    """Train (count, D) features by Adam, one view a step."""
    rng = np.random.default_rng(settings.seed)
    features = normalised(rng.standard_normal((count, settings.dimensions)).astype(np.float32))[0]
    first, second = np.zeros_like(features), np.zeros_like(features)
    loss = LOSSES[settings.loss]
    transposed = [s.weights.T.tocsr() for s in samples]
    order = [view for _ in range(settings.epochs) for view in rng.permutation(len(samples)).tolist()]
    for step, view in enumerate(progress(order, "stage2"), start=1):
        unit, length = normalised(samples[view].weights @ features)
        value, gradient = loss(unit, samples[view].patches, settings.margin, rng)
        gradient = transposed[view] @ through_normalisation(gradient, unit, length)
        first += (1 - BETA1) * (gradient - first)
        second += (1 - BETA2) * (gradient * gradient - second)
        rate = settings.rate * np.sqrt(1 - BETA2**step) / (1 - BETA1**step)
        features -= np.float32(rate) * first / (np.sqrt(second) + EPSILON)
        if step % len(samples) == 0:
            logger.debug("epoch %d: loss %.4f", step // len(samples), value)
    return normalised(features)[0]


def as_seen(features: NDArray[np.float32], samples: list[Samples]) -> NDArray[np.float32]:
    """Give each surfel the mean of the rendered features of the samples that it shows in, by its share in them.

    The loss binds only what several surfels show together: one alone may point anywhere.
    """
    total, seen = np.zeros_like(features), np.zeros(len(features))
    for sample in samples:
        total += sample.weights.T @ normalised(sample.weights @ features)[0]
        seen += np.asarray(sample.weights.sum(axis=0)).ravel()
    return normalised(np.where(seen[:, None] > _SEEN, total, features).astype(np.float32))[0]


def fill_unseen(features: NDArray[np.float32], samples: list[Samples], surfels: Surfels) -> NDArray[np.float32]:
    """Give surfels that no sample touches the mean feature of seen neighbours with the most similar normals."""
    from scipy.spatial import cKDTree

    total = np.zeros(len(features))
    for sample in samples:
        total += np.asarray(sample.weights.sum(axis=0)).ravel()
    seen = total > _SEEN
    if seen.all() or not seen.any():
        return features
    rows = np.flatnonzero(seen)
    _, near = cKDTree(surfels.centers[seen]).query(surfels.centers[~seen], k=min(_NEIGHBOURS, len(rows)))
    near = rows[near.reshape(int((~seen).sum()), -1)]  # (U, K)
    normals = surfels.normals
    similar = np.maximum(np.einsum("ukc,uc->uk", normals[near], normals[~seen]), 1e-3) ** 4
    filled = features.copy()
    filled[~seen] = np.einsum("uk,ukd->ud", similar, features[near])
    return normalised(filled)[0]
