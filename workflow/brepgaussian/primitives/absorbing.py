"""Patches that are no faces: strips of rounded-off edges and fringes that their neighbours explain.

Surfels round sharp edges off, and the strip between two faces then looks like a small patch of its own with
normals in between. Its points lie near one neighbour or the other and their normals lean towards it; those of
a chamfer stand apart in angle, those of a fillet that is large enough to be seen in distance.
"""

import numpy as np

from brepgaussian.geometry.fit import inliers
from brepgaussian.log import get_logger
from brepgaussian.primitives.patches import Cloud, Noise, Patch, contacts, owners
from brepgaussian.settings.primitives import PrimitivesSettings

log = get_logger("primitives")

NEAR = 4.0  # noises from a neighbour's surface within which a point needs no face of its own,
LEANING = np.radians(32.0)  # if its normal is no further off: the walls of a chamfer are 45 degrees apart
EXPLAINED = 0.65  # share of its points that makes a patch superfluous
LARGER = 2.0  # times as many points as the patch that a neighbour must have
TOUCHING = 3  # neighbour pairs that make two patches adjacent


def absorb(patches: list[Patch], cloud: Cloud, noise: Noise, settings: PrimitivesSettings) -> list[Patch]:
    """Drop the superfluous patches, smallest first; their points support nothing."""
    kept = list(patches)
    for patch in sorted(patches, key=lambda p: (len(p.members), p.labels)):
        table = contacts(cloud, owners(kept, len(cloud.xyz)), len(kept))
        index = next(i for i, p in enumerate(kept) if p is patch)
        neighbours = [kept[j] for j in np.flatnonzero(table[index] >= TOUCHING)]
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
    return float(np.any(near, axis=0).mean()) > EXPLAINED
