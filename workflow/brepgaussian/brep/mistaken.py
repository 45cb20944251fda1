"""Fillets that were taken for something else: a cone that leans, where the ball of a fillet would roll straight.

An inner fillet's labels often keep its middle only, for its sides look like the faces that they touch. A free cone or
cylinder fits that as well as the torus does, and images hardly object: no silhouette shows it. But what touches the
faces on both sides has one free parameter where the other has five.
"""

from collections.abc import Collection, Iterator, Sequence
from itertools import combinations

import numpy as np

from brepgaussian.brep.blends import builder
from brepgaussian.brep.fillets import on_both_sides
from brepgaussian.brep.patches import Patch, neighbours
from brepgaussian.brep.simplify import Change, joined
from brepgaussian.geometry.surfaces import Surface

_STRAY = 0.02  # sine of 1.1 degrees, or share of the radius, by which a turned face misses the axis of one beside it
_NO_WORSE = 1.1  # times its present residual: as good, with four parameters less
_SQUARE = 0.996  # |cosine| of 5 degrees, between a cylinder's axis and a plane's normal,
_BLUNT = 0.9  # and at most between two planes with an edge
_RADII = (1.0, 10.0)  # of a fillet, over the mean height of its points above the farther face: 3.4 of a square edge's


def mistaken(patches: Sequence[Patch], known: Collection[int] = ()) -> list[Change]:
    """Curved faces that lean against all beside them as fillets of two of these, which explain their points as well.

    Args:
        patches: of a solid.
        known: indices of those that are fillets.
    """
    found = []
    for i, patch in enumerate(patches):
        if i in known or patch.surface.kind not in ("cone", "cylinder"):
            continue
        around = [patches[k] for k in neighbours(i, patches)]
        if not _leans(patch.surface, [p.surface for p in around]):
            continue
        made = [surface for pair in _edges(around) for surface in _fillets(patch, *pair)]
        surface = min(made, key=lambda s: s.rms(patch.xyz), default=None)
        if surface is not None and surface.rms(patch.xyz) <= _NO_WORSE * patch.surface.rms(patch.xyz):
            name = f"patch {patch.primitive} as a fillet ({surface.kind})"
            found.append(Change(name, (i,), (joined(surface, [patch]),), smooth=True))
    return found


def _leans(surface: Surface, beside: Sequence[Surface]) -> bool:
    """Whether a turned face shares its axis with no turned face beside it, and stands straight on none that is flat."""
    return not any(_straight(surface, other) for other in beside)


def _straight(surface: Surface, other: Surface) -> bool:
    if other.kind == "sphere":
        return False
    ahead = float(surface.axis @ other.axis)
    if other.kind == "plane":
        return 1 - ahead**2 < _STRAY**2
    offset = surface.origin - other.origin
    away = offset - (offset @ other.axis) * other.axis
    return bool(1 - ahead**2 < _STRAY**2 and away @ away < (_STRAY * surface.radius) ** 2)


def _edges(patches: Sequence[Patch]) -> Iterator[tuple[Surface, Surface]]:
    """Pairs of faces whose edge a fillet may round off: two planes, or a cylinder and a plane across it."""
    planes = [p.surface for p in patches if p.surface.kind == "plane"]
    for wall in (p.surface for p in patches if p.surface.kind == "cylinder"):
        yield from ((wall, floor) for floor in planes if abs(float(wall.axis @ floor.axis)) > _SQUARE)
    yield from (pair for pair in combinations(planes, 2) if abs(float(pair[0].axis @ pair[1].axis)) < _BLUNT)


def _fillets(patch: Patch, first: Surface, second: Surface) -> Iterator[Surface]:
    """What touches two faces and is nearest to a patch's points, on either side."""
    height = max(float(np.abs(s.signed_distance(patch.xyz)).mean()) for s in (first, second))
    yield from on_both_sides(patch, builder((first, second)), (_RADII[0] * height, _RADII[1] * height))
