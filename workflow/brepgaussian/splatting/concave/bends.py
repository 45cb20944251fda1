"""Bores that bend: two round openings of one width whose axes meet at an angle are the ends of one pipe.

From either mouth one sees the outer wall of the bend, which passes for a floor. Few views see the same place in there,
so that rays hardly tell the bend's radius; but silhouettes show the pipe from outside, and its wall is as thick on all
sides. Two blind holes that meet in a block have no such wall, and stay what they are.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from brepgaussian import log
from brepgaussian.splatting.concave.agreement import rays_at_object
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.sections import Rounded
from brepgaussian.splatting.concave.shapes import SURE
from brepgaussian.splatting.concave.volume import Volume

Array = NDArray[np.float64]

_SAME_CELLS = 1.5  # by which the widths of two ends, and the places of their axes, may seem to differ
_LEAST_TURN, _MOST_TURN = np.radians(20.0), np.radians(160.0)
_TIGHTEST = 1.05  # radii of the bore: a bend's radius is larger
_COARSE, _FINER = 9, 5  # places of a bend that are tried at first, and rounds of halving the step
_OVERLAP = 1.0  # voxels by which a bend runs into its straight ends
_NOTHING = 1e-12  # unit frame
_PLACES = 17  # of a bend's axis that are asked
_UNEVEN = 0.15  # of a pipe's outer radius by which its surface may be off: hulls of pipes bulge

logger = log.get_logger("stage1")


@dataclass(frozen=True)
class Bend:
    """The bent part of a pipe's bore.

    Attributes:
        center: (3,) of the circle that its axis runs along; `normal`: (3,) unit, of that circle's plane.
        first, second: (3,) unit directions along which it goes on straight, away from the bend.
        bend: radius of that circle; radius: of the bore.
    """

    center: Array
    normal: Array
    first: Array
    second: Array
    bend: float
    radius: float

    def signed_distance(self, points: Array, overlap: float) -> Array:
        """(N,) distance of points (N, 3) from its wall, negative inside; its ends are longer by `overlap`."""
        return np.maximum(self.wall(points)[0], self.past_ends(points) - overlap)

    def past_ends(self, points: Array) -> Array:
        """(N,) how far points (N, 3) lie past the nearer of its ends, negative between them."""
        offset = points - self.center
        return np.asarray(np.maximum(offset @ self.first, offset @ self.second), float)

    def wall(self, points: Array) -> tuple[Array, Array]:
        """(N,) distance of points (N, 3) from the wall of the whole ring, negative inside; (N, 3) unit, out of it."""
        offset = points - self.center
        height = offset @ self.normal
        flat = offset - height[:, None] * self.normal
        around = np.linalg.norm(flat, axis=1, keepdims=True)
        out = offset - self.bend * flat / np.maximum(around, _NOTHING)
        far = np.linalg.norm(out, axis=1)
        return far - self.radius, out / np.maximum(far, _NOTHING)[:, None]

    def axis(self) -> Array:
        """(N, 3) places along its axis, its ends included."""
        starts = [way - (way @ end) * end for way, end in ((-self.second, self.first), (-self.first, self.second))]
        first, last = (start / np.linalg.norm(start) for start in starts)
        turn = np.arccos(np.clip(first @ last, -1, 1))
        share = np.linspace(0, 1, _PLACES)[:, None]
        arc = (np.sin((1 - share) * turn) * first + np.sin(share * turn) * last) / np.sin(turn)
        return np.asarray(self.center + self.bend * arc)

    def extent(self) -> Array:
        """(8, 3) corners of a box that holds it."""
        corners = np.stack(np.meshgrid(*([-1.0, 1.0],) * 3), axis=-1).reshape(-1, 3)
        return self.center + (self.bend + self.radius) * corners


@dataclass(frozen=True)
class Elbow:
    """Two ends whose axes meet.

    Attributes:
        corner: (3,) where they do; first, second: (3,) unit directions from there to the mouths.
        straight: distances of the mouths from the corner; radius: of the bore.
    """

    corner: Array
    first: Array
    second: Array
    straight: tuple[float, float]
    radius: float

    @property
    def slope(self) -> float:
        """How far before the corner a bend begins, by its radius."""
        return float(np.tan((np.pi - np.arccos(self.first @ self.second)) / 2))

    def bend(self, begins: float) -> Bend:
        """The bend that begins some distance before the corner."""
        middle = self.first + self.second
        middle /= np.linalg.norm(middle)
        bend = begins / self.slope
        normal = np.cross(self.first, self.second)
        center = self.corner + np.hypot(begins, bend) * middle
        return Bend(center, normal / np.linalg.norm(normal), self.first, self.second, bend, self.radius)


def bent(images: Images, hull: Volume, prisms: Sequence[Prism], margin: float) -> tuple[list[Prism], list[Bend]]:
    """The same concavities, those that are ends of a bent bore as long as they are straight, and the bends.

    Args:
        images: of all views.
        hull: before anything of them is cut.
        prisms: concavities.
        margin: by which they are cut longer.
    """
    result, bends = list(prisms), []
    for i, j in combinations(range(len(result)), 2):
        elbow = elbow_of(result[i], result[j])
        begins = None if elbow is None else _best(hull.scene(), elbow)
        if elbow is None or begins is None:
            continue
        bend, blind = elbow.bend(begins), [result[i], result[j]]
        straight = _shortened(blind, elbow, begins)
        old, new = _without(hull, blind, margin).scene(), cut(_without(hull, straight, margin), bend).scene()
        rays = rays_at_object(images).hitting(old, partial(_near, blind, margin, 2 * hull.spacing))
        against = rays.advantage(rays.costs(new), rays.costs(old))
        logger.info(
            "bent bore of radius %.4f, bend %.4f: rays are against it by %.1f standard errors%s",
            elbow.radius, bend.bend, against, "" if against < SURE else ": not believed",
        )  # fmt: skip
        if against < SURE:
            result[i], result[j] = straight
            bends.append(bend)
    return result, bends


def cut(hull: Volume, bend: Bend) -> Volume:
    """A hull without what a bend empties."""
    overlap = _OVERLAP * hull.spacing
    return hull.carved(bend.extent(), overlap, lambda points: bend.signed_distance(points, overlap))


def elbow_of(one: Prism, other: Prism) -> Elbow | None:
    """How the axes of two round blind openings of one width meet inside; None if they do not."""
    radius, other_radius = _radius(one), _radius(other)
    tolerance = _SAME_CELLS * max(one.lattice.pitch, other.lattice.pitch)
    if radius is None or other_radius is None or abs(radius - other_radius) > tolerance:
        return None
    first, second = one.lattice.normal, other.lattice.normal
    turn = np.pi - np.arccos(np.clip(first @ second, -1, 1))
    if not _LEAST_TURN < turn < _MOST_TURN:
        return None
    mouths = [_middle(one), _middle(other)]
    # first * a - second * b = mouth a - mouth b, for distances a and b from the corner
    inward = np.linalg.lstsq(np.column_stack([first, -second]), mouths[0] - mouths[1], rcond=None)[0]
    corners = mouths[0] - inward[0] * first, mouths[1] - inward[1] * second
    if np.linalg.norm(corners[0] - corners[1]) > tolerance or min(inward) <= 0:
        return None
    lengths = float(inward[0]), float(inward[1])
    return Elbow((corners[0] + corners[1]) / 2, first, second, lengths, (radius + other_radius) / 2)


def _radius(prism: Prism) -> float | None:
    """Radius of an untapered round opening that does not go through, unit frame."""
    shape = prism.section.shape if prism.section is not None else None
    if not isinstance(shape, Rounded) or shape.half != (shape.radius, shape.radius):
        return None
    if prism.through or any(prism.tilt) or prism.draft:
        return None
    return shape.radius * prism.lattice.pitch


def _middle(prism: Prism) -> Array:
    """(3,) the centre of an opening's section."""
    assert prism.section is not None
    lattice = prism.lattice
    row, column = (np.asarray(prism.section.center) + 0.5) * lattice.pitch
    return np.asarray(lattice.origin + row * lattice.first + column * lattice.second)


