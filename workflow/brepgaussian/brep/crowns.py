"""Fillets of one radius all around a flat face, where labels run over from one to the next or into the face itself.

No image shows where a fillet ends, neither at the faces that it touches nor at the next fillet around the corner. One
label for two of them is explained by a cone that is neither. But modellers round a face's edges all at once: fillets
that are known tell the radius of the others, and every point near the face lies on one of them.
"""

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.spatial import cKDTree

from brepgaussian.brep.blends import Blend, blended, builder, size, stray
from brepgaussian.brep.patches import NEARBY, Patch, next_number, supported, thinned_out
from brepgaussian.brep.simplify import Change
from brepgaussian.geometry.surfaces import Surface, plane

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_LEANING = np.radians(8.0)  # by which a wall may lean from upright on the face
_WIDER = 1.2  # radii of its fillets that a round wall has at least: less is a ball
_BEYOND = 1.6  # radii from the face and a wall within which points tell the radius
_LIKE = 1.5  # times that of the known fillets, up or down, that the radius may be
_UNDER, _BELOW = 0.8, 6.0  # radii, and reaches past a radius, below the face within which walls tell where they run
_MEETING = 0.6  # of the points near an edge that lie on its fillet, and of those next to it that have it beside them
_FACING = np.cos(np.radians(30.0))  # between a point's normal and its fillet's: faces that end there are square on it
_MIDDLE = 0.6  # radii below the face and behind the wall: 25 to 65 of the 90 degrees; the rest is near sharp edges, too
_ROUNDS = 3  # of fitting the face and the radius
_OWN = 0.7  # of a patch's points that lie on one fillet and of a fillet's points that are its: it is known already
_MOSTLY = 0.5  # of a patch's points that lie on fillets: it is none of the faces beside them
_FEW = 8  # points of a patch


@dataclass(frozen=True)
class _Rim:
    """A flat face whose edges may have fillets of one signed radius, positive on convex ones, towards walls.

    Attributes:
        top: index of its patch.
        walls: indices of those that stand square on it.
        radius: of the fillets.
        patches: all of them, the face level.
        below: (N,) depths of all points below the face; above it on concave edges.
        behind: (N,) depths behind the nearest wall, seen along the face's normal; in front of it on concave edges.
        nearest: (N,) which of the walls that is, -1 where none is near.
    """

    top: int
    walls: tuple[int, ...]
    radius: float
    patches: tuple[Patch, ...]
    below: Array
    behind: Array
    nearest: Indices

    @property
    def xyz(self) -> Array:
        """(N, 3) the points."""
        return _points(self.patches)

    def on(self, noise: float) -> Indices:
        """(N,) which of the fillets points lie on and face as, -1: none."""
        radius, xyz, normals = abs(self.radius), self.xyz, np.concatenate([p.normals for p in self.patches])
        near = np.abs(_off(self.below, self.behind, radius)) <= stray(radius, noise)
        on = np.where(near & (self.below < radius) & (self.behind < radius), self.nearest, -1)
        for k in range(len(self.walls)):
            at = np.flatnonzero(on == k)
            facing = np.einsum("ij,ij->i", self.fillet(k).normals(xyz[at]), normals[at])
            on[at[facing < _FACING]] = -1
        return on

    def fillet(self, wall: int) -> Surface:
        """The surface of one of the fillets."""
        return builder([self.patches[i].surface for i in (self.walls[wall], self.top)])(self.radius)

    def of(self, index: int) -> slice:
        """The points of a patch."""
        start = sum(len(p.xyz) for p in self.patches[:index])
        return slice(start, start + len(self.patches[index].xyz))


def crowned(patches: Sequence[Patch], noise: float) -> list[Change]:
    """One change for every flat face that is rounded further around than its labels say."""
    changes, taken = [], set[int]()
    resized, blends = blended(patches, noise)
    edges = [b for b in blends if len(b.faces) == 2]
    count = Counter(i for b in edges for i in b.faces if patches[i].surface.kind == "plane")
    for top, _ in sorted(count.items(), key=lambda item: (-item[1], item[0])):
        known = [b for b in edges if top in b.faces]
        rim = _told(top, _usual(known, resized), known, patches, noise)
        change = None if rim is None else _relabelled(rim, noise)
        if change is not None and not taken & set(change.gone):
            taken |= set(change.gone)
            changes.append(change)
    return changes


