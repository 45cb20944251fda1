"""Motions that may carry a part onto itself: mirrors, turns about an axis, steps along a row."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from brepgaussian.brep.patches import Patch
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]

FEATURE = 0.05  # of all points: larger patches are no features that are mistaken, or that come in rows
_SURE = 1.5  # noises that a patch may be off which says where a symmetry is,
_LARGE = 0.01  # and share of the points that it holds
_SAME = np.cos(np.radians(3.0))  # between directions that are one
_FOLDS = (2, 3, 4, 5, 6, 8, 12)  # of rotations
_ALIKE = 0.7  # of the points of one of two features in a row that the other has, at least
_BESIDE = 2.0  # reaches that the middles of two features may lie beside a line along the row
_SHORTEST = 4.0  # reaches of a step
_STEEP = 0.3  # cosine between a plane's normal and a row from which on the plane tells the step
_MOST_STEPS = 8  # along one direction, those first that most pairs of features have in common


@dataclass(frozen=True)
class Symmetry:
    """x -> matrix (3, 3) x + shift (3,); a step along a row holds only as far as the part goes."""

    matrix: Array
    shift: Array
    step: bool = False

    def points(self, xyz: Array) -> Array:
        """(N, 3) carried points."""
        return np.asarray(xyz @ self.matrix.T + self.shift)

    def surface(self, surface: Surface) -> Surface:
        """The carried surface; a mirror keeps which side is outside."""
        origin, axis = self.points(surface.origin[None])[0], self.matrix @ surface.axis
        return replace(surface, origin=origin, axis=axis / np.linalg.norm(axis))


def candidates(patches: Sequence[Patch], noise: float, reach: float) -> Iterator[Symmetry]:
    """Mirrors across the design's directions, rotations about its axes, steps from one feature to one like it.

    Args:
        patches: of a part.
        noise, reach: of their points, unit frame.
    """
    total = sum(len(p.xyz) for p in patches)
    sure = [p for p in patches if p.sigma <= _SURE * noise and len(p.xyz) >= _LARGE * total]
    sure.sort(key=lambda p: -len(p.xyz))
    directions: list[Array] = []
    for p in sure:
        if p.surface.kind in ("plane", "cylinder") and all(abs(p.surface.axis @ d) < _SAME for d in directions):
            directions.append(p.surface.axis)
    axes: list[Surface] = []
    for p in sure:
        round_one = p.surface.kind in ("cylinder", "cone", "torus")
        if round_one and not any(_one_line(p.surface, other, reach) for other in axes):
            axes.append(p.surface)
    yield from _mirrors(np.concatenate([p.xyz for p in patches]), directions, axes, reach)
    yield from _turns(axes)
    features = [p for p in patches if len(p.xyz) <= FEATURE * total]
    for d in directions:
        yield from _steps(features, d, reach)


def _mirrors(xyz: Array, directions: Sequence[Array], axes: Sequence[Surface], reach: float) -> Iterator[Symmetry]:
    """Mirrors in the middle of the part and through its axes."""
    for d in directions:
        heights = xyz @ d
        offsets = [(heights.min() + heights.max()) / 2]
        offsets += [float(a.origin @ d) for a in axes if abs(a.axis @ d) < 1 - _SAME]
        offsets.sort()
        for offset in [o for k, o in enumerate(offsets) if k == 0 or o - offsets[k - 1] > reach / 2]:
            yield Symmetry(np.eye(3) - 2 * np.outer(d, d), 2 * offset * d)


def _turns(axes: Sequence[Surface]) -> Iterator[Symmetry]:
    """Turns about axes by parts of a full turn."""
    for axis in axes:
        for folds in _FOLDS:
            for turns in range(1, folds):
                if np.gcd(turns, folds) == 1:
                    matrix = Rotation.from_rotvec(2 * np.pi * turns / folds * axis.axis).as_matrix()
                    yield Symmetry(matrix, axis.origin - matrix @ axis.origin)


def _one_line(one: Surface, other: Surface, reach: float) -> bool:
    apart = one.origin - other.origin
    off = np.linalg.norm(apart - (apart @ other.axis) * other.axis)
    return bool(abs(one.axis @ other.axis) > _SAME and off < reach / 2)


def _steps(features: Sequence[Patch], along: Array, reach: float) -> Iterator[Symmetry]:
    """Steps along a direction, there and back, from features to others like them."""
    lengths = sorted(
        abs(length)
        for first, second in combinations(features, 2)
        if (length := _step(first, second, along, reach)) is not None
    )
    if not lengths:
        return
    groups = np.split(np.array(lengths), np.flatnonzero(np.diff(lengths) > reach / 2) + 1)
    for group in sorted(groups, key=lambda g: (-len(g), g[0]))[:_MOST_STEPS]:
        for sign in (1.0, -1.0):
            yield Symmetry(np.eye(3), sign * float(np.median(group)) * along, step=True)


def _step(first: Patch, second: Patch, along: Array, reach: float) -> float | None:
    """How far a feature lies from one like it along a direction; None if it is not like it or lies elsewhere."""
    one, other = first.surface, second.surface
    counts = sorted((len(first.xyz), len(second.xyz)))
    facing = float(one.axis @ other.axis)
    if one.kind != other.kind or counts[0] < _ALIKE * counts[1] or one.flipped != other.flipped:
        return None
    if (facing if one.kind == "plane" else abs(facing)) < _SAME and one.kind != "sphere":
        return None
    apart = second.xyz.mean(axis=0) - first.xyz.mean(axis=0)
    length = float(apart @ along)
    if abs(length) < _SHORTEST * reach or np.linalg.norm(apart - length * along) > _BESIDE * reach:
        return None
    slope = float(one.axis @ along)
    if one.kind == "plane":
        return float((other.origin - one.origin) @ one.axis) / slope if abs(slope) > _STEEP else length
    return float((other.origin - one.origin) @ along) if abs(slope) < 1 - _SAME else length
