"""Which relations the fits of cones suggest, as `propose` does of all other surfaces."""

import numpy as np

from brepgaussian.primitives.propose import ANGLE_SHARE, CERTAIN, RADIUS_SHARE, State, clustered
from brepgaussian.primitives.relations import ANGLES_DEG, Link, direction_angle

_RADIUS, _ANGLE = 4, 5  # columns of a cone's local parameters


def equal_angles(state: State) -> list[Link]:
    """Cones of one half angle."""

    def differs(h: int, i: int) -> float | None:
        gap = abs(state.surfaces[h].angle - state.surfaces[i].angle)
        return gap if gap < min(CERTAIN * state.joint_error(h, i, _ANGLE), state.angle_tolerance(h, i)) else None

    pairs, _ = clustered(state.by_error(_cones(state), _ANGLE), differs)
    return [Link("equal_angle", h, i) for h, i in pairs]


def equal_cones(state: State) -> list[Link]:
    """Cones of one half angle that look one way and are as wide at one height, each tied to the most certain of them.

    Arcs of a chamfer's height tell a radius badly, and planes between two cones touch both only where these are alike.
    """

    def differs(h: int, i: int) -> float | None:
        one, other = state.surfaces[h], state.surfaces[i]
        angle = max(direction_angle(one, other), abs(one.angle - other.angle))
        if one.flipped != other.flipped or one.axis @ other.axis < 0 or angle > state.angle_tolerance(h, i):
            return None
        gap = abs(float(Link("equal_cone", h, i).residual(one, other)[0]))
        known = state.length_tolerance(state.joint_error(h, i, _RADIUS))
        return gap if gap < min(known, RADIUS_SHARE * min(one.radius, other.radius)) else None

    pairs, _ = clustered(state.by_error(_cones(state), _RADIUS), differs)
    return [Link("equal_cone", h, i) for h, i in pairs]


def usual_angles(state: State) -> list[Link]:
    """Cones of a usual half angle; a relation of the patch with itself."""
    links = []
    for i in _cones(state):
        limit, angle = ANGLE_SHARE * state.angle_tolerance(i, i), state.surfaces[i].angle
        links += [Link(f"half_angle_{a}", i, i) for a in ANGLES_DEG if abs(np.radians(a) - angle) < limit]
    return links


def _cones(state: State) -> list[int]:
    return [i for i, s in enumerate(state.surfaces) if s.kind == "cone"]