def _usual(blends: Sequence[Blend], patches: Sequence[Patch]) -> float:
    """The signed radius of most points of some fillets."""
    surfaces = [patches[b.patch].surface for b in blends]
    radii = [-size(s) if s.flipped else size(s) for s in surfaces]
    count = [len(patches[b.patch].xyz) for b in blends]
    convex = sum(n for r, n in zip(radii, count, strict=True) if r > 0) * 2 >= sum(count)
    return float(np.median([r for r in radii if (r > 0) == convex]))


def _told(top: int, radius: float, known: Sequence[Blend], patches: Sequence[Patch], noise: float) -> _Rim | None:
    """The rim of a flat face, level, with the radius that known fillets tell; None without walls that have points."""
    others = (i for i in range(len(patches)) if i not in {top, *(b.patch for b in known)})
    walls = tuple(i for i in others if _upright(patches[i], patches[top], radius))
    told = {walls.index(i) for b in known for i in b.faces if i in walls}
    rim = _rim(top, walls, radius, patches)
    for step in (_levelled, partial(_refitted, told=told, noise=noise)) * _ROUNDS:
        rim = None if rim is None else step(rim)
    return rim


def _rim(top: int, walls: tuple[int, ...], radius: float, patches: Sequence[Patch]) -> _Rim | None:
    """A rim with the places of all points on it; None if there are no walls next to where fillets would end."""
    face, large, way = patches[top].surface, abs(radius), -np.sign(radius)
    xyz = _points(patches)
    below = way * face.signed_distance(xyz)
    outline, owner = [], []
    for k, index in enumerate(walls):
        wall = patches[index]
        depth = way * face.signed_distance(wall.xyz)
        under = wall.xyz[(depth > _UNDER * large) & (depth < large + _BELOW * wall.reach)]
        outline.append(face.project(under))
        owner.append(np.full(len(under), k))
    lines, owners = np.concatenate([*outline, np.zeros((0, 3))]), np.concatenate([*owner, np.zeros(0, int)])
    if not len(lines):
        return None
    nearest = np.full(len(xyz), -1)
    level = np.flatnonzero(np.abs(below) < _BEYOND * large)
    distance, index = cKDTree(lines).query(face.project(xyz[level]), distance_upper_bound=_BEYOND * large)
    found = np.isfinite(distance)
    nearest[level[found]] = owners[index[found]]
    behind = np.full(len(xyz), np.inf)
    for k, wall_index in enumerate(walls):
        at = nearest == k
        behind[at] = way * patches[wall_index].surface.signed_distance(xyz[at])
    return _Rim(top, walls, radius, tuple(patches), below, behind, nearest)


def _upright(wall: Patch, top: Patch, radius: float) -> bool:
    """Whether a patch stands square on a flat face, and may have a fillet towards it."""
    ahead = abs(float(wall.surface.axis @ top.surface.axis))
    if wall.surface.kind == "cylinder":
        round_enough = wall.surface.flipped == (radius > 0) or wall.surface.radius > _WIDER * abs(radius)
        return ahead > np.cos(_LEANING) and round_enough
    return wall.surface.kind == "plane" and ahead < np.sin(_LEANING)


def _levelled(rim: _Rim) -> _Rim | None:
    """A rim with its face through those of its points that are farther from all walls than fillets reach."""
    face = rim.patches[rim.top]
    xyz = face.xyz[rim.behind[rim.of(rim.top)] > abs(rim.radius)]
    if len(xyz) < _FEW:
        return rim
    middle = xyz.mean(axis=0)
    axis = np.linalg.svd(xyz - middle, full_matrices=False)[2][-1]
    level = replace(face, surface=plane(middle, axis if axis @ face.surface.axis > 0 else -axis))
    patches = [level if i == rim.top else p for i, p in enumerate(rim.patches)]
    return _rim(rim.top, rim.walls, rim.radius, patches)


