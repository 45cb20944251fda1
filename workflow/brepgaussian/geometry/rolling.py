"""Surfaces of a ball that rolls along the edge of two faces: fillets."""

import numpy as np

from brepgaussian.geometry.surfaces import Surface, cylinder, torus, unit


def rolling(first: Surface, second: Surface, radius: float) -> Surface:
    """The cylinder that touches two planes, along the line in which they meet.

    Args:
        first, second: planes that are not parallel.
        radius: signed, positive on a convex edge: the axis lies in the material, `radius` below both faces.
    """
    along = np.cross(first.axis, second.axis)
    heights = [float(p.origin @ p.axis) - radius for p in (first, second)]
    start = np.linalg.solve(np.array([first.axis, second.axis, along]), [*heights, float(along @ first.origin)])
    return cylinder(start, unit(along), abs(radius), radius < 0)


def touching(wall: Surface, floor: Surface, minor: float) -> Surface:
    """The torus about the axis of a cylinder or cone that touches this and a plane.

    Args:
        wall: the cylinder or cone; floor: the plane across its axis.
        minor: signed radius of the tube, positive on a convex edge: the tube's centre lies in the material, `minor`
            below both faces.
    """
    height = float((floor.origin - wall.origin) @ floor.axis) - minor
    ahead = float(wall.axis @ floor.axis)
    along = height / ahead
    beside = wall.radius + along * np.tan(wall.angle) - minor * wall.sign / np.cos(wall.angle)
    return torus(wall.origin + along * wall.axis, wall.axis, max(beside, abs(minor) / 10), abs(minor), minor < 0)
