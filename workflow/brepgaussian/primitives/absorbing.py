"""Patches that are no faces: strips of rounded-off edges and fringes that their neighbours explain.

Surfels round sharp edges off, and the strip between two faces then looks like a small patch of its own with
normals in between. Its points lie within the noise of one neighbour or the other; those of a real chamfer or
fillet that is large enough to be seen do not.
"""

import numpy as np

from brepgaussian.log import get_logger
from brepgaussian.primitives.patches import Cloud, Noise, Patch, contacts, owners
from brepgaussian.settings.primitives import PrimitivesSettings

log = get_logger("primitives")

NEAR = 2.5  # noises from a neighbour's surface within which a point needs no face of its own
EXPLAINED = 0.8  # share of its points that makes a patch superfluous
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
    xyz = cloud.xyz[patch.members]
    distance = np.min([np.abs(n.surface.signed_distance(xyz)) for n in larger], axis=0)
    return float(np.mean(distance < NEAR * noise.distance)) > EXPLAINED
