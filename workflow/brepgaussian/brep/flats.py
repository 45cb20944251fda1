"""Shoulders at which flats on round shafts end, too small to have labels of their own.

A flat that is milled a little below a shaft's wall ends at a half moon of few points. Without it the flat goes on to
the next face, or is none.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.patches import Patch, guessed
from brepgaussian.geometry.surfaces import plane

Array = NDArray[np.float64]

_ALONG = np.sin(np.radians(3))  # of the angle between a flat and its shaft's axis
_ACROSS = np.cos(np.radians(10))  # of the angle between a shoulder and the axis
_DEEPEST, _SHALLOWEST = 0.3, 0.97  # radii from the axis that a flat lies
_SPAN = 0.8  # of the angle that a flat takes of its shaft: within it the wall ends where the flat does
_END = 0.98  # quantile of a flat's points that tells where it ends
_LEAST = 12  # points of the wall beyond
_MOST_BESIDE = 0.25  # of the wall's points within the span that lie beside the flat; else it isn't cut out of this wall
_NEAR_REACHES = 4.0  # from the end, within which a shoulder is known
_ROUND = 9  # points that stand for a shoulder, along each side


def ends_of_flats(patches: Sequence[Patch]) -> list[Patch]:
    """Planes across shafts where flats end and the shaft's wall goes on, unless patches are known there."""
    shafts = [p for p in patches if p.surface.kind == "cylinder" and not p.surface.flipped]
    planes = [p for p in patches if p.surface.kind == "plane"]
    found = []
    for shaft in shafts:
        for flat in planes:
            for way in (1.0, -1.0):
                end = _end(shaft, flat, way)
                if end is not None and not any(_is_there(shaft, flat, end, known) for known in planes):
                    found.append(_shoulder(shaft, flat, end, way))
    return found


def _depth(shaft: Patch, flat: Patch) -> float:
    """How far a flat lies from a shaft's axis, in radii; outside of 0 to 1 where it isn't one of this shaft's."""
    if abs(float(flat.surface.axis @ shaft.surface.axis)) > _ALONG:
        return -1.0
    return float((flat.surface.origin - shaft.surface.origin) @ flat.surface.axis) / shaft.surface.radius


def _end(shaft: Patch, flat: Patch, way: float) -> float | None:
    """The height along a shaft's axis, from its origin, at which a flat ends towards one `way`; None if it is none."""
    depth = _depth(shaft, flat)
    if not _DEEPEST < depth < _SHALLOWEST:
        return None
    wall, on = shaft.surface, flat.xyz - shaft.surface.origin
    across = np.cross(wall.axis, flat.surface.axis)
    if np.abs(on @ across).max() > wall.radius + 2 * shaft.reach:  # a face that is larger than a chord
        return None
    height = way * ((shaft.xyz - wall.origin) @ wall.axis)
    within = shaft.normals @ flat.surface.axis > np.cos(_SPAN * np.arccos(depth))
    first, end = np.quantile(way * (on @ wall.axis), [1 - _END, _END])
    beside = within & (height > first) & (height < end - shaft.reach)
    beyond = within & (height > end)
    if beyond.sum() < _LEAST or beside.sum() > _MOST_BESIDE * within.sum():
        return None
    return way * float(end)


def _is_there(shaft: Patch, flat: Patch, end: float, known: Patch) -> bool:
    """Whether a plane is the shoulder already."""
    wall = shaft.surface
    if abs(float(known.surface.axis @ wall.axis)) < _ACROSS:
        return False
    on = known.xyz - wall.origin
    above = on @ flat.surface.axis > _depth(shaft, flat) * wall.radius
    within = wall.signed_distance(known.xyz) < shaft.reach
    near = np.abs(on @ wall.axis - end) < _NEAR_REACHES * shaft.reach
    return bool((above & within & near).sum() >= _LEAST)


def _shoulder(shaft: Patch, flat: Patch, end: float, way: float) -> Patch:
    """The half moon between a flat and its shaft's wall."""
    wall, depth = shaft.surface, _depth(shaft, flat)
    half = np.arccos(depth)
    angle, share = (a.ravel() for a in np.meshgrid(*[np.linspace(-0.9, 0.9, _ROUND), np.linspace(0.1, 0.9, _ROUND)]))
    turn = angle * half
    chord = depth / np.cos(turn)  # radii from the axis at which the flat is met
    radius = wall.radius * (chord + share * (1 - chord))
    up, across = flat.surface.axis, np.cross(wall.axis, flat.surface.axis)
    middle = wall.origin + end * wall.axis
    points = middle + radius[:, None] * (np.cos(turn)[:, None] * up + np.sin(turn)[:, None] * across)
    return guessed(plane(middle, -way * wall.axis), points, shaft.reach)
