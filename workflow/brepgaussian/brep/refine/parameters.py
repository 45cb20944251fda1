"""Local parameters of the five surfaces: derivatives of the signed distance, small updates, the prior.

Every surface has a minimal vector delta around its present state, in the frame u, v, axis:
plane (tilt towards u, towards v, offset along the normal), sphere (centre xyz, radius), cylinder (origin
u, v, tilt u, v, radius), cone (as the cylinder, and the half angle), torus (centre u, v, axis, tilt u, v,
radius, minor radius). A cone is held by a reference circle near its face, not by its apex, which may be
far away.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.surfaces import Surface, unit

Array = NDArray[np.float64]

COUNT = {"plane": 3, "sphere": 4, "cylinder": 5, "cone": 6, "torus": 7}
# Which parameters are angles (radians); the others are lengths in the unit frame.
_ANGLES = {
    "plane": (True, True, False),
    "sphere": (False,) * 4,
    "cylinder": (False, False, True, True, False),
    "cone": (False, False, True, True, False, True),
    "torus": (False, False, False, True, True, False, False),
}
_SMALLEST = 1e-6  # radii and cone angles stay above this


def recentre(surface: Surface, points: Array) -> Surface:
    """Move the reference point on the surface or its axis next to (N, 3) points: the same surface."""
    center = 0.5 * (points.min(axis=0) + points.max(axis=0))
    if surface.kind == "plane":
        return replace(surface, origin=center - ((center - surface.origin) @ surface.axis) * surface.axis)
    if surface.kind not in ("cylinder", "cone"):
        return surface
    along = float((center - surface.origin) @ surface.axis)
    radius = surface.radius + along * np.tan(surface.angle) if surface.kind == "cone" else surface.radius
    if radius <= _SMALLEST:  # the points surround the apex
        return surface
    return replace(surface, origin=surface.origin + along * surface.axis, radius=radius)


def derivative(surface: Surface, points: Array) -> Array:
    """(N, P) derivative of `surface.signed_distance` at (N, 3) points by the P local parameters."""
    offset = points - surface.origin
    gradient = surface.sign * surface.normals(points)  # natural orientation
    ones = np.ones(len(points))
    u, v, axis = surface.frame()
    if surface.kind == "plane":
        columns = [offset @ u, offset @ v, -ones]
    elif surface.kind == "sphere":
        columns = [*(-gradient.T), -ones]
    else:
        along = offset @ axis
        across = offset - along[:, None] * axis
        rho = np.maximum(np.linalg.norm(across, axis=1), 1e-12)
        ru, rv = across @ u / rho, across @ v / rho
        if surface.kind == "cylinder":
            columns = [-ru, -rv, -along * ru, -along * rv, -ones]
        elif surface.kind == "cone":
            cosine, sine = np.cos(surface.angle), np.sin(surface.angle)
            tilt = along * cosine + rho * sine
            turn = -(rho - surface.radius) * sine - along * cosine
            columns = [-cosine * ru, -cosine * rv, -ru * tilt, -rv * tilt, -cosine * ones, turn]
        else:
            q = rho - surface.radius
            length = np.maximum(np.hypot(q, along), 1e-12)
            tilt = along * surface.radius / length
            columns = [-gradient @ u, -gradient @ v, -gradient @ axis, ru * tilt, rv * tilt, -q / length, -ones]
    return surface.sign * np.column_stack(columns)


def update(surface: Surface, delta: Array) -> Surface:
    """The surface after a step of its local parameters."""
    u, v, axis = surface.frame()
    origin, radius, minor, angle = surface.origin, surface.radius, surface.minor, surface.angle
    if surface.kind == "plane":
        return replace(surface, origin=origin + delta[2] * axis, axis=unit(axis + delta[0] * u + delta[1] * v))
    if surface.kind == "sphere":
        return replace(surface, origin=origin + delta[:3], radius=max(radius + delta[3], _SMALLEST))
    if surface.kind == "torus":
        origin = origin + delta[0] * u + delta[1] * v + delta[2] * axis
        axis = unit(axis + delta[3] * u + delta[4] * v)
        radius, minor = max(radius + delta[5], _SMALLEST), max(minor + delta[6], _SMALLEST)
        return replace(surface, origin=origin, axis=axis, radius=radius, minor=minor)
    origin, axis = origin + delta[0] * u + delta[1] * v, unit(axis + delta[2] * u + delta[3] * v)
    radius = max(radius + delta[4], _SMALLEST)
    if surface.kind == "cone":
        angle = float(np.clip(angle + delta[5], _SMALLEST, np.pi / 2 - _SMALLEST))
    return replace(surface, origin=origin, axis=axis, radius=float(radius), angle=angle)


def difference(start: Surface, now: Surface) -> Array:
    """(P,) local parameters of `now` relative to `start`, in the frame of `now`, to first order."""
    u, v, axis = now.frame()
    if now.kind == "plane":
        return np.array([-start.axis @ u, -start.axis @ v, start.axis @ (now.origin - start.origin)])
    shift = now.origin - start.origin
    if now.kind == "sphere":
        return np.append(shift, now.radius - start.radius)
    tilt = [-start.axis @ u, -start.axis @ v]
    if now.kind == "torus":
        return np.array([shift @ u, shift @ v, shift @ axis, *tilt, now.radius - start.radius, now.minor - start.minor])
    along = shift @ start.axis
    shift = shift - along * start.axis
    grown = now.radius - start.radius - along * np.tan(start.angle) * (now.kind == "cone")
    parts = [shift @ u, shift @ v, *tilt, grown]
    return np.array([*parts, now.angle - start.angle] if now.kind == "cone" else parts)


def prior_sigmas(kind: str, angle: float, length: float) -> Array:
    """(P,) standard deviation of each local parameter: `angle` in radians, `length` in the unit frame."""
    return np.where(_ANGLES[kind], angle, length)
