"""Faces that share a label with a larger one: surfaces for the points that no primitive explains.

A short face beside a long one that leans a little from it has its grey in every view (the neck between a cone and the
hexagon below it). Their label's surface is the long one's, and the short one's points are its outliers.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.points import Points
from brepgaussian.artifacts.primitives import Primitives
from brepgaussian.geometry.fit import inliers, residuals
from brepgaussian.primitives.afresh import (
    APART,
    ENOUGH,
    REACH,
    SIMPLE,
    Choice,
    dubious_of,
    nearest,
    primitive_of,
    surfaces_of,
    taken_up,
)
from brepgaussian.primitives.candidates import TURN
from brepgaussian.primitives.guided import known
from brepgaussian.primitives.patches import Cloud, Indices, Patch, islands, spreads
from brepgaussian.primitives.regularise import regularise, state_of
from brepgaussian.settings.primitives import PrimitivesSettings

Array = NDArray[np.float64]

LEAN = np.cos(np.radians(8.0))  # between two surfaces beside each other that are one, and points that bulge
HALF = 0.5  # of a dubious patch's points that lie on a surface that is found


def with_unclaimed(points: Points, primitives: Primitives, settings: PrimitivesSettings) -> Primitives | None:
    """The primitives with surfaces for islands of points that none explains; None where there are none.

    Args:
        points: that the primitives' supports index.
        primitives: of the stage.
        settings: of the stage.
    """
    cloud, patches, noise = taken_up(points, primitives, settings)
    members = _unclaimed(patches, cloud)
    dubious = dubious_of(patches, cloud, noise, rounds=True)
    sure = [p for i, p in enumerate(patches) if i not in dubious]
    limit = REACH * noise.distance
    xyz, normals = cloud.xyz[members], cloud.normals[members]
    left = nearest([p.surface for p in sure], xyz, normals, limit) < 0
    members, xyz, normals = members[left], xyz[left], normals[left]
    if not sure or len(members) < ENOUGH:
        return None
    guides = known(sure, state_of(sure, cloud, noise, settings))
    result = patches
    for candidate in surfaces_of([], guides, Choice(SIMPLE), xyz, normals, limit, settings):
        mine = members[inliers(candidate.surface, xyz, normals, limit, TURN)]
        found = Patch((int(cloud.label[mine[0]]),), mine, candidate.surface, 0.0, 0.0)
        if not any(_bulges(found, p, cloud, limit) for p in sure):
            result = _joined(result, found, [patches[i] for i in dubious], cloud, limit)
    if result is patches:
        return None
    snapped, relations = regularise(result, cloud, noise, settings)
    return Primitives(tuple(primitive_of(p, cloud) for p in snapped), relations, primitives.sigma)


def _unclaimed(patches: Sequence[Patch], cloud: Cloud) -> Indices:
    """Labelled points clear of edges that support no surface, of islands as large as a face."""
    free = cloud.inner & (cloud.label >= 0)
    for patch in patches:
        free[patch.members] = False
    pieces = [p for p in islands(cloud, np.flatnonzero(free)) if len(p) >= ENOUGH]
    return np.sort(np.concatenate(pieces)) if pieces else np.zeros(0, np.int64)


def _bulges(found: Patch, other: Patch, cloud: Cloud, limit: float) -> bool:
    """Whether all that a surface explains are points where another one bulges."""
    xyz = cloud.xyz[found.members]
    distance = residuals(other.surface, xyz, cloud.normals[found.members])[0]
    lean = np.einsum("ij,ij->i", other.surface.normals(xyz), found.surface.normals(xyz))
    return bool(np.median(distance) < APART * limit and np.median(lean) > LEAN)


def _joined(
    patches: Sequence[Patch], found: Patch, dubious: Sequence[Patch], cloud: Cloud, limit: float
) -> list[Patch]:
    """The patches with another one in the place of those dubious ones half of whose points lie on it."""
    result, members = [], [found.members]
    for patch in patches:
        on = np.zeros(len(patch.members), bool)
        if any(patch is d for d in dubious):
            on = inliers(found.surface, cloud.xyz[patch.members], cloud.normals[patch.members], limit, TURN)
        if on.mean() < HALF:
            result.append(patch)
        else:
            members.append(patch.members[on])
    mine = np.unique(np.concatenate(members))
    rms, turn = spreads(found.surface, cloud, mine)
    return [*result, replace(found, members=mine, rms=rms, turn=turn)]
