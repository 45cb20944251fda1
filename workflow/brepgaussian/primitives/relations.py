"""Relations between surfaces as equations: a residual vector that is zero where the relation holds.

Lengths are in the unit frame and angles in radians, so that one metre-like unit and one radian weigh alike;
significance is judged with the covariances of the fits, never with these raw numbers.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]
Residual = Callable[[Surface, Surface], Array]

_TINY = 1e-12  # a length that is none
ANGLES_DEG = (30, 45, 60)  # between directions of one part, besides 0 and 90


@dataclass(frozen=True)
class Link:
    """A relation of two patches (of one, where both are the same).

    Attributes:
        kind: name, a key of `RESIDUALS`.
        first, second: indices of patches.
    """

    kind: str
    first: int
    second: int

    def residual(self, first: Surface, second: Surface) -> Array:
        """(rows,) zero where the relation holds."""
        return RESIDUALS[self.kind](first, second)


def direction_angle(first: Surface, second: Surface) -> float:
    """Angle between two axes without their sense, radians in [0, pi/2]."""
    across = float(np.linalg.norm(np.cross(first.axis, second.axis)))
    return float(np.arctan2(across, abs(float(first.axis @ second.axis))))


def axis_gap(first: Surface, second: Surface) -> float:
    """Distance of the second's origin from the first's axis."""
    offset = second.origin - first.origin
    return float(np.linalg.norm(offset - (offset @ first.axis) * first.axis))


def _parallel(first: Surface, second: Surface) -> Array:
    return np.cross(first.axis, second.axis)  # three rows of rank two: no frame that could jump


def _perpendicular(first: Surface, second: Surface) -> Array:
    return np.array([first.axis @ second.axis])


def _angle(degrees: float) -> Residual:
    cosine = float(np.cos(np.radians(degrees)))

    def residual(first: Surface, second: Surface) -> Array:
        product = float(first.axis @ second.axis)
        return np.array([product - np.copysign(cosine, product)])

    return residual


def _on_axis(first: Surface, second: Surface) -> Array:
    """The second's origin on the first's axis."""
    offset = second.origin - first.origin
    return np.asarray(offset - (offset @ first.axis) * first.axis)


def _coaxial(first: Surface, second: Surface) -> Array:
    if second.kind == "sphere":
        return _on_axis(first, second)
    if first.kind == "sphere":
        return _on_axis(second, first)
    return np.concatenate([_parallel(first, second), _on_axis(first, second)])


def _equal_radius(first: Surface, second: Surface) -> Array:
    if first.kind == "torus" and second.kind == "torus":
        return np.array([first.minor - second.minor])
    return np.array([first.radius - second.radius])


def _equal_angle(first: Surface, second: Surface) -> Array:
    return np.array([first.angle - second.angle])


def _equal_cone(first: Surface, second: Surface) -> Array:
    """Cones of one radius at one height along parallel axes: a chamfer or draft that goes on around corners."""
    height = float((second.origin - first.origin) @ first.axis)
    return np.array([first.radius + height * np.tan(first.angle) - second.radius])


def _half_angle(degrees: float) -> Residual:
    target = float(np.radians(degrees))
    return lambda first, second: np.array([first.angle - target])


def _coplanar(first: Surface, second: Surface) -> Array:
    return np.append(_parallel(first, second), (second.origin - first.origin) @ first.axis)


def _same(first: Surface, second: Surface) -> Array:
    """One and the same analytic surface."""
    if first.kind == "plane":
        return _coplanar(first, second)
    if first.kind == "sphere":
        return np.append(second.origin - first.origin, second.radius - first.radius)
    common = np.concatenate([_parallel(first, second), _on_axis(first, second)])
    if first.kind == "cylinder":
        return np.append(common, second.radius - first.radius)
    lift = (second.origin - first.origin) @ first.axis
    if first.kind == "torus":
        return np.concatenate([common, [lift, second.radius - first.radius, second.minor - first.minor]])
    radius = first.radius + lift * np.tan(first.angle)
    return np.concatenate([common, [second.radius - radius, second.angle - first.angle]])


def _touching(height: float, radius: float) -> float:
    return height - float(np.copysign(radius, height))


def _tangent(first: Surface, second: Surface) -> Array:
    """Tangency of a plane with any round surface, of coaxial pieces, of parallel cylinders, of a ball's end."""
    if second.kind == "plane" or first.kind == "sphere":
        first, second = second, first
    if first.kind == "plane":
        height = float((second.origin - first.origin) @ first.axis)
        if second.kind == "cylinder":
            return np.array([first.axis @ second.axis, _touching(height, second.radius)])
        if second.kind == "sphere":
            return np.array([_touching(height, second.radius)])
        if second.kind == "cone":
            return _chamfer_of_round(first, second)
        return np.append(_parallel(first, second), _touching(height, second.minor))
    if second.kind == "sphere":
        return _ball_of_ring(first, second) if first.kind == "torus" else _ball_of_taper(first, second)
    if second.kind != "torus":
        first, second = second, first
    if second.kind == "torus":
        return _fillet_of_turned(first, second)
    distance = axis_gap(first, second)
    outside, inside = distance - first.radius - second.radius, distance - abs(first.radius - second.radius)
    return np.append(_parallel(first, second), outside if abs(outside) < abs(inside) else inside)


