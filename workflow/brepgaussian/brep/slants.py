"""Slanting planes that are roundings under wrong labels: their neighbours hold the ends of the arc.

Two planes that meet in a narrow rounding may each take a piece of it; what is left in the middle bends so little that
a plane explains it. A cylinder that touches both neighbours has one free parameter and explains these points better:
a proposal for the images.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np

from brepgaussian.brep.features import bad_edges
from brepgaussian.brep.fillets import on_both_sides
from brepgaussian.brep.patches import Patch, neighbours, supported
from brepgaussian.brep.simplify import Change
from brepgaussian.brep.structure import Structure
from brepgaussian.geometry.rolling import rolling
from brepgaussian.geometry.surfaces import Surface, unit

_BETWEEN = np.cos(np.radians(75.0))  # between the normal of a slant and those of the faces that it lies between
_ALONG = np.sin(np.radians(12.0))  # between its normal and the edge of both
_BLUNT = np.cos(np.radians(20.0))  # between the faces: fewer degrees leave no room for a slant
_LARGEST = 0.5  # radius, longest sides of the object
_CLEARLY = 0.85  # of the plane's residual that the rounding may leave: chamfers leave more
_AS_WELL = 1.5  # the same where the images refuse an edge of the plane: few points of the arc may have a label


def slants(patches: Sequence[Patch], refused: Collection[int] = ()) -> list[Change]:
    """One change for every plane between two others that a rounding of their edge explains better.

    Args:
        patches: of a job.
        refused: those that the images refuse an edge of, if only these are asked: here it may explain a little less.
    """
    result = []
    for i, patch in enumerate(patches):
        if patch.surface.kind != "plane" or (refused and i not in refused):
            continue
        faces = [patches[k].surface for k in neighbours(i, patches, "plane")]
        best = min(_roundings(patch, faces), key=lambda s: s.rms(patch.xyz), default=None)
        if best is not None and best.rms(patch.xyz) < (_AS_WELL if refused else _CLEARLY) * patch.sigma:
            new = supported(patch, best, patch.xyz, patch.normals)
            result.append(Change(f"patch {patch.primitive} as a rounding", (i,), (new,)))
    return result


def refused_slants(
    structure: Structure, surfaces: Sequence[Surface], patches: Sequence[Patch], edges: Sequence[Mapping[str, Any]]
) -> list[Change]:
    """The same for planes with edges that the images place elsewhere; arguments as of `features.chamfers`."""
    refused = {s for k in bad_edges(structure, edges) for s in structure.edges[k].surfaces}
    return slants(patches, refused) if refused else []


def _roundings(patch: Patch, faces: Sequence[Surface]) -> Iterator[Surface]:
    """The best rounding of the edge of every two planes that a third one lies between."""
    normal = patch.surface.axis
    between = [s for s in faces if _BETWEEN < float(s.axis @ normal) < _BLUNT]
    for first, second in combinations(between, 2):
        if abs(float(first.axis @ second.axis)) > _BLUNT:
            continue
        if abs(float(unit(np.cross(first.axis, second.axis)) @ normal)) < _ALONG:
            yield from on_both_sides(patch, partial(rolling, first, second), (patch.reach, _LARGEST))
