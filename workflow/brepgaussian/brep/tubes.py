"""Pipes that go on in a bend: a cylinder beside a torus about whose tube's centre line it runs is as wide as the tube.

Points may know the width of a short piece too badly for primitives to say so (pipe_elbow: 1.6 noises). Sheets of two
widths neither meet nor touch, and nothing lies inside of them. Beside the bend its tube and a short straight piece are
one surface to within the noise, so labels share them out anyhow, and a torus through a part of the straight piece is
another one: between two pipes a bend has its radius left to tell.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from brepgaussian.brep.patches import Patch, neighbours, supported
from brepgaussian.geometry.surfaces import Surface, cylinder, torus, unit
from brepgaussian.primitives.relations import RESIDUALS

_EXACT = 1e-6  # unit frame: centre lines and widths that are one
_LINE_NOISES = 1.0  # by which the centre lines of one pipe may miss each other
_TILT = np.sin(np.radians(1.0))  # of a pipe against its bend's plane
_WIDTH_NOISES = 5.0  # by which the widths of one pipe may differ; a larger step is one
_ABOUT = 0.1  # of a pipe's radius: by how much its bend, as points of both have it, may be wider or narrower
_PLANE = np.cos(np.radians(10.0))  # between a bend's axis, as its points have it, and that across two pipes
_BENT = np.sin(np.radians(10.0))  # between the axes of two pipes that are none
_WIDEST = 10.0  # radii of the pipe: a bend's radius
_OUTLIER = 3.0  # noises
_FITS = 1.5  # noises: median distance of the points from a pipe that is theirs
_MOVED = 0.02  # of a pipe's points that change hands; fewer are on the border
_LEAST = 8  # points that a piece keeps

Array = NDArray[np.float64]


def even_tubes(patches: Sequence[Patch], noise: float) -> list[Patch]:
    """The patches, every piece of a pipe as wide as the bend beside it that most points show.

    Args:
        patches: those of a job.
        noise: of the points, unit frame.
    """
    result = list(patches)
    bends = sorted((i for i, p in enumerate(patches) if p.surface.kind == "torus"), key=lambda i: len(patches[i].xyz))
    for i in bends:
        ring = patches[i].surface
        for k in neighbours(i, patches, "cylinder"):
            if _goes_on(patches[k].surface, ring, noise):
                result[k] = replace(patches[k], surface=_continued(patches[k].surface, ring))
    return result


def _goes_on(pipe: Surface, ring: Surface, noise: float) -> bool:
    """Whether a cylinder's axis about touches a torus's centre line, and it is about as wide as the tube; not quite."""
    tilt, *line, width = (abs(float(v)) for v in RESIDUALS["bend"](pipe, ring))
    about = tilt < _TILT and max(line) < _LINE_NOISES * noise and width < _WIDTH_NOISES * noise
    return pipe.flipped == ring.flipped and about and max(tilt, *line, width) > _EXACT


def _continued(pipe: Surface, ring: Surface) -> Surface:
    """The cylinder that goes on smoothly where a torus' tube ends, nearest to another one."""
    axis = unit(pipe.axis - (pipe.axis @ ring.axis) * ring.axis)
    offset = pipe.origin - ring.origin
    arm = unit(offset - (offset @ axis) * axis - (offset @ ring.axis) * ring.axis)
    along = ring.origin + (offset @ axis) * axis
    return replace(pipe, origin=along + ring.radius * arm, axis=axis, radius=ring.minor)


@dataclass(frozen=True)
class _Pipe:
    """A straight piece, a bend that it touches, and another one.

    Attributes:
        corner: (3,) where the centre lines meet.
        ways: (2, 3) along the straight pieces, away from it.
        width: radius of the pipe; radius: of the bend's centre line.
    """

    corner: Array
    ways: Array
    width: float
    radius: float

    @property
    def middle(self) -> Array:
        """(3,) centre of the bend."""
        across = unit(self.ways.sum(axis=0))
        return self.corner + across * self.radius / float(np.linalg.norm(np.cross(across, self.ways[0])))

    @property
    def lead(self) -> float:
        """Length from the corner to where the bend begins."""
        return float((self.middle - self.corner) @ self.ways[0])

    def pieces(self) -> tuple[Surface, Surface, Surface]:
        """The bend and the two straight pieces; normals point out of the pipe."""
        axis = unit(np.cross(self.ways[0], self.ways[1]))
        one, other = (cylinder(self.corner + self.lead * way, way, self.width) for way in self.ways)
        return torus(self.middle, axis, self.radius, self.width), one, other

    def piece_of(self, xyz: Array) -> NDArray[np.int64]:
        """(N,) which of the pieces points (N, 3) belong to: 0 the bend, 1 and 2 the straight ones."""
        along = (xyz - self.corner) @ self.ways.T
        return np.where((along > self.lead).any(axis=1), 1 + along.argmax(axis=1), 0)

    def distances(self, xyz: Array) -> Array:
        """(N,) distances of points (N, 3) from their pieces, of those of the bend from one as wide as they have it.

        What is bent two ways is carved with another bias than what is bent one way.
        """
        piece, result = self.piece_of(xyz), np.zeros(len(xyz))
        for k, surface in enumerate(self.pieces()):
            result[piece == k] = surface.signed_distance(xyz[piece == k])
        if (piece == 0).any():
            result[piece == 0] -= np.median(result[piece == 0])
        return np.abs(result)


