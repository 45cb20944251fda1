"""What one side of a symmetric part shows well, put where the other side shows it badly.

Ribs, slots, teeth and bolt holes come in pairs, rows and rings, and labels that go wrong at one of them are often right
at the next. A motion that carries most of the points onto points carries the well explained patches, too: where a patch
arrives at points that worse ones share among them, it takes these. The images decide, on all together and on each
place.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from networkx import Graph, connected_components
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.brep.job import Job
from brepgaussian.brep.motions import FEATURE, Symmetry, candidates
from brepgaussian.brep.patches import Patch, next_number, supported
from brepgaussian.brep.simplify import Change, applied
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_SAMPLED = 1500  # points that tell whether a symmetry holds
_HOLDS = 0.8  # share of them that it carries onto points,
_STEPS_HOLD = 0.6  # of a step along a row: ends and holes do not come again
_STAYS = 0.3  # share of them that a step of a row leaves in the part's box; only these are asked
_NEAR = 1.5  # reaches within which a point arrives at another,
_FACING = 0.7  # cosine between their normals
_MOST = 6  # mirrors and rotations that are followed, best first, and as many steps of rows
_ARRIVES = 0.6  # share of a patch's points that arrive at points
_COUNTERPART = 0.6  # share of these that one patch has, and of its points: it is the same face
_AGREES = 1.5  # times its own residual with the carried surface, then,
_SAME_NOISES = 3.0  # or so many noises
_WELL = 1.5  # noises: a face of the right kind with no more needs no other one's surface
_LOSES = 0.6  # of its points that a patch loses to all together if it loses any,
_TAKEN = 0.4  # and of the points where it arrives that the carried patch takes
_LEFT, _KEPT = 0.5, 0.9  # of its points: a patch that keeps fewer is gone; one that keeps more stays as it is
_LEAST_POINTS = 12
_EXACT = 1e-9  # unit frame: noise of points that have none


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
    yield from (applied(job, [change]) for change in carried(job.patches)[:1])


def carried(patches: Sequence[Patch]) -> list[Change]:
    """The patches that symmetries carry to badly explained points: all as one change, then one for every place."""
    if len(patches) < 2:
        return []
    cloud = _Cloud(patches)
    noise = max(float(np.median([p.sigma for p in patches])), _EXACT)
    return _carried(patches, cloud, _symmetries(patches, cloud, noise), noise)


def _symmetries(patches: Sequence[Patch], cloud: _Cloud, noise: float) -> list[Symmetry]:
    """Mirrors, rotations and steps that hold for most of the points, best first."""
    step = max(1, len(cloud.xyz) // _SAMPLED)
    xyz, normals = cloud.xyz[::step], cloud.normals[::step]
    low, high = xyz.min(axis=0) - cloud.reach, xyz.max(axis=0) + cloud.reach
    held: list[tuple[float, Symmetry]] = []
    for s in candidates(patches, noise, cloud.reach):
        moved = s.points(xyz)
        inside = ((low <= moved) & (moved <= high)).all(axis=1) if s.step else np.ones(len(xyz), bool)
        if inside.mean() >= _STAYS:
            held.append((float(cloud.arrived(s, xyz[inside], normals[inside]).mean()), s))
    held = sorted((h for h in held if h[0] >= (_STEPS_HOLD if h[1].step else _HOLDS)), key=lambda h: -h[0])
    return [s for steps in (False, True) for s in [s for _, s in held if s.step == steps][:_MOST]]


def _carried(patches: Sequence[Patch], cloud: _Cloud, symmetries: Sequence[Symmetry], noise: float) -> list[Change]:
    """Patches carried to points that no patch as good explains, best explained ones first."""
    owner, current = cloud.owner.copy(), list(patches)
    order = sorted(range(len(patches)), key=lambda k: -_weight(patches[k], noise))
    rank = np.argsort(order)
    small = [k for k in order if len(patches[k].xyz) <= FEATURE * len(cloud.xyz)]
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
    return _changes(patches, current, owner, cloud)


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
    """Whether a patch's surface is of the carried one's kind, and that is as good for its points or itself is good."""
    own = patch.surface.rms(xyz)
    near = surface.rms(xyz) <= max(_AGREES * own, _SAME_NOISES * noise)
    return surface.kind == patch.surface.kind and (near or own <= _WELL * noise)


def _changes(patches: Sequence[Patch], current: Sequence[Patch], owner: Indices, cloud: _Cloud) -> list[Change]:
    """All carried patches as one change, then one for every place: those that take points from the same patches."""
    new = range(len(patches), len(current))
    lost = np.bincount(cloud.owner[owner >= len(patches)], minlength=len(patches))
    change = lost > (1 - _KEPT) * np.bincount(cloud.owner, minlength=len(patches))
    places = Graph()
    places.add_nodes_from(new)
    for k in new:
        places.add_edges_from((k, -1 - int(old)) for old in np.unique(cloud.owner[owner == k]) if change[old])
    groups = [sorted(k for k in group if k >= 0) for group in connected_components(places)]
    return [
        _change(patches, current, np.where(np.isin(owner, group), owner, cloud.owner), cloud, group)
        for group in ([list(new)] if len(groups) == 1 else [list(new), *groups])
        if group
    ]


def _change(
    patches: Sequence[Patch], current: Sequence[Patch], owner: Indices, cloud: _Cloud, new: Sequence[int]
) -> Change:
    """Patches that lost points, and what takes their place."""
    kept = [int((owner == k).sum()) for k in range(len(patches))]
    gone = [k for k, p in enumerate(patches) if kept[k] < _KEPT * len(p.xyz)]
    stay = [k for k in gone if kept[k] >= max(_LEFT * len(patches[k].xyz), _LEAST_POINTS)]
    left = [supported(patches[k], patches[k].surface, cloud.xyz[owner == k], cloud.normals[owner == k]) for k in stay]
    numbers = [patches[k].primitive for k in gone if k not in stay]
    first = next_number(patches)
    numbers += range(first, first + max(len(new) - len(numbers), 0))
    carried = [replace(current[k], primitive=n) for k, n in zip(new, numbers, strict=False)]
    names = ", ".join(str(patches[k].primitive) for k in gone) or "none"
    return Change(f"{len(new)} for patches {names} by symmetry", tuple(gone), (*left, *carried))
