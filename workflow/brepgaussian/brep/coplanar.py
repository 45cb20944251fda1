"""Small planes put on a larger one that is nearly the same, whichever way they look.

The back of a rib that is seen through a hole in its wall lies in the plane of the wall's other side. Few points tell
its plane, and it leans by some degrees; an edge that a few samples show is then pixels off in the rebuilt solid.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from brepgaussian.brep.patches import Patch
from brepgaussian.geometry.surfaces import plane

_SMALL = 0.25  # of the larger plane's points, at most
_PARALLEL = np.cos(np.radians(5.0))
_SAME = 1e-6  # unit frame: on it already


def coplanar(patches: Sequence[Patch]) -> list[Patch]:
    """The patches, small planes on the largest one within reach of their points that is nearly parallel."""
    result = list(patches)
    for i, patch in enumerate(patches):
        if patch.surface.kind != "plane":
            continue
        near = [other for other in patches if _may_be(patch, other)]
        if not near:
            continue
        large = max(near, key=lambda other: len(other.xyz)).surface
        surface = plane(large.origin, np.copysign(1.0, float(large.axis @ patch.surface.axis)) * large.axis)
        if np.abs(surface.signed_distance(patch.surface.project(patch.xyz))).max() > _SAME:
            result[i] = replace(patch, surface=surface, sigma=surface.rms(patch.xyz))
    return result


def _may_be(patch: Patch, other: Patch) -> bool:
    """Whether a patch may lie in the plane of another one, of which many more points tell."""
    surface = other.surface
    if surface.kind != "plane" or len(patch.xyz) > _SMALL * len(other.xyz):
        return False
    if abs(float(surface.axis @ patch.surface.axis)) < _PARALLEL:
        return False
    return bool(np.median(np.abs(surface.signed_distance(patch.xyz))) < patch.reach)
