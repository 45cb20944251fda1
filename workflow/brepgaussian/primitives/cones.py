"""Which relations the fits of cones suggest, as `propose` does of all other surfaces."""

import numpy as np

from brepgaussian.primitives.propose import ANGLE_SHARE, CERTAIN, RADIUS_SHARE, State
from brepgaussian.primitives.relations import ANGLES_DEG, Link, direction_angle


def equal_angles(state: State) -> list[Link]:
    """Cones of one half angle."""
    cones = [i for i, s in enumerate(state.surfaces) if s.kind == "cone"]
    cones.sort(key=lambda i: (state.length_error(i, 5), i))
    links = []
    heads: list[int] = []
    for i in cones:
        near = [(abs(state.surfaces[h].angle - state.surfaces[i].angle), h) for h in heads]
        fitting = [
            (gap, h)
            for gap, h in near
            if gap
            < min(CERTAIN * np.hypot(state.length_error(h, 5), state.length_error(i, 5)), state.angle_tolerance(h, i))
        ]
        if fitting:
            links.append(Link("equal_angle", min(fitting)[1], i))
        else:
            heads.append(i)
    return links


def equal_cones(state: State) -> list[Link]:
    """Cones of one half angle that look one way and are as wide at one height, each tied to the most certain of them.

    Arcs of a chamfer's height tell a radius badly, and planes between two cones touch both only where these are alike.
    """
    cones = [i for i, s in enumerate(state.surfaces) if s.kind == "cone"]
    cones.sort(key=lambda i: (state.length_error(i, 4), i))
    links = []
    heads: list[int] = []
    for i in cones:
        fitting = []
        for h in heads:
            one, other = state.surfaces[h], state.surfaces[i]
            angle = max(direction_angle(one, other), abs(one.angle - other.angle))
            if one.flipped != other.flipped or one.axis @ other.axis < 0 or angle > state.angle_tolerance(h, i):
                continue
            gap = abs(float(Link("equal_cone", h, i).residual(one, other)[0]))
            limit = min(
                state.length_tolerance(state.joint_error(h, i, 4)), RADIUS_SHARE * min(one.radius, other.radius)
            )
            if gap < limit:
                fitting.append((gap, h))
        if fitting:
            links.append(Link("equal_cone", min(fitting)[1], i))
        else:
            heads.append(i)
    return links


def usual_angles(state: State) -> list[Link]:
    """Cones of a usual half angle; a relation of the patch with itself."""
    links = []
    for i, surface in enumerate(state.surfaces):
        if surface.kind == "cone":
            limit = ANGLE_SHARE * state.angle_tolerance(i, i)
            links += [Link(f"half_angle_{a}", i, i) for a in ANGLES_DEG if abs(np.radians(a) - surface.angle) < limit]
    return links
