"""Fillets made to touch the two faces that they round off.

Silhouettes cut an inner fillet's hull into facets, so its points know its radius badly and its axis not at all. What
touches both neighbours has one free parameter, its radius: a torus between a coaxial cylinder and a plane, a cylinder
between two planes (an edge, or the corner of a pocket). The round end of a slot has even less, its place; and the
slot's walls, which few views show, are parallel and stand square on its floor.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from brepgaussian.brep.patches import Patch, neighbours
from brepgaussian.geometry.rolling import rolling, touching
from brepgaussian.geometry.surfaces import Surface, cylinder, plane, unit

Array = NDArray[np.float64]
Builder = Callable[[float], Surface]  # of a surface with one free parameter

_ACROSS = np.cos(np.radians(5.0))  # between the cylinder's axis and the plane's normal
_ALONG = np.cos(np.radians(8.0))  # between the cylinder's axis and the patch's own
_ALONG_WALL = np.sin(np.radians(8.0))  # between the normal of a plane that a cylinder rounds off and its axis
_LEAST, _MOST = 0.01, 0.9  # tube's radius over the cylinder's
_LIKE = 3.0  # times its own radius, up or down, that the cylinder between two planes may have
_PARALLEL = np.cos(np.radians(5.0))  # between two planes that are the walls of a slot
_FACING = np.cos(np.radians(20.0))  # the same as the points have them,
_LEANING = np.sin(np.radians(12.0))  # and of each to the direction in which the slot is deep
_STRAIGHT = 1e-6  # one minus a cosine: walls that are parallel already stay as they are
_SAME = 1e-4  # unit frame: surfaces nearer than this are one, a thirtieth of a pixel
_WORSE = 3.0  # times its present residual, or noises, that the patch may have on its fillet


def rounded(patches: Sequence[Patch], noise: float) -> list[Patch] | None:
    """The patches with every fillet made to touch its neighbours; None if there is none to change."""
    result = _squared(patches, noise)
    for i, patch in enumerate(patches):
        surface = fillet_between(patch, [result[k] for k in neighbours(i, result)])
        if surface is None or surface.rms(patch.xyz) > _WORSE * max(patch.sigma, noise):
            continue
        if float(np.abs(surface.signed_distance(patch.surface.project(patch.xyz))).max()) > _SAME:
            result[i] = replace(patch, surface=surface, sigma=surface.rms(patch.xyz))
    return result if any(a is not b for a, b in zip(result, patches, strict=True)) else None


def fillet_between(patch: Patch, beside: Sequence[Patch]) -> Surface | None:
    """The surface of a patch's kind that touches two of the patches beside it and is closest to its points."""
    makers = {"torus": _fillets, "cylinder": _roundings}.get(patch.surface.kind)
    found = [] if makers is None else list(makers(patch, beside))
    return min(found, key=lambda f: f.rms(patch.xyz), default=None)


def _squared(patches: Sequence[Patch], noise: float) -> list[Patch]:
    """The patches with the walls beside every round end of a slot made parallel, as far as their points allow."""
    result = list(patches)
    for i, patch in enumerate(patches):
        if patch.surface.kind != "cylinder":
            continue
        planes = neighbours(i, result, "plane")
        axis = _upright(patch, [result[k] for k in planes])
        walls = [k for k in planes if abs(float(result[k].surface.axis @ axis)) < _LEANING]
        for pair in combinations(walls, 2):
            first, second = (result[k].surface.axis for k in pair)
            if not -1 + _STRAIGHT < float(first @ second) < -_FACING:
                continue
            normal = unit(first - second - ((first - second) @ axis) * axis)
            for k, side in zip(pair, (normal, -normal), strict=True):
                wall = plane(result[k].xyz.mean(axis=0), side)
                if wall.rms(result[k].xyz) <= _WORSE * max(result[k].sigma, noise):
                    result[k] = replace(result[k], surface=wall, sigma=wall.rms(result[k].xyz))
    return result


def _upright(patch: Patch, beside: Sequence[Patch]) -> Array:
    """The direction of a cylinder: the normal of the largest plane square to it, which knows it better, or its own."""
    axis = patch.surface.axis
    floors = [p for p in beside if p.surface.kind == "plane" and abs(float(p.surface.axis @ axis)) > _ALONG]
    return max(floors, key=lambda p: len(p.xyz)).surface.axis if floors else axis


def _fillets(patch: Patch, beside: Sequence[Patch]) -> Iterator[Surface]:
    """The best fillet for every pair of a cylinder and a plane beside a patch."""
    for wall in (p.surface for p in beside if p.surface.kind == "cylinder"):
        if abs(float(wall.axis @ patch.surface.axis)) < _ALONG:
            continue
        for floor in (p.surface for p in beside if p.surface.kind == "plane"):
            if abs(float(wall.axis @ floor.axis)) < _ACROSS:
                continue
            yield from on_both_sides(patch, partial(touching, wall, floor), (_LEAST * wall.radius, _MOST * wall.radius))


def _roundings(patch: Patch, beside: Sequence[Patch]) -> Iterator[Surface]:
    """The best cylinder for every pair of planes beside a patch, its axis along both."""
    walls = [p.surface for p in beside if p.surface.kind == "plane"]
    walls = [w for w in walls if abs(float(w.axis @ patch.surface.axis)) < _ALONG_WALL]
    limits = (patch.surface.radius / _LIKE, patch.surface.radius * _LIKE)
    for first, second in combinations(walls, 2):
        if abs(float(first.axis @ second.axis)) > _PARALLEL:
            if float(first.axis @ second.axis) < 0:
                yield from _slot_end(patch, _upright(patch, beside), first, second, limits)
            continue
        if abs(float(unit(np.cross(first.axis, second.axis)) @ patch.surface.axis)) < _ALONG:
            continue
        yield from on_both_sides(patch, partial(rolling, first, second), limits)


def _slot_end(
    patch: Patch, axis: Array, first: Surface, second: Surface, limits: tuple[float, float]
) -> Iterator[Surface]:
    """The half cylinder along about an axis, between two parallel walls, that is nearest to a patch."""
    normal = unit(first.axis - second.axis)
    radius = abs(float((second.origin - first.origin) @ normal)) / 2
    if not limits[0] < radius < limits[1]:
        return
    axis = unit(axis - (axis @ normal) * normal)
    middle = patch.surface.origin + ((first.origin + second.origin) / 2 - patch.surface.origin) @ normal * normal
    along = np.cross(axis, normal)

    def end(shift: float) -> Surface:
        return cylinder(middle + shift * along, axis, radius, patch.surface.flipped)

    yield from _closest(patch, end, (-radius, radius))


def on_both_sides(patch: Patch, build: Builder, limits: tuple[float, float]) -> Iterator[Surface]:
    """The closest surfaces to a patch whose radius is within limits: on a concave and on a convex edge."""
    yield from _closest(patch, lambda size: build(-size), limits)
    yield from _closest(patch, build, limits)


def _closest(patch: Patch, build: Builder, limits: tuple[float, float]) -> Iterator[Surface]:
    """The surface closest to a patch, if its outward side is the one that the points show."""
    best = minimize_scalar(lambda value: build(float(value)).rms(patch.xyz), bounds=limits, method="bounded").x
    surface = build(float(best))
    if float(np.median(np.einsum("ij,ij->i", surface.normals(patch.xyz), patch.normals))) > 0:
        yield surface
