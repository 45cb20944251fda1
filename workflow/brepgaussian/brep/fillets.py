"""Fillets between a cylinder and a plane across its axis, made to touch both.

Silhouettes cut an inner fillet's hull into facets, so its points know its radius badly and its axis not at all. A torus
that touches a coaxial cylinder and the plane has one free parameter: the radius of its tube.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.spatial import cKDTree

from brepgaussian.brep.patches import Patch, touch
from brepgaussian.geometry.surfaces import Surface, torus

_TOUCH = 3.0  # of reach: patches this near to each other are neighbours
_ACROSS = np.cos(np.radians(5.0))  # between the cylinder's axis and the plane's normal
_ALONG = np.cos(np.radians(8.0))  # between the cylinder's axis and the patch's own
_LEAST, _MOST = 0.01, 0.9  # tube's radius over the cylinder's
_SAME = 1e-4  # unit frame: tori nearer than this are one, a thirtieth of a pixel
_WORSE = 3.0  # times its present residual, or noises, that the patch may have on its fillet


def rounded(patches: Sequence[Patch], noise: float) -> list[Patch] | None:
    """The patches with every fillet made to touch its neighbours; None if there is none to change."""
    result = list(patches)
    for i, patch in enumerate(patches):
        if patch.surface.kind != "torus":
            continue
        tree = cKDTree(patch.xyz)
        beside = [p for k, p in enumerate(patches) if k != i and touch(p, patch, _TOUCH, tree)]
        found = [f for f in _fillets(patch, beside) if f.rms(patch.xyz) <= _WORSE * max(patch.sigma, noise)]
        if found:
            surface = min(found, key=lambda f: f.rms(patch.xyz))
            if float(np.abs(surface.signed_distance(patch.surface.project(patch.xyz))).max()) > _SAME:
                result[i] = replace(patch, surface=surface, sigma=surface.rms(patch.xyz))
    return result if any(a is not b for a, b in zip(result, patches, strict=True)) else None


def _fillets(patch: Patch, beside: Sequence[Patch]) -> Iterator[Surface]:
    """The best fillet for every pair of a cylinder and a plane beside a patch."""
    for wall in (p.surface for p in beside if p.surface.kind == "cylinder"):
        if abs(float(wall.axis @ patch.surface.axis)) < _ALONG:
            continue
        for floor in (p.surface for p in beside if p.surface.kind == "plane"):
            if abs(float(wall.axis @ floor.axis)) < _ACROSS:
                continue
            for sign in (-1, 1):
                limits = (_LEAST * wall.radius, _MOST * wall.radius)

                def cost(minor: float, wall: Surface = wall, floor: Surface = floor, sign: int = sign) -> float:
                    return touching(wall, floor, sign * minor).rms(patch.xyz)

                minor = float(minimize_scalar(cost, bounds=limits, method="bounded").x)
                surface = touching(wall, floor, sign * minor)
                if float(np.median(np.einsum("ij,ij->i", surface.normals(patch.xyz), patch.normals))) > 0:
                    yield surface


def touching(wall: Surface, floor: Surface, minor: float) -> Surface:
    """The torus about a cylinder's axis that touches the cylinder and a plane.

    Args:
        wall: the cylinder; floor: the plane across its axis.
        minor: signed radius of the tube, positive on a convex edge: the tube's centre lies in the material, `minor`
            below both faces.
    """
    height = float((floor.origin - wall.origin) @ floor.axis) - minor
    ahead = float(wall.axis @ floor.axis)
    centre = wall.origin + height / ahead * wall.axis
    return torus(centre, wall.axis, max(wall.radius - minor * wall.sign, abs(minor) / 10), abs(minor), minor < 0)
