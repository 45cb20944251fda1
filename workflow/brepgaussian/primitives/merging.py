"""Joining patches that are one face: neighbours of one surface, and pieces of it that lie apart."""

import contextlib

import numpy as np

from brepgaussian.geometry.fit import fit, oriented, refine
from brepgaussian.geometry.fit_choose import EFFECTIVE
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.log import get_logger
from brepgaussian.primitives.fitting import fit_members
from brepgaussian.primitives.patches import (
    Cloud,
    Indices,
    Noise,
    Patch,
    adjacent,
    observations,
    spreads,
    thinned,
)
from brepgaussian.settings.primitives import PrimitivesSettings

log = get_logger("primitives")

LOOSER = 1.25  # a part may fit the joint surface that much worse than its own
WITHIN = 1.15  # noises that any part may be off the joint surface
OFFSET = 0.8  # noises that the mean of a part may be off the joint surface
FAR_TURN = 2.5  # noises that a neighbour's normals may be off a surface before a joint fit is not even tried
FAR = 6.0  # and its distances
EQUAL_COUNT = 400  # points of each part in a joint fit: a large face must not drown a small one


def merge_neighbours(patches: list[Patch], cloud: Cloud, noise: Noise, settings: PrimitivesSettings) -> list[Patch]:
    """Join adjacent patches while one surface explains both as well as their own do, best pair first."""
    patches = list(patches)
    tried: dict[tuple[tuple[int, int], tuple[int, int]], tuple[float, Surface | None]] = {}
    while len(patches) > 1:
        best, best_pair, best_surface = 1.0, None, None
        for i, j in zip(*np.nonzero(np.triu(adjacent(patches, cloud))), strict=True):
            key = (_key(patches[i]), _key(patches[j]))
            if key not in tried:
                tried[key] = joint(patches[i], patches[j], cloud, noise, settings)
            ratio, surface = tried[key]
            if surface is not None and ratio < best:
                best, best_pair, best_surface = ratio, (int(i), int(j)), surface
        if best_pair is None or best_surface is None:
            return patches
        i, j = best_pair
        merged = joined(patches[i], patches[j], best_surface, cloud, noise, settings)
        log.info("labels %s and %s are one %s", *(list(patches[k].labels) for k in best_pair), merged.surface.kind)
        patches = [p for k, p in enumerate(patches) if k not in best_pair] + [merged]
        patches.sort(key=lambda p: (p.labels, int(p.members[0])))
    return patches


def _key(patch: Patch) -> tuple[int, int]:
    return int(patch.members[0]), len(patch.members)


def joint(
    first: Patch, second: Patch, cloud: Cloud, noise: Noise, settings: PrimitivesSettings
) -> tuple[float, Surface | None]:
    """How badly one surface explains two patches (at most 1 if it may stand for both), and that surface."""
    if not (_near(first, second, cloud, noise) or _near(second, first, cloud, noise)):
        return np.inf, None
    some = [thinned(p.members, EQUAL_COUNT) for p in (first, second)]
    both = np.concatenate(some)
    weights = np.concatenate([np.full(len(s), 1 / len(s)) for s in some])
    best, best_surface = np.inf, None
    for kind in sorted({first.surface.kind, second.surface.kind}):
        candidates = [refine(p.surface, cloud.xyz[both], weights) for p in (first, second) if p.surface.kind == kind]
        with contextlib.suppress(ValueError, np.linalg.LinAlgError):
            candidates.append(fit(kind, cloud.xyz[both], cloud.normals[both], weights))
        for surface in candidates:
            surface = oriented(surface, cloud.xyz[both], cloud.normals[both])
            ratio = max(misfit(p, surface, cloud, noise) for p in (first, second))
            if ratio < best:
                best, best_surface = ratio, surface
    return best, best_surface


def misfit(patch: Patch, surface: Surface, cloud: Cloud, noise: Noise) -> float:
    """Residual of a patch under another surface over what is allowed; 1 or less is as good as its own."""
    rms, turn = spreads(surface, cloud, patch.members)
    offset = abs(float(np.median(surface.signed_distance(cloud.xyz[patch.members]))))
    # the limits are meant for errors that span the whole patch; independent ones tell more
    share = float(np.sqrt(min(EFFECTIVE / observations(patch, cloud, noise), 1.0)))
    looser, within = (1 + share * (v - 1) for v in (LOOSER, WITHIN))
    return max(
        rms / max(looser * patch.rms, within * noise.distance),
        turn / max(looser * patch.turn, within * noise.turn),
        offset / (OFFSET * max(noise.distance, patch.rms)),
    )


def joined(
    first: Patch, second: Patch, surface: Surface, cloud: Cloud, noise: Noise, settings: PrimitivesSettings
) -> Patch:
    """One patch of both, with the kind chosen afresh."""
    members = np.union1d(first.members, second.members)
    labels = tuple(sorted({*first.labels, *second.labels}))
    merged = fit_members(labels, members, cloud, noise, settings, (surface,))
    if merged is not None and max(misfit(p, merged.surface, cloud, noise) for p in (first, second)) <= 1:
        return merged
    return Patch(labels, members, surface, *spreads(surface, cloud, members))


def _near(patch: Patch, other: Patch, cloud: Cloud, noise: Noise) -> bool:
    """Whether the points of a patch are anywhere near another's surface."""
    some: Indices = thinned(patch.members, EQUAL_COUNT)
    rms, turn = spreads(other.surface, cloud, some)
    return rms < FAR * noise.distance + patch.rms and turn < FAR_TURN * noise.turn + patch.turn
