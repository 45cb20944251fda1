"""What one side of a symmetric part shows well, put where the other side shows it badly.

Ribs, slots and bolt holes come in pairs and rings, and labels that go wrong at one of them are often right at the
next. A mirror or a rotation that carries most of the points onto points carries the well explained patches, too: where
a patch arrives at points that worse ones share among them, it takes these. The images decide.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from brepgaussian.brep.job import Job
from brepgaussian.brep.patches import Patch, next_number, supported
from brepgaussian.brep.simplify import Change, applied
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_SURE = 1.5  # noises that a patch may be off which says where a symmetry is,
_LARGE = 0.01  # and share of the points that it holds
_SAME = np.cos(np.radians(3.0))  # between directions that are one
_FOLDS = (2, 3, 4, 5, 6, 8, 12)  # of rotations
_SAMPLED = 1500  # points that tell whether a symmetry holds
_HOLDS = 0.8  # share of them that it carries onto points
_NEAR = 1.5  # reaches within which a point arrives at another,
_FACING = 0.7  # cosine between their normals
_MOST = 6  # symmetries that are followed, best first
_FEATURE = 0.05  # of all points: larger patches are no features that are mistaken
_ARRIVES = 0.6  # share of a patch's points that arrive at points
_COUNTERPART = 0.6  # share of these that one patch has, and of its points: it is the same face
_AGREES = 1.5  # times its own residual with the carried surface, then,
_SAME_NOISES = 3.0  # or so many noises
_LOSES = 0.6  # of its points that a patch loses to all together if it loses any,
_TAKEN = 0.4  # and of the points where it arrives that the carried patch takes
_LEFT, _KEPT = 0.5, 0.9  # of its points: a patch that keeps fewer is gone; one that keeps more stays as it is
_LEAST_POINTS = 12
_EXACT = 1e-9  # unit frame: noise of points that have none


@dataclass(frozen=True)
class Symmetry:
    """x -> matrix (3, 3) x + shift (3,)."""

    matrix: Array
    shift: Array

    def points(self, xyz: Array) -> Array:
        """(N, 3) carried points."""
        return np.asarray(xyz @ self.matrix.T + self.shift)

    def surface(self, surface: Surface) -> Surface:
        """The carried surface; a mirror keeps which side is outside."""
        origin, axis = self.points(surface.origin[None])[0], self.matrix @ surface.axis
        return replace(surface, origin=origin, axis=axis / np.linalg.norm(axis))


class _Cloud:
    """All points of some patches and whose they are."""

    def __init__(self, patches: Sequence[Patch]) -> None:
        self.xyz, self.normals = (np.concatenate([getattr(p, k) for p in patches]) for k in ("xyz", "normals"))
        self.owner = np.repeat(np.arange(len(patches)), [len(p.xyz) for p in patches])
        self.tree = cKDTree(self.xyz)
        self.reach = float(np.median([p.reach for p in patches]))

    def arrived(self, symmetry: Symmetry, xyz: Array, normals: Array) -> NDArray[np.bool_]:
        """(N,) whether carried points arrive at points that face as they do."""
        distance, index = self.tree.query(symmetry.points(xyz), distance_upper_bound=_NEAR * self.reach)
        near = np.isfinite(distance)
        facing = np.einsum("ni,ni->n", normals @ symmetry.matrix.T, self.normals[np.where(near, index, 0)])
        return near & (facing > _FACING)

    def covered(self, symmetry: Symmetry, patch: Patch) -> Indices:
        """Points at which a carried patch arrives."""
        carried, normals = symmetry.points(patch.xyz), patch.normals @ symmetry.matrix.T
        limit = _NEAR * self.reach
        box = ((self.xyz >= carried.min(axis=0) - limit) & (self.xyz <= carried.max(axis=0) + limit)).all(axis=1)
        some = np.flatnonzero(box)
        distance, index = cKDTree(carried).query(self.xyz[some], distance_upper_bound=limit)
        near = np.isfinite(distance)
        facing = np.einsum("ni,ni->n", self.normals[some], normals[np.where(near, index, 0)])
        return np.asarray(some[near & (facing > _FACING)])


def symmetric(job: Job) -> Iterator[Job]:
    """The job with the patches that its symmetries carry to badly explained points, if there are any."""
    yield from (applied(job, [change]) for change in carried(job.patches))


def carried(patches: Sequence[Patch]) -> list[Change]:
    """The patches that symmetries carry to badly explained points, as one change; none if there are none."""
    if len(patches) < 2:
        return []
    cloud = _Cloud(patches)
    noise = max(float(np.median([p.sigma for p in patches])), _EXACT)
    change = _carried(patches, cloud, _symmetries(patches, cloud, noise), noise)
    return [] if change is None else [change]


def _symmetries(patches: Sequence[Patch], cloud: _Cloud, noise: float) -> list[Symmetry]:
    """Mirrors and rotations that hold for most of the points, best first."""
    step = max(1, len(cloud.xyz) // _SAMPLED)
    xyz, normals = cloud.xyz[::step], cloud.normals[::step]
    held = [(float(cloud.arrived(s, xyz, normals).mean()), s) for s in _candidates(patches, cloud, noise)]
    held = sorted((h for h in held if h[0] >= _HOLDS), key=lambda h: -h[0])
    return [s for _, s in held[:_MOST]]


def _candidates(patches: Sequence[Patch], cloud: _Cloud, noise: float) -> Iterator[Symmetry]:
    """Mirrors across the design's directions, rotations about its axes."""
    sure = [p for p in patches if p.sigma <= _SURE * noise and len(p.xyz) >= _LARGE * len(cloud.xyz)]
    sure.sort(key=lambda p: -len(p.xyz))
    directions: list[Array] = []
    for p in sure:
        if p.surface.kind in ("plane", "cylinder") and all(abs(p.surface.axis @ d) < _SAME for d in directions):
            directions.append(p.surface.axis)
    axes: list[Surface] = []
    for p in sure:
        round_one = p.surface.kind in ("cylinder", "cone", "torus")
        if round_one and not any(_one_line(p.surface, other, cloud.reach) for other in axes):
            axes.append(p.surface)
    for d in directions:
        heights = cloud.xyz @ d
        offsets = [(heights.min() + heights.max()) / 2]
        offsets += [float(a.origin @ d) for a in axes if abs(a.axis @ d) < 1 - _SAME]
        offsets.sort()
        for offset in [o for k, o in enumerate(offsets) if k == 0 or o - offsets[k - 1] > cloud.reach / 2]:
            yield Symmetry(np.eye(3) - 2 * np.outer(d, d), 2 * offset * d)
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