def _best(scene: Scene, elbow: Elbow) -> float | None:
    """Where the bend begins, as distance from the corner, if a pipe of one thickness bends about it; else None."""
    least, most = _TIGHTEST * elbow.radius * elbow.slope, min(elbow.straight)
    if least >= most:
        return None

    def depth(begins: float) -> float:
        return -float(scene.signed_distance(elbow.bend(begins).axis()).mean())

    step = (most - least) / (_COARSE - 1)
    best = max((float(b) for b in np.linspace(least, most, _COARSE)), key=depth)
    for _ in range(_FINER):
        step /= 2
        best = max((b for b in (best - step, best, best + step) if least <= b <= most), key=depth)
    return best if _is_pipe(scene, elbow.bend(best)) else None


def _is_pipe(scene: Scene, bend: Bend) -> bool:
    """Whether a hull is one thick all along a bend's axis, and ends as far off on its inner and its outer side."""
    axis = bend.axis()
    depths = -scene.signed_distance(axis)
    thick = float(depths.mean())
    if thick < bend.radius or np.abs(depths - thick).max() > _UNEVEN * thick:
        return False
    outward = (axis - bend.center) / bend.bend
    sides = [scene.signed_distance(axis + way * thick * outward) for way in (-1.0, 1.0)]
    return bool(np.abs(np.concatenate(sides)).max() < _UNEVEN * thick)


def _shortened(ends: Sequence[Prism], elbow: Elbow, begins: float) -> list[Prism]:
    """The straight ends of a bore whose bend begins some distance before the corner."""
    return [replace(end, depth=length - begins, through=True) for end, length in zip(ends, elbow.straight, strict=True)]


def _near(prisms: Sequence[Prism], margin: float, reach: float, points: Array) -> NDArray[np.bool_]:
    """(N,) whether places (N, 3) lie in concavities, or on their walls and floors."""
    return np.asarray(np.min([prism.signed_distance(points, margin) for prism in prisms], axis=0) < reach)


def _without(hull: Volume, prisms: Sequence[Prism], margin: float) -> Volume:
    for prism in prisms:
        hull = hull.without(prism, margin)
    return hull
