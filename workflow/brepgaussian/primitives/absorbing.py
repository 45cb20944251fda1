"""Patches that are no faces: strips of rounded-off edges and fringes that their neighbours explain.

Surfels round sharp edges off, and the strip between two faces then looks like a small patch of its own with
normals in between. Its points lie near one neighbour or the other and their normals lean towards it; those of
a chamfer stand apart in angle, those of a fillet that is large enough to be seen in distance. The images tell
them apart too: on a rounded-off edge the edge value peaks in the middle, where the normal is furthest from both
faces, on a real strip at its borders.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.stats import rankdata

from brepgaussian.geometry.fit import inliers, residuals
from brepgaussian.geometry.fit_choose import EFFECTIVE, PRICE
from brepgaussian.log import get_logger
from brepgaussian.primitives.fitting import FACE_PRICE, errors
from brepgaussian.primitives.patches import Cloud, Noise, Patch, adjacent, observations, trimmed_rms
from brepgaussian.settings.primitives import PrimitivesSettings

log = get_logger("primitives")

NEAR = 4.0  # noises from a neighbour's surface within which a point needs no face of its own,
LEANING = np.radians(32.0)  # if its normal is no further off: the walls of a chamfer are 45 degrees apart
DOUBTFUL = 0.4  # share of such points from which a patch may be superfluous:
PEAKED = 0.25  # edge values decide by their rank correlation with the angle from the neighbours,
EXPLAINED = 0.65  # and where they do not, the share
LARGER = 2.0  # times as many points as the patch that a neighbour must have
STANDS_OFF = 0.012  # unit frame: no rounding of an edge by the hull (two voxels of it) stands off its faces by more
OUTERMOST = 0.9  # quantile of the distances that tells it
WIDEST = 8.0  # spacings: no strip of a rounded edge reaches as far from the points of its neighbours (2 to 6),
ALONE = 0.9  # unless it is a piece of one of them, which explains so much of it alone


def absorb(patches: list[Patch], cloud: Cloud, noise: Noise, settings: PrimitivesSettings) -> list[Patch]:
    """Drop the superfluous patches, smallest first; their points support nothing."""
    kept = list(patches)
    for patch in sorted(patches, key=lambda p: (len(p.members), p.labels)):
        index = next(i for i, p in enumerate(kept) if p is patch)
        neighbours = [kept[j] for j in np.flatnonzero(adjacent(kept, cloud)[index])]
        if _superfluous(patch, neighbours, cloud, noise):
            log.info("labels %s: %d points between larger faces, no face", list(patch.labels), len(patch.members))
            del kept[index]
    return kept


def _superfluous(patch: Patch, neighbours: list[Patch], cloud: Cloud, noise: Noise) -> bool:
    larger = [n for n in neighbours if len(n.members) >= LARGER * len(patch.members)]
    if not larger:
        return False
    xyz, normals = cloud.xyz[patch.members], cloud.normals[patch.members]
    near = [inliers(n.surface, xyz, normals, NEAR * noise.distance, LEANING) for n in larger]
    share = float(np.any(near, axis=0).mean())
    if share < DOUBTFUL or (max(n.mean() for n in near) < ALONE and _wide(patch, larger, cloud)):
        return False
    distance, turn = np.min([residuals(n.surface, xyz, normals) for n in larger], axis=0)
    if np.quantile(distance, OUTERMOST) > STANDS_OFF:
        return False
    peak = rank_correlation(cloud.edge[patch.members], turn)
    if abs(peak) >= PEAKED:
        return peak > 0
    return share > EXPLAINED and not _told_apart(patch, larger, cloud, noise)


def _wide(patch: Patch, neighbours: list[Patch], cloud: Cloud) -> bool:
    """Whether a patch reaches further from the points of its neighbours than a strip between them."""
    others = cKDTree(cloud.xyz[np.concatenate([n.members for n in neighbours])])
    far = others.query(cloud.xyz[patch.members])[0]
    return bool(np.quantile(far, OUTERMOST) > WIDEST * cloud.spacing)


def _told_apart(patch: Patch, larger: list[Patch], cloud: Cloud, noise: Noise) -> bool:
    """Whether independent errors, which round nothing off, show a face of its own; smooth ones cannot."""
    count = observations(patch, cloud, noise)
    if count <= EFFECTIVE:
        return False
    own, others = (errors(parts, patch.members, cloud, noise)[:2] for parts in ([patch], larger))
    excess = [max(trimmed_rms(o), 1.0) / max(trimmed_rms(p), 1.0) for o, p in zip(others, own, strict=True)]
    return bool(2 * count * np.log(np.prod(excess)) > (PRICE[patch.surface.kind] + FACE_PRICE) * np.log(count))


def rank_correlation(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Spearman's correlation of two (N,) arrays, 0 where one is constant."""
    ranks = [rankdata(v) - (len(v) + 1) / 2 for v in (first, second)]
    norm = float(np.linalg.norm(ranks[0]) * np.linalg.norm(ranks[1]))
    return float(ranks[0] @ ranks[1]) / norm if norm > 0 else 0.0
