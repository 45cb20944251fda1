"""Least squares on signed distances: analytic Jacobians of the five surfaces and a Levenberg solver.

A surface moves by a small vector `delta` of local parameters, in this order:

| kind | parameters |
|---|---|
| plane | tilt x, tilt y, shift along the axis |
| sphere | shift x, y, z, radius |
| cylinder | shift x, y, tilt x, tilt y, radius |
| cone | shift x, y, tilt x, tilt y, radius, half angle |
| torus | shift x, y, axis, tilt x, tilt y, radius, minor radius |

x and y are `Surface.frame()`; a tilt turns the axis towards x or y about the origin. The distances here
are *natural* ones (positive along the axis of a plane, away from the axis or centre of the others);
`flipped` plays no part in fitting.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.surfaces import Surface, unit

Array = NDArray[np.float64]
PARAMETERS = {"plane": 3, "sphere": 4, "cylinder": 5, "cone": 6, "torus": 7}

MAX_RADIUS = 1e3  # patch extents; beyond it a curved surface is a plane to any noise
MIN_CONE_ANGLE = 1e-4  # rad; a cone below it is a cylinder
SMALL = 1e-12


@dataclass(frozen=True)
class Local:
    """Points seen from a surface: what distances, normals and Jacobians are made of.

    Attributes:
        offset: (N, 3) from the origin; along: (N,) on the axis; rho: (N,) distance from the axis;
        radial: (N, 3) unit, away from the axis; distance: (N,) natural distance; normal: (N, 3) natural normal.
    """

    offset: Array
    along: Array
    rho: Array
    radial: Array
    distance: Array
    normal: Array


def localise(surface: Surface, points: Array) -> Local:
    """Coordinates of (N, 3) points about the axis of a surface."""
    offset = points - surface.origin
    along = offset @ surface.axis
    across = offset - along[:, None] * surface.axis
    rho = np.sqrt(np.einsum("ij,ij->i", across, across))
    radial = across / np.maximum(rho, SMALL)[:, None]
    if surface.kind == "cylinder":
        distance, normal = rho - surface.radius, radial
    elif surface.kind == "cone":
        cosine, sine = np.cos(surface.angle), np.sin(surface.angle)
        distance, normal = (rho - surface.radius) * cosine - along * sine, cosine * radial - sine * surface.axis
    else:
        distance, normal = replace(surface, flipped=False).field(points)
    return Local(offset, along, rho, radial, distance, normal)


def distance_jacobian(surface: Surface, points: Array) -> tuple[Array, Array]:
    """Natural signed distances and their derivatives by the local parameters.

    Args:
        surface: the surface at which to differentiate.
        points: (N, 3).

    Returns:
        (N,) distances and (N, P) Jacobian, P = `PARAMETERS[kind]`.
    """
    at = localise(surface, points)
    return at.distance, _jacobian(surface, at)


def _jacobian(surface: Surface, at: Local) -> Array:
    """(N, P) derivatives of the distances of points seen from a surface."""
    x, y, axis = surface.frame()
    tilt_x, tilt_y = _tilt(at, axis, x), _tilt(at, axis, y)
    ones = np.ones(len(at.distance))
    if surface.kind == "plane":
        columns = [tilt_x, tilt_y, -ones]
    elif surface.kind == "sphere":
        columns = [*(-at.normal @ np.column_stack([x, y, axis])).T, -ones]
    elif surface.kind == "cylinder":
        columns = [-at.normal @ x, -at.normal @ y, tilt_x, tilt_y, -ones]
    elif surface.kind == "cone":
        cosine, sine = np.cos(surface.angle), np.sin(surface.angle)
        opening = -(at.rho - surface.radius) * sine - at.along * cosine
        columns = [-at.normal @ x, -at.normal @ y, tilt_x, tilt_y, -cosine * ones, opening]
    else:
        outward = np.einsum("ij,ij->i", at.normal, at.radial)
        columns = [*(-at.normal @ np.column_stack([x, y, axis])).T, tilt_x, tilt_y, -outward, -ones]
    return np.column_stack(columns)


def _tilt(at: Local, axis: Array, towards: Array) -> Array:
    """(N,) derivative of the distance by a turn of the axis towards a direction, about the origin."""
    outward = np.einsum("ij,ij->i", at.normal, at.radial)
    upward = at.normal @ axis
    return -outward * at.along * (at.radial @ towards) + upward * (at.offset @ towards)


def moved(surface: Surface, delta: Array, anchor: Array | None = None) -> Surface:
    """The surface after a step of its local parameters.

    Args:
        surface: where the step starts.
        delta: (P,) local parameters.
        anchor: (3,) the middle of the points. A cylinder, cone or sphere seen as a short arc then changes its
            curvature 1 / radius linearly while the surface stays in place under the anchor: in radius and
            centre the valley of the least squares is long and bent, in curvature it is nearly quadratic.
    """
    x, y, axis = surface.frame()
    kind = surface.kind
    if kind == "plane":
        return replace(surface, origin=surface.origin + delta[2] * axis, axis=unit(axis + delta[0] * x + delta[1] * y))
    if kind == "sphere":
        shift, turned, rest = delta[:3] @ np.array([x, y, axis]), axis, delta[3:]
    elif kind == "torus":
        shift, turned, rest = delta[:3] @ np.array([x, y, axis]), unit(axis + delta[3] * x + delta[4] * y), delta[5:]
    else:
        shift, turned, rest = delta[0] * x + delta[1] * y, unit(axis + delta[2] * x + delta[3] * y), delta[4:]
    radius = surface.radius + rest[0]
    if anchor is not None and kind in ("cylinder", "sphere", "cone"):
        shift, radius = _bend(surface, shift, float(rest[0]), anchor)
    changes = {"origin": surface.origin + shift, "axis": turned, "radius": max(float(radius), SMALL)}
    if kind == "cone":
        changes["angle"] = surface.angle + float(rest[1])
    if kind == "torus":
        changes["minor"] = max(surface.minor + float(rest[1]), SMALL)
    return _proper(replace(surface, **changes))


def _bend(surface: Surface, shift: Array, change: float, anchor: Array) -> tuple[Array, float]:
    """Shift and new radius of a step whose curvature, not radius, changes linearly."""
    towards = anchor - surface.origin
    if surface.kind != "sphere":
        towards = towards - (towards @ surface.axis) * surface.axis
    length = float(np.linalg.norm(towards))
    if length < 0.5 * surface.radius:  # more than a half turn: the centre is well seen
        return shift, surface.radius + change
    towards = towards / length
    ratio = np.clip(change / surface.radius, -1.0, 0.5)
    radius = surface.radius / (1 - ratio)
    lift = shift @ towards + change  # of the surface under the anchor
    return shift + (lift - (radius - surface.radius) - shift @ towards) * towards, float(radius)


def _proper(surface: Surface) -> Surface:
    """A cone with a negative half angle opens the other way."""
    if surface.kind != "cone":
        return surface
    if surface.angle < 0:
        surface = replace(surface, axis=-surface.axis, angle=-surface.angle)
    return replace(surface, angle=float(np.clip(surface.angle, MIN_CONE_ANGLE, np.pi / 2 - MIN_CONE_ANGLE)))


def refine(
    surface: Surface,
    points: Array,
    weights: Array | None = None,
    iterations: int = 30,
    free: Sequence[int] | None = None,
) -> Surface:
    """Levenberg's method on the weighted squared signed distances.

    Args:
        surface: start.
        points: (N, 3).
        weights: (N,) non-negative, or None for ones.
        iterations: most steps tried.
        free: columns of the local parameters that may change (the axis of a cylinder stays with (0, 1, 4)).

    Returns:
        A surface of the same kind with no larger weighted sum of squares, its origin abreast of the points.
    """
    weights = np.ones(len(points)) if weights is None else weights
    total = max(float(weights.sum()), SMALL)
    middle = weights @ points / total
    extent = max(float(np.sqrt(weights @ ((points - middle) ** 2).sum(1) / total)), SMALL)
    scaled = (points - middle) / extent
    current = abreast(_scale(surface, middle, extent), scaled, weights)
    distance, jacobian = distance_jacobian(current, scaled)
    cost = float(weights @ distance**2)
    damping = 1e-3
    # bending moves the centre too: not where it is to stay
    anchor = np.zeros(3) if free is None or 0 in free else None
    columns = list(range(jacobian.shape[1]) if free is None else free)
    for _ in range(iterations):
        moving = jacobian[:, columns]
        weighted = moving * weights[:, None]
        hessian, gradient = weighted.T @ moving, weighted.T @ distance
        diagonal = np.diag(hessian) + 1e-9 * total
        delta = np.zeros(jacobian.shape[1])
        delta[columns] = -np.linalg.solve(hessian + damping * np.diag(diagonal), gradient)
        candidate = abreast(moved(current, delta, anchor=anchor), scaled, weights)
        if not _bounded(candidate):
            damping *= 8
            continue
        at = localise(candidate, scaled)
        trial_cost = float(weights @ at.distance**2)
        if not trial_cost < cost:
            if np.linalg.norm(delta) < 1e-9 or damping > 1e8:
                break
            damping *= 8
            continue
        settled = cost - trial_cost < 1e-9 * cost and damping < 1
        current, distance, jacobian, cost = candidate, at.distance, _jacobian(candidate, at), trial_cost
        damping = max(damping / 6, 1e-9)
        if settled or cost < 1e-24 * total:
            break
    return _unscale(current, middle, extent)


def abreast(surface: Surface, points: Array, weights: Array | None = None) -> Surface:
    """The same surface with its origin on its axis (or on the plane) abreast of the mean point."""
    if surface.kind in ("sphere", "torus"):
        return surface
    middle = points.mean(0) if weights is None else weights @ points / max(float(weights.sum()), SMALL)
    along = float((middle - surface.origin) @ surface.axis)
    if surface.kind == "plane":
        return replace(surface, origin=middle - along * surface.axis)
    moved_along = replace(surface, origin=surface.origin + along * surface.axis)
    if surface.kind == "cone":
        radius = surface.radius + along * np.tan(surface.angle)
        return surface if radius <= SMALL else replace(moved_along, radius=float(radius))
    return moved_along


def _bounded(surface: Surface) -> bool:
    numbers = [*surface.origin, surface.radius, surface.minor]
    return bool(np.isfinite(numbers).all() and max(surface.radius, surface.minor) < MAX_RADIUS)


def _scale(surface: Surface, middle: Array, extent: float) -> Surface:
    return replace(
        surface,
        origin=(surface.origin - middle) / extent,
        radius=surface.radius / extent,
        minor=surface.minor / extent,
    )


def _unscale(surface: Surface, middle: Array, extent: float) -> Surface:
    return replace(
        surface, origin=surface.origin * extent + middle, radius=surface.radius * extent, minor=surface.minor * extent
    )