def _chamfer_of_round(flat: Surface, cone: Surface) -> Array:
    """A chamfer's plane that goes on in the cone of a rounded corner: the same normal along a line of the cone."""
    normal = cone.sign * flat.sign * flat.axis  # as if the cone were no hole
    radial = normal - (normal @ cone.axis) * cone.axis
    radial /= max(float(np.linalg.norm(radial)), _TINY)
    place = cone.origin + cone.radius * radial
    return np.array([normal @ cone.axis + np.sin(cone.angle), (place - flat.origin) @ flat.axis])


def _ball_of_taper(cone: Surface, ball: Surface) -> Array:
    """A ball on a cone's axis that touches it in a circle: a taper's round end. A cylinder is a cone of angle 0."""
    height = float((ball.origin - cone.origin) @ cone.axis)
    across = (cone.radius + height * np.tan(cone.angle)) * np.cos(cone.angle)  # from the ball's centre to the cone
    return np.append(_on_axis(cone, ball), across - ball.radius)


def _fillet_of_turned(cone: Surface, ring: Surface) -> Array:
    """A torus about a cone's axis that touches it in a circle: a boss's foot. A cylinder is a cone of angle 0."""
    height = float((ring.origin - cone.origin) @ cone.axis)
    across = (ring.radius - cone.radius - height * np.tan(cone.angle)) * np.cos(cone.angle)  # to the middle of the tube
    return np.append(_coaxial(cone, ring), _touching(across, ring.minor))


def _ball_of_ring(ring: Surface, ball: Surface) -> Array:
    """A ball that ends a bent rod, or one on the axis of a torus that touches it in a circle."""
    offset = ball.origin - ring.origin
    height, lever = float(offset @ ring.axis), float(np.linalg.norm(_on_axis(ring, ball)))
    if ends_tube(ring, ball):
        return np.array([height, lever - ring.radius, ball.radius - ring.minor])
    span = float(np.hypot(height, ring.radius))  # from the ball's centre to the tube's centre line
    outside, inside = span - ball.radius - ring.minor, span - abs(ball.radius - ring.minor)
    return np.append(_on_axis(ring, ball), outside if abs(outside) < abs(inside) else inside)


def ends_tube(ring: Surface, ball: Surface) -> bool:
    """Whether a ball's centre lies within the tube of a torus: there it ends it, if anything."""
    return bool(ring.sign * ring.signed_distance(ball.origin[None])[0] < 0)


def _bend(first: Surface, second: Surface) -> Array:
    """A pipe that goes on in a bend: a cylinder and a torus of one tube, whose centre line goes on smoothly."""
    pipe, ring = (first, second) if first.kind == "cylinder" else (second, first)
    offset = pipe.origin - ring.origin
    lever = float(np.linalg.norm(np.cross(offset, pipe.axis)))  # from the centre to the axis
    gaps = [lever - ring.radius, pipe.radius - ring.minor]
    return np.array([pipe.axis @ ring.axis, offset @ ring.axis, *gaps])


RESIDUALS: dict[str, Residual] = {
    "parallel": _parallel,
    "perpendicular": _perpendicular,
    **{f"angle_{a}": _angle(a) for a in ANGLES_DEG},
    **{f"half_angle_{a}": _half_angle(a) for a in ANGLES_DEG},
    "coaxial": _coaxial,
    "equal_radius": _equal_radius,
    "equal_angle": _equal_angle,
    "equal_cone": _equal_cone,
    "same": _same,
    "tangent": _tangent,
    "bend": _bend,
}

TANGENT_PAIRS = {
    frozenset(p)
    for p in (
        ("plane", "cylinder"),
        ("plane", "sphere"),
        ("plane", "torus"),
        ("plane", "cone"),
        ("cylinder", "torus"),
        ("cone", "torus"),
        ("cylinder", "sphere"),
        ("torus", "sphere"),
        ("cone", "sphere"),
        ("cylinder",),
    )
}
