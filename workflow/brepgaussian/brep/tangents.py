"""Walls made to touch the rounder face that they run into: the side of a bearing block, of a lug, of a rod's end.

A plane that ends a few thousandths beside the cylinder that it is tangent to leaves a slit, and all that the faces
enclose runs out by it. Where points know the cylinder better than the wall, the wall moves: it has no freedom left but
its direction, and an opposite wall may know that better too.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.brep.patches import Patch, touch
from brepgaussian.geometry.surfaces import Surface, plane, unit

Array = NDArray[np.float64]

_ALONG = np.sin(np.radians(8.0))  # between a wall's normal and the cylinder's axis, off square
_PARALLEL = np.cos(np.radians(5.0))  # between two walls
_NEAR = 5.0  # of the worse residual, or noises: a slit is no wider
_WORSE = 3.0  # times the same, that the wall may have
_SAME = 1e-6  # unit frame: a wall that touches already
_CLEAR = 1e-4  # unit frame, a thirtieth of a pixel: sheets this far apart don't meet for the kernel
_POINT = 0.5  # of the cylinder's radius, along which plane and cylinder meet at most if they touch in a point


def tangent_walls(patches: Sequence[Patch], noise: float) -> list[Patch]:
    """The patches with every wall that nearly touches a better known cylinder beside it made to touch."""
    result = list(patches)
    order = sorted((p.sigma, i) for i, p in enumerate(patches) if p.surface.kind == "cylinder")
    for _, i in order:
        tree = cKDTree(patches[i].xyz)
        for k, wall in enumerate(patches):
            fits = wall.surface.kind == "plane" and _is_looser(wall, patches[i]) and result[k] is wall
            if not (fits and touch(wall, patches[i], tree=tree)):
                continue
            worse = max(wall.sigma, patches[i].sigma, noise)
            surface = _touching(wall, patches, patches[i].surface, _NEAR * worse)
            if surface is not None and surface.rms(wall.xyz) <= _WORSE * worse:
                result[k] = replace(wall, surface=surface, sigma=surface.rms(wall.xyz))
    return result


def cleared(patches: Sequence[Patch], noise: float = 0.0) -> list[Patch]:
    """The patches with every plane that touches a cylinder in a point, the flat of a rod's eye, moved clear of it.

    The kernel finds no solid between sheets that touch.
    """
    result = list(patches)
    for round_ in (p for p in patches if p.surface.kind == "cylinder"):
        tree = cKDTree(round_.xyz)
        for k, wall in enumerate(patches):
            surface, axis = result[k].surface, round_.surface.axis
            if surface.kind != "plane" or abs(float(surface.axis @ axis)) > _ALONG:
                continue
            normal = unit(surface.axis - (surface.axis @ axis) * axis)
            gap = float((surface.origin - round_.surface.origin) @ normal) - round_.surface.radius
            if abs(gap) >= _NEAR * max(wall.sigma, noise):
                continue
            meeting = wall.xyz[tree.query(wall.xyz)[0] <= 2 * max(wall.reach, round_.reach)] @ axis
            if len(meeting) and np.ptp(meeting) < _POINT * round_.surface.radius + 2 * round_.reach:
                result[k] = replace(wall, surface=plane(surface.origin + (_CLEAR - gap) * normal, normal))
    return result


def _touching(wall: Patch, patches: Sequence[Patch], round_: Surface, near: float) -> Surface | None:
    """The plane beside a wall that touches a cylinder on the side to which both look; None if it does or is far off."""
    if abs(float(wall.surface.axis @ round_.axis)) > _ALONG:
        return None
    side = -1.0 if round_.flipped else 1.0
    normal = _direction(wall, patches)
    normal = unit(normal - (normal @ round_.axis) * round_.axis)
    contact = round_.origin + side * round_.radius * normal
    height = wall.surface.origin - contact
    gap = float(height @ normal)
    turned = float(np.linalg.norm(np.cross(normal, wall.surface.axis)))
    if abs(gap) > near or (abs(gap) < _SAME and turned < _SAME):
        return None
    along = height - gap * normal
    return plane(contact + along, normal)


def _direction(wall: Patch, patches: Sequence[Patch]) -> Array:
    """The wall's normal, or that of a parallel or opposite one whose points know it better."""
    best, axis = wall, wall.surface.axis
    for other in patches:
        cosine = float(other.surface.axis @ wall.surface.axis) if other.surface.kind == "plane" else 0.0
        if abs(cosine) > _PARALLEL and _looseness(other) < _looseness(best):
            best, axis = other, np.copysign(1.0, cosine) * other.surface.axis
    return axis


def _is_looser(wall: Patch, round_: Patch) -> bool:
    """Whether points know a wall worse than the cylinder beside it: they lie farther from it, or on less of it."""
    return wall.sigma > round_.sigma or _looseness(wall) > _looseness(round_)


def _looseness(patch: Patch) -> float:
    """How badly points tell a plane's direction: their distance from it over their extent."""
    return patch.sigma / max(float(np.linalg.norm(np.ptp(patch.xyz, axis=0))), 1e-9)
