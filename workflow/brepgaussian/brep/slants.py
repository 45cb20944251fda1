"""Slanting planes that are roundings under wrong labels: their neighbours hold the ends of the arc.

Two planes that meet in a narrow rounding may each take a piece of it; what is left in the middle bends so little that
a plane explains it. A cylinder that touches both neighbours has one free parameter and explains these points better:
a proposal for the images.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import combinations

import numpy as np

from brepgaussian.brep.fillets import on_both_sides, rolling
from brepgaussian.brep.patches import Patch, neighbours, supported
from brepgaussian.brep.simplify import Change
from brepgaussian.geometry.surfaces import Surface, unit

_BETWEEN = np.cos(np.radians(75.0))  # between the normal of a slant and those of the faces that it lies between
_ALONG = np.sin(np.radians(12.0))  # between its normal and the edge of both
_BLUNT = np.cos(np.radians(20.0))  # between the faces: fewer degrees leave no room for a slant
_LARGEST = 0.5  # radius, longest sides of the object
_CLEARLY = 0.85  # of the plane's residual that the rounding may leave: chamfers leave more


def slants(patches: Sequence[Patch]) -> list[Change]:
    """One change for every plane between two others that a rounding of their edge explains better."""
    result = []
    for i, patch in enumerate(patches):
        if patch.surface.kind != "plane":
            continue
        faces = [patches[k].surface for k in neighbours(i, patches, "plane")]
        best = min(_roundings(patch, faces), key=lambda s: s.rms(patch.xyz), default=None)
        if best is not None and best.rms(patch.xyz) < _CLEARLY * patch.sigma:
            new = supported(patch, best, patch.xyz, patch.normals)
            result.append(Change(f"patch {patch.primitive} as a rounding", (i,), (new,)))
    return result


def _roundings(patch: Patch, faces: Sequence[Surface]) -> Iterator[Surface]:
    """The best rounding of the edge of every two planes that a third one lies between."""
    normal = patch.surface.axis
    between = [s for s in faces if _BETWEEN < float(s.axis @ normal) < _BLUNT]
    for first, second in combinations(between, 2):
        if abs(float(first.axis @ second.axis)) > _BLUNT:
            continue
        if abs(float(unit(np.cross(first.axis, second.axis)) @ normal)) < _ALONG:
            yield from on_both_sides(patch, partial(rolling, first, second), (patch.reach, _LARGEST))
