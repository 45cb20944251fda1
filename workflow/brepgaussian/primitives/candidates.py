"""What may explain points of a badly reconstructed region: along known directions, about known axes, fillets."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.geometry.fit import PARAMETERS, cone_about, cylinder_about, oriented, torus_about
from brepgaussian.geometry.surfaces import Surface, plane, torus, unit
from brepgaussian.primitives.guided import ABOUT, ALONG, Known

Array = NDArray[np.float64]

FILLET = "fillet"  # a torus that touches a well-known coaxial cylinder
SEEDS, NEAR = 32, 80  # neighbourhoods that candidates come from, and points of each
FACING = np.radians(30.0)  # largest angle between a plane's normal and those of its points, in the median
TURN = np.radians(25.0)  # angle of a normal from a surface that explains its point: where points bulge they turn
FEW = 12  # points that determine nothing
SMALL = 1e-9


@dataclass(frozen=True)
class Candidate:
    """A surface that may explain points.

    Attributes:
        kind: of the surface, or `FILLET`.
        surface: where it starts.
        free: columns of its parameters that are free; None: all, it follows no known direction.
        beside: the cylinder that a fillet touches.
        along: a known direction in which a plane runs; its normal turns about that direction only.
    """

    kind: str
    surface: Surface
    free: tuple[int, ...] | None
    beside: Surface | None = None
    along: Array | None = None

    @property
    def freedom(self) -> int:
        """Number of parameters that its points determine; two of a fillet."""
        if self.along is not None:
            return 2
        if self.free is None:
            return PARAMETERS[self.surface.kind]
        return len(self.free) or 2


def candidates(points: Array, normals: Array, guides: Known) -> Iterator[Candidate]:
    """Guided surfaces of neighbourhoods spread over the points."""
    if len(points) < FEW:
        return
    tree = cKDTree(points)
    for seed in _spread(points, SEEDS):
        near = np.atleast_1d(tree.query(points[seed], min(NEAR, len(points)))[1])
        near = near[normals[near] @ normals[seed] > np.cos(FACING)]
        if len(near) >= FEW:
            for start, free in _starts(points[near], normals[near], guides):
                yield Candidate(start.kind, oriented(start, points[near], normals[near]), free)
            for direction in guides.directions:
                yield from _running(direction, points[near], normals[near])
            for line in guides.axes:
                if line.kind == "cylinder":
                    yield from _fillets(line, points[near], normals[near])


def _spread(points: Array, count: int) -> list[int]:
    """Indices of points far from each other."""
    chosen = [0]
    distance = np.linalg.norm(points - points[0], axis=1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return chosen


def _starts(points: Array, normals: Array, guides: Known) -> Iterator[tuple[Surface, tuple[int, ...]]]:
    """Surfaces of a neighbourhood along known directions and about known axes, with their free columns."""
    share = np.full(len(points), 1 / len(points))
    mean = unit(np.median(normals, axis=0))
    for direction in guides.directions:
        facing = float(mean @ direction)
        if abs(facing) > np.cos(FACING):
            yield plane(points.mean(axis=0), np.copysign(1.0, facing) * direction), (2,)
        for kind, make in (("cylinder", cylinder_about), ("cone", cone_about)):
            start = make(direction, points, normals, share)
            if start is not None:
                yield start, ALONG[kind]
    for line in guides.axes:
        for kind, make in (("cylinder", cylinder_about), ("cone", cone_about), ("torus", torus_about)):
            start = make(line.axis, points, normals, share, line.origin)
            if start is not None:
                yield start, ABOUT[kind]


def _running(direction: Array, points: Array, normals: Array) -> Iterator[Candidate]:
    """The plane along a known direction that a neighbourhood shows, as a wall of a slot that is parallel to no face."""
    across = np.median(normals, axis=0)
    across = across - (across @ direction) * direction
    if float(np.linalg.norm(across)) > np.cos(FACING):
        yield Candidate("plane", plane(points.mean(axis=0), unit(across)), None, along=direction)


def upright(surface: Surface, direction: Array, points: Array) -> Surface:
    """A plane turned back until a direction runs in it, through the middle of points."""
    normal = unit(surface.axis - (surface.axis @ direction) * direction)
    return plane(surface.origin + np.median((points - surface.origin) @ normal) * normal, normal)


def _fillets(line: Surface, points: Array, normals: Array) -> Iterator[Candidate]:
    """The torus coaxial with a cylinder and tangent to it that a neighbourhood shows.

    With the signed tube radius m (positive where convex) a point at distance rho from the axis, whose normal has the
    part n along rho, has its tube's centre at rho - m n, and that is the cylinder's radius less m times its sign.
    """
    offset = points - line.origin
    along = offset @ line.axis
    across = offset - along[:, None] * line.axis
    rho = np.linalg.norm(across, axis=1)
    inward = np.einsum("ij,ij->i", normals, across) / np.maximum(rho, SMALL)
    apart = line.sign - inward
    if np.median(np.abs(apart)) < 1 - np.cos(TURN):
        return  # the cylinder itself
    minor = float(np.median((line.radius - rho) / np.where(np.abs(apart) < SMALL, SMALL, apart)))
    height = float(np.median(along - minor * (normals @ line.axis)))
    ring = line.radius - minor * line.sign
    if min(abs(minor), ring) > SMALL:
        yield Candidate(
            FILLET, torus(line.origin + height * line.axis, line.axis, ring, abs(minor), minor < 0), (), line
        )
