"""The five analytic surfaces: signed distance, outward normal, projection."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

KINDS = ("plane", "cylinder", "sphere", "cone", "torus")
ROW_LENGTH = 10  # of `surface_to_row`
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Surface:
    """An unbounded, oriented surface in the unit frame.

    Attributes:
        kind: one of `KINDS`.
        origin: (3,) a point on a plane; a point on the axis of a cylinder; the centre of a sphere or a
            torus; the reference point on the axis of a cone, where its radius is `radius`.
        axis: (3,) unit; the normal of a plane; the axis of a cylinder, a cone (the radius grows along it)
            or a torus; ignored for a sphere.
        radius: of a cylinder, a sphere, a cone's reference circle, a torus' centre circle; 0 for a plane.
        minor: minor radius of a torus; else 0.
        angle: half angle of a cone in radians, in (0, pi/2); else 0.
        flipped: False if the outward normal points along `axis` (plane) or away from the axis or centre
            (others: a shaft); True if the other way (a hole).
    """

    kind: str
    origin: Array
    axis: Array
    radius: float = 0.0
    minor: float = 0.0
    angle: float = 0.0
    flipped: bool = False

    @property
    def sign(self) -> float:
        """-1.0 if flipped, else 1.0."""
        return -1.0 if self.flipped else 1.0

    def flip(self) -> "Surface":
        """The same surface with the opposite outward normal."""
        return replace(self, flipped=not self.flipped)

    def signed_distance(self, points: Array) -> Array:
        """(N,) distance of (N, 3) points, positive outside the material."""
        return self.sign * _natural(self, points)[0]

    def rms(self, points: Array) -> float:
        """Root mean square distance of (N, 3) points."""
        return float(np.sqrt(np.mean(self.signed_distance(points) ** 2)))

    def normals(self, points: Array) -> Array:
        """(N, 3) outward unit normals: the gradient of `signed_distance` at (N, 3) points."""
        return self.sign * _natural(self, points)[1]

    def field(self, points: Array) -> tuple[Array, Array]:
        """`signed_distance` and `normals` of (N, 3) points at once."""
        distance, gradient = _natural(self, points)
        return self.sign * distance, self.sign * gradient

    def project(self, points: Array) -> Array:
        """(N, 3) nearest points on the surface."""
        distance, gradient = _natural(self, points)
        return points - distance[:, None] * gradient

    def frame(self) -> tuple[Array, Array, Array]:
        """Right-handed orthonormal x, y, axis; the same for the same axis."""
        a, b, c = (float(v) for v in self.axis)
        smallest = min(range(3), key=lambda i: abs((a, b, c)[i]))
        x = np.array(((0.0, -c, b), (c, 0.0, -a), (-b, a, 0.0))[smallest])  # unit vector x axis
        x /= math.sqrt(float(x @ x))
        u, v, w = (float(value) for value in x)
        return x, np.array((b * w - c * v, c * u - a * w, a * v - b * u)), self.axis


def plane(origin: Array, normal: Array) -> Surface:
    """A plane whose outward normal is `normal`."""
    return Surface("plane", np.asarray(origin, float), unit(normal))


def cylinder(origin: Array, axis: Array, radius: float, flipped: bool = False) -> Surface:
    """A cylinder; `flipped` for a hole."""
    return Surface("cylinder", np.asarray(origin, float), unit(axis), float(radius), flipped=flipped)


def sphere(center: Array, radius: float, flipped: bool = False) -> Surface:
    """A sphere; `flipped` for a cavity."""
    return Surface("sphere", np.asarray(center, float), np.array([0.0, 0.0, 1.0]), float(radius), flipped=flipped)


def cone(origin: Array, axis: Array, radius: float, angle: float, flipped: bool = False) -> Surface:
    """A cone of half angle `angle` (radians) with radius `radius` at `origin`, growing along `axis`."""
    return Surface("cone", np.asarray(origin, float), unit(axis), float(radius), angle=float(angle), flipped=flipped)


def torus(center: Array, axis: Array, radius: float, minor: float, flipped: bool = False) -> Surface:
    """A torus with centre-circle radius `radius` and tube radius `minor`."""
    return Surface("torus", np.asarray(center, float), unit(axis), float(radius), float(minor), flipped=flipped)


def unit(vector: Array) -> Array:
    """The vector at length 1."""
    vector = np.asarray(vector, float)
    return vector / np.linalg.norm(vector)


def surface_to_row(surface: Surface) -> Array:
    """(10,) origin xyz, axis xyz, radius, minor, angle, flipped."""
    scalars = [surface.radius, surface.minor, surface.angle, float(surface.flipped)]
    return np.concatenate([surface.origin, surface.axis, scalars])


def surface_from_row(kind: str, row: Array) -> Surface:
    """Inverse of `surface_to_row`."""
    return Surface(kind, row[:3].copy(), row[3:6].copy(), float(row[6]), float(row[7]), float(row[8]), bool(row[9]))


def _natural(surface: Surface, points: Array) -> tuple[Array, Array]:
    """Distance and gradient with the normal along the axis or away from it."""
    offset = np.asarray(points, float) - surface.origin  # (N, 3)
    if surface.kind == "plane":
        return offset @ surface.axis, surface.axis[None].repeat(len(offset), axis=0)
    if surface.kind == "sphere":
        length = _lengths(offset)
        return length - surface.radius, _divide(offset, length)
    along = offset @ surface.axis  # (N,)
    across = offset - along[:, None] * surface.axis  # (N, 3)
    rho = _lengths(across)
    radial = _divide(across, rho)
    if surface.kind == "cylinder":
        return rho - surface.radius, radial
    if surface.kind == "cone":
        cosine, sine = np.cos(surface.angle), np.sin(surface.angle)
        distance = (rho - surface.radius) * cosine - along * sine
        return distance, cosine * radial - sine * surface.axis
    if surface.kind == "torus":
        tube = (rho - surface.radius)[:, None] * radial + along[:, None] * surface.axis
        length = _lengths(tube)
        return length - surface.minor, _divide(tube, length)
    raise ValueError(f"unknown kind of surface: {surface.kind}")


def _lengths(vectors: Array) -> Array:
    """(N,) of (N, 3); for few vectors much faster than `np.linalg.norm`."""
    return np.asarray(np.sqrt(np.einsum("nc,nc->n", vectors, vectors)))


def _divide(vectors: Array, lengths: Array) -> Array:
    """Vectors over lengths, zero where the length is zero (on an axis or a centre)."""
    return vectors / np.where(lengths > 0, lengths, 1)[:, None]
