"""What the assembly knows of one primitive: its surface and the cleaned points that support it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.artifacts.points import Points
from brepgaussian.artifacts.primitives import Primitive
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]

NEIGHBOURS = 6  # a disc that holds six points on average is empty once in 400 times
_ISOLATED = 4.0  # a point whose neighbours are this many times farther than usual is a stray label
NEARBY = 3.0  # of reach: patches this near to each other are neighbours
_MIN_POINTS = 8  # fewer points define no extent


@dataclass(frozen=True)
class Patch:
    """One primitive as the assembly sees it.

    Attributes:
        surface: the fitted surface.
        primitive: its index in `primitives.h5`.
        xyz: (S, 3) support without stray points; `normals`: (S, 3) their outward normals.
        reach: radius within which a place on the patch is expected to hold a point.
        sigma: distance of the points from the surface (root mean square).
        cap: a guess without points of its own; `xyz` only says where it is.
        whole: its sheet always goes through the whole box.
        made: its points were made on its surface, and tell nothing about its kind.
    """

    surface: Surface
    primitive: int
    xyz: Array
    normals: Array
    reach: float
    sigma: float
    cap: bool = False
    whole: bool = False
    made: bool = False

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Lower and upper corner of the points' bounding box."""
        return self.xyz.min(axis=0), self.xyz.max(axis=0)


def make_patches(items: Sequence[Primitive], points: Points, max_reach: float) -> list[Patch]:
    """Clean the supports of primitives; those with next to no points are left out."""
    patches = []
    for index, item in enumerate(items):
        support = item.support[(item.support >= 0) & (item.support < len(points.xyz))]
        if len(support) < _MIN_POINTS or not _sane(item.surface):
            continue
        xyz = points.xyz[support].astype(float)
        normals = points.normals[support].astype(float)
        finite = np.isfinite(xyz).all(axis=1)
        xyz, normals = xyz[finite], np.nan_to_num(normals[finite])
        keep, reach = _dense(xyz)
        if keep.sum() < _MIN_POINTS:
            continue
        sigma = item.surface.rms(xyz[keep])
        patches.append(Patch(item.surface, index, xyz[keep], normals[keep], min(reach, max_reach), sigma))
    return patches


def guessed(surface: Surface, xyz: Array, reach: float) -> Patch:
    """A face that is of no primitive, on a surface, with (N, 3) points made on it that stand for it."""
    return Patch(surface, -1, xyz, surface.normals(xyz).copy(), reach, 0.0, cap=True)


def supported(patch: Patch, surface: Surface, xyz: Array, normals: Array) -> Patch:
    """A patch on another surface, with other points (N, 3) and normals (N, 3)."""
    return replace(patch, surface=surface, xyz=xyz, normals=normals, sigma=surface.rms(xyz))


def thinned_out(patch: Patch, gone: NDArray[np.bool_]) -> Patch:
    """A patch without some of its (N,) points."""
    return supported(patch, patch.surface, patch.xyz[~gone], patch.normals[~gone])


def next_number(patches: Sequence[Patch]) -> int:
    """The first number that no patch has."""
    return max((p.primitive for p in patches), default=-1) + 1


def touch(first: Patch, second: Patch, reaches: float = NEARBY, tree: cKDTree | None = None) -> bool:
    """Whether two patches lie within some of the larger reach; `tree`: of the second's points, if at hand."""
    limit = reaches * max(first.reach, second.reach)
    tree = cKDTree(second.xyz) if tree is None else tree
    return bool(tree.query(first.xyz, distance_upper_bound=limit)[0].min() <= limit)


def neighbours(index: int, patches: Sequence[Patch], kind: str = "") -> list[int]:
    """Indices of the patches (of one kind only) that one of them touches."""
    patch = patches[index]
    tree = cKDTree(patch.xyz)
    others = (k for k, p in enumerate(patches) if k != index and kind in ("", p.surface.kind))
    return [k for k in others if touch(patches[k], patch, tree=tree)]


def _sane(surface: Surface) -> bool:
    """Whether a surface can be built at all."""
    numbers = [*surface.origin, *surface.axis, surface.radius, surface.minor, surface.angle]
    if not np.isfinite(numbers).all() or not np.isclose(np.linalg.norm(surface.axis), 1.0, atol=1e-6):
        return False
    if surface.kind in ("cylinder", "sphere", "torus") and surface.radius <= 0:
        return False
    if surface.kind == "torus" and not surface.minor > 0:
        return False
    return surface.kind != "cone" or 0 < surface.angle < np.pi / 2


def _dense(xyz: Array) -> tuple[NDArray[np.bool_], float]:
    """Which points have neighbours, and the usual distance to the sixth."""
    if len(xyz) < _MIN_POINTS:
        return np.zeros(len(xyz), bool), 0.0
    count = min(NEIGHBOURS, len(xyz) - 1)
    distances = cKDTree(xyz).query(xyz, count + 1)[0][:, -1]
    usual = float(np.quantile(distances, 0.75))
    return distances <= _ISOLATED * max(usual, 1e-12), usual


def with_floor(patches: Sequence[Patch], index: int, before: Patch) -> Iterator[Patch]:
    """The patches with a floor's points where its surface is now, and without those of walls that were below it.

    Args:
        patches: all of them; index: of the floor.
        before: the floor as its points lie.
    """
    floor = patches[index]
    moved = floor.surface.project(before.xyz)
    under, reach = cKDTree(moved), NEARBY * floor.reach
    for k, patch in enumerate(patches):
        if k == index:
            yield supported(patch, floor.surface, moved, before.normals)
            continue
        below = floor.surface.signed_distance(patch.xyz) < -floor.reach
        between = below & (before.surface.signed_distance(patch.xyz) > -before.reach)
        gone = between & (under.query(floor.surface.project(patch.xyz), distance_upper_bound=reach)[0] < reach)
        yield thinned_out(patch, gone) if gone.any() else patch
