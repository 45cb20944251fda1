"""The `primitives` stage: labelled points to regularised analytic surfaces."""

from pathlib import Path

import numpy as np

from brepgaussian import threads as thread_binding
from brepgaussian.artifacts.base import Provenance
from brepgaussian.artifacts.points import Points, read_points
from brepgaussian.artifacts.primitives import Primitive, Primitives, Relation
from brepgaussian.errors import SettingsError, StageError
from brepgaussian.geometry.fit import abreast
from brepgaussian.geometry.surfaces import KINDS
from brepgaussian.log import get_logger
from brepgaussian.primitives.absorbing import absorb
from brepgaussian.primitives.families import join_families
from brepgaussian.primitives.fitting import fit_labels, measure_noise, support
from brepgaussian.primitives.guided import guide, known
from brepgaussian.primitives.halves import join_halves
from brepgaussian.primitives.merging import merge_neighbours
from brepgaussian.primitives.patches import Cloud, Noise, Patch, make_cloud
from brepgaussian.primitives.regularise import regularise, state_of
from brepgaussian.primitives.sharing import share_out
from brepgaussian.settings.base import digest
from brepgaussian.settings.primitives import PrimitivesSettings

log = get_logger("primitives")

ROUNDS = 2  # a family found in the first gives an axis to the second


def fit_primitives(
    points_path: str | Path, out_path: str | Path, settings: PrimitivesSettings, threads: int = 1
) -> Primitives:
    """Fit and regularise a surface for every labelled patch, write `primitives.h5`.

    Args:
        points_path: `points.ply`.
        out_path: `primitives.h5` to write.
        settings: of this stage.
        threads: of the numeric libraries; the result does not depend on it.

    Returns:
        What was written. The surfaces' normals point out of the solid.

    Raises:
        ArtifactError: the points cannot be read.
        SettingsError: an unknown kind of surface.
        StageError: no label has enough points.
    """
    thread_binding.bind(threads)
    unknown = [k for k in settings.kinds if k not in KINDS]
    if unknown or not settings.kinds:
        raise SettingsError(f"primitives.kinds is {settings.kinds}", fix=f"use some of: {', '.join(KINDS)}")
    points = read_points(points_path)
    if not (points.label >= 0).any():
        raise StageError("no point has a label", file=points_path, fix="check the masks and the points stage")
    result = primitives_of(points, settings)
    result.write(out_path, Provenance(settings_hash=digest(settings)))
    return result


def primitives_of(points: Points, settings: PrimitivesSettings) -> Primitives:
    """As `fit_primitives`, from and to memory."""
    cloud = make_cloud(points, settings.neighbours)
    patches, noise = fit_labels(cloud, settings)
    log.info("%d patches, noise %.4f and %.1f degrees", len(patches), noise.distance, np.degrees(noise.turn))
    if settings.absorb:
        patches = absorb(patches, cloud, noise, settings)
    if settings.split:
        patches = join_halves(share_out(patches, cloud, noise, settings), cloud, noise, settings)
    if settings.guide:
        for _ in range(ROUNDS):
            before = len(patches)
            sources = known(patches, state_of(patches, cloud, noise, settings))
            patches = guide(patches, sources, cloud, noise, settings)
            patches = join_families(patches, sources, cloud, noise, settings)
            if len(patches) == before:
                break
    if settings.merge:
        patches = merge_neighbours(patches, cloud, noise, settings)
        noise = measure_noise(patches, cloud, settings)
    relations: tuple[Relation, ...] = ()
    if settings.regularise:
        patches, relations = regularise(patches, cloud, noise, settings)
    return _finished(patches, relations, cloud, noise, settings)


def _finished(
    patches: list[Patch], relations: tuple[Relation, ...], cloud: Cloud, noise: Noise, settings: PrimitivesSettings
) -> Primitives:
    items = []
    for patch in patches:
        indices = support(patch, cloud, noise, settings)
        if not len(indices):
            indices = patch.members
        surface = abreast(patch.surface, cloud.xyz[indices])
        rms = surface.rms(cloud.xyz[indices])
        items.append(Primitive(surface, patch.labels[0], indices, rms))
        log.info(
            "%d: %s, labels %s, %d points, rms %.4f, radius %.4f",
            len(items) - 1,
            surface.kind,
            list(patch.labels),
            len(indices),
            rms,
            surface.radius,
        )
        if patch.rms > 3 * noise.distance:
            log.warning("primitive %d fits badly: rms %.4f, noise %.4f", len(items) - 1, patch.rms, noise.distance)
    return Primitives(tuple(items), relations, noise.distance)