def _carried(patches: Sequence[Patch], cloud: _Cloud, symmetries: Sequence[Symmetry], noise: float) -> Change | None:
    """Patches carried to points that no patch as good explains, best explained ones first; None if there are none."""
    owner, current = cloud.owner.copy(), list(patches)
    order = sorted(range(len(patches)), key=lambda k: -_weight(patches[k], noise))
    rank = np.argsort(order)
    small = [k for k in order if len(patches[k].xyz) <= _FEATURE * len(cloud.xyz)]
    landed = [_landings([patches[k] for k in small], small, cloud, s) for s in symmetries]
    losers = [_losers(landings, owner, rank) for landings in landed]
    sound: set[int] = set()  # patches that may not lose points any more
    for index in order:
        if (owner == index).sum() < _LEFT * len(patches[index].xyz):
            continue
        sound.add(index)
        for symmetry, landings, losing in zip(symmetries, landed, losers, strict=True):
            if index not in landings:
                continue
            at, surface = landings[index], symmetry.surface(patches[index].surface)
            holder, count = _most(owner[at])
            if holder in sound and count >= _COUNTERPART * len(at):
                continue
            whole = count >= _COUNTERPART * max(len(at), (owner == holder).sum())
            if whole and _agrees(surface, current[holder], cloud.xyz[owner == holder], noise):
                continue
            mine = at[np.isin(owner[at], list(losing - sound))]
            if len(mine) < max(_TAKEN * len(at), _LEAST_POINTS):
                continue
            owner[mine] = len(current)
            sound.add(len(current))
            current.append(replace(patches[index], surface=surface, xyz=cloud.xyz[mine], normals=cloud.normals[mine]))
    return _change(patches, current, owner, cloud) if len(current) > len(patches) else None


def _landings(some: Sequence[Patch], names: Sequence[int], cloud: _Cloud, symmetry: Symmetry) -> dict[int, Indices]:
    """Where patches arrive, as far as they do."""
    arrived = (
        (k, cloud.covered(symmetry, p))
        for k, p in zip(names, some, strict=True)
        if cloud.arrived(symmetry, p.xyz, p.normals).mean() >= _ARRIVES
    )
    return {k: at for k, at in arrived if len(at)}


def _losers(landings: dict[int, Indices], owner: Indices, rank: Indices) -> set[int]:
    """Patches a good part of whose points better ones land on, together: a chord alone is no piece of a bore."""
    taken = np.zeros(len(owner), bool)
    for k, at in landings.items():
        taken[at[rank[owner[at]] > rank[k]]] = True
    size = np.bincount(owner)
    return set(np.flatnonzero(np.bincount(owner[taken], minlength=len(size)) >= _LOSES * size).tolist())


def _weight(patch: Patch, noise: float) -> float:
    """How much speaks for a patch: its points, and how well it explains them."""
    return float(len(patch.xyz) * np.exp(-((patch.sigma / noise) ** 2)))


def _most(owners: Indices) -> tuple[int, int]:
    """Who has most of some points, and how many."""
    who, count = np.unique(owners, return_counts=True)
    best = int(np.argmax(count))
    return int(who[best]), int(count[best])


def _agrees(surface: Surface, patch: Patch, xyz: Array, noise: float) -> bool:
    """Whether a patch's surface is the carried one: of its kind, and as good for its points."""
    limit = max(_AGREES * patch.surface.rms(xyz), _SAME_NOISES * noise)
    return surface.kind == patch.surface.kind and surface.rms(xyz) <= limit


def _change(patches: Sequence[Patch], current: Sequence[Patch], owner: Indices, cloud: _Cloud) -> Change:
    """Patches that lost points, and what takes their place."""
    kept = [int((owner == k).sum()) for k in range(len(patches))]
    gone = [k for k, p in enumerate(patches) if kept[k] < _KEPT * len(p.xyz)]
    stay = [k for k in gone if kept[k] >= max(_LEFT * len(patches[k].xyz), _LEAST_POINTS)]
    new = [supported(patches[k], patches[k].surface, cloud.xyz[owner == k], cloud.normals[owner == k]) for k in stay]
    numbers = [patches[k].primitive for k in gone if k not in stay]
    first = next_number(patches)
    carried = list(current[len(patches) :])
    numbers += range(first, first + max(len(carried) - len(numbers), 0))
    new += [replace(p, primitive=n) for p, n in zip(carried, numbers, strict=False)]
    return Change(f"{len(carried)} patches by symmetry", tuple(gone), tuple(new))