def bent_tubes(patches: Sequence[Patch], noise: float) -> list[Patch]:
    """The patches, every bend between two pipes of one width tangent to both, points shared out where it begins.

    Args:
        patches: those of a job.
        noise: of the points, unit frame.
    """
    result = list(patches)
    for i in (i for i, p in enumerate(patches) if p.surface.kind == "torus"):
        beside = [k for k in neighbours(i, result, "cylinder") if _is_about(result[k].surface, result[i].surface)]
        for j, k in combinations(beside, 2):
            pipe = _between(result[i], result[j], result[k], noise)
            shared = None if pipe is None else _shared_out(pipe, [result[m] for m in (i, j, k)], noise)
            for m, patch in zip((i, j, k), shared or (), strict=False):
                result[m] = patch
    return result


def _is_about(pipe: Surface, ring: Surface) -> bool:
    """Whether a cylinder may be a piece of the pipe that a torus bends."""
    across = abs(float(pipe.axis @ ring.axis))
    return pipe.flipped == ring.flipped and abs(pipe.radius / ring.minor - 1) < _ABOUT and across < _BENT


def _between(bend: Patch, first: Patch, second: Patch, noise: float) -> _Pipe | None:
    """The pipe through two straight pieces, bent as the points of all three say; None if they are of no such pipe."""
    one, other = first.surface, second.surface
    normal = np.cross(one.axis, other.axis)
    if np.linalg.norm(normal) < _BENT or abs(one.radius - other.radius) > _WIDTH_NOISES * noise:
        return None
    normal = unit(normal)
    gap = float((other.origin - one.origin) @ normal)
    if abs(gap) > _WIDTH_NOISES * noise or abs(float(normal @ bend.surface.axis)) < _PLANE:
        return None
    along = np.linalg.solve(np.column_stack([one.axis, -other.axis, normal]), other.origin - one.origin)
    corner = one.origin + along[0] * one.axis + gap / 2 * normal
    ways = [np.sign(float((p.xyz.mean(axis=0) - corner) @ p.surface.axis)) * p.surface.axis for p in (first, second)]
    width = (one if len(first.xyz) > len(second.xyz) else other).radius
    xyz = np.concatenate([bend.xyz, first.xyz, second.xyz])

    def misfit(radius: float) -> float:
        off = _Pipe(corner, np.array(ways), width, radius).distances(xyz)
        return float(np.minimum(off, _OUTLIER * noise).mean())

    found = minimize_scalar(misfit, bounds=(width, _WIDEST * width), method="bounded", options={"xatol": noise / 10})
    pipe = _Pipe(corner, np.array(ways), width, float(found.x))
    return pipe if np.median(pipe.distances(xyz)) < _FITS * noise else None


def _shared_out(pipe: _Pipe, patches: Sequence[Patch], noise: float) -> list[Patch] | None:
    """A bend and its straight pieces with the points between whose planes they lie; None if they have these."""
    xyz = np.concatenate([p.xyz for p in patches])
    normals = np.concatenate([p.normals for p in patches])
    owner = np.repeat(np.arange(len(patches)), [len(p.xyz) for p in patches])
    piece = np.where(pipe.distances(xyz) < _OUTLIER * noise, pipe.piece_of(xyz), owner)
    if np.mean(piece != owner) < _MOVED or np.bincount(piece, minlength=3).min() < _LEAST:
        return None
    return [
        supported(patch, surface.flip() if patch.surface.flipped else surface, xyz[piece == k], normals[piece == k])
        for k, (patch, surface) in enumerate(zip(patches, pipe.pieces(), strict=True))
    ]