def _refitted(rim: _Rim, told: Collection[int], noise: float) -> _Rim | None:
    """A rim with the radius that explains the points towards some of its walls best."""
    radius = abs(rim.radius)
    some = np.isin(rim.nearest, sorted(told)) & (np.abs(rim.behind) < _BEYOND * radius)
    if some.sum() < _FEW:
        return rim
    worst = stray(radius, noise)
    below, behind = rim.below[some], rim.behind[some]

    def cost(value: float) -> float:
        return float(np.minimum(np.abs(_off(below, behind, value)), worst).mean())

    best = minimize_scalar(cost, bounds=(radius / _LIKE, radius * _LIKE), method="bounded").x
    return _rim(rim.top, rim.walls, float(np.copysign(best, rim.radius)), rim.patches)


def _off(below: Array, behind: Array, radius: float) -> Array:
    """(N,) distances of points from a square edge that is rounded."""
    within = (below < radius) & (behind < radius)
    inside = [np.where(within, radius - depth, 0.0) for depth in (below, behind)]
    return np.where(within, radius - np.hypot(*inside), np.minimum(below, behind))


def _meets(rim: _Rim, wall: int, on: Indices) -> bool:
    """Whether the points of a fillet go along both the wall and the face."""
    radius, here = abs(rim.radius), rim.nearest == wall
    edge = here & (np.maximum(rim.below, rim.behind) < _MIDDLE * radius)
    band = edge & (on == wall)
    if band.sum() < max(_FEW, _MEETING * edge.sum()):
        return False
    tree = cKDTree(rim.xyz[band])
    for index, (far, other) in ((rim.walls[wall], (rim.below, rim.behind)), (rim.top, (rim.behind, rim.below))):
        patch, own = rim.patches[index], rim.of(index)
        beside = here & (far > radius) & (far < radius + NEARBY * patch.reach) & (np.abs(other) < radius / 2)
        next_to = patch.xyz[beside[own]]
        reach = NEARBY * patch.reach + radius * (np.pi / 4)
        if len(next_to) < _FEW or np.mean(tree.query(next_to, distance_upper_bound=reach)[0] < np.inf) < _MEETING:
            return False
    return True


def _relabelled(rim: _Rim, noise: float) -> Change | None:
    """Every fillet of a rim with its own points, and what these leave of the others; None if all are known."""
    every, patches = rim.on(noise), rim.patches
    fillets = [k for k in range(len(rim.walls)) if _meets(rim, k, every)]
    every = np.where(np.isin(every, fillets), every, -1)
    on = [every[rim.of(i)] for i in range(len(patches))]
    if len(fillets) < 2 or all(_is_known(k, on) for k in fillets):
        return None
    faces = {rim.top, *rim.walls}
    changed = [i for i, k in enumerate(on) if (k >= 0).any()]
    gone = [i for i in changed if i not in faces and (on[i] >= 0).mean() > _MOSTLY]
    new = [thinned_out(patches[i], on[i] >= 0) for i in changed if i not in gone and (on[i] < 0).sum() >= _FEW]
    number, like = next_number(patches), patches[rim.top]
    for k in fillets:
        xyz = np.concatenate([p.xyz[o == k] for p, o in zip(patches, on, strict=True)])
        normals = np.concatenate([p.normals[o == k] for p, o in zip(patches, on, strict=True)])
        new.append(supported(replace(like, primitive=number + k), rim.fillet(k), xyz, normals))
    name = f"{len(fillets)} fillets of radius {abs(rim.radius):.3f} around patch {like.primitive}"
    return Change(name, tuple(changed), tuple(new), smooth=True)


def _points(patches: Sequence[Patch]) -> Array:
    return np.concatenate([p.xyz for p in patches])


def _is_known(fillet: int, on: Sequence[Indices]) -> bool:
    """Whether the points of a fillet are those of one patch."""
    counts = np.array([(k == fillet).sum() for k in on])
    best = int(counts.argmax())
    return bool(counts[best] >= _OWN * counts.sum() and counts[best] >= _OWN * len(on[best]))
