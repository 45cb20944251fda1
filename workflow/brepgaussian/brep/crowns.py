"""Fillets of one radius all around a flat face, where labels run over from one to the next or into the face itself.

No image shows where a fillet ends, neither at the faces that it touches nor at the next fillet around the corner. One
label for two of them is explained by a cone that is neither. But modellers round a face's edges all at once: fillets
that are known tell the radius of the others, and every point near the face lies on one of them.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.spatial import cKDTree

from brepgaussian.brep.blends import Blend, blended, builder, size
from brepgaussian.brep.patches import NEARBY, Patch, next_number, supported
from brepgaussian.brep.simplify import Change
from brepgaussian.geometry.surfaces import Surface, plane

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_SQUARE = np.sin(np.radians(8.0))  # of the angle by which a wall may lean from upright on the face
_WIDER = 1.2  # radii of its fillets that a round wall has at least: less is a ball
_BEYOND = 1.6  # radii from the face and a wall within which points tell the radius
_LIKE = 1.5  # times that of the known fillets, up or down, that the radius may be
_WORSE = 3.0  # noises, and
_CHORD = 0.1  # radii, by which points of a fillet may be off: silhouettes cut an inner one into chords
_MEETING = (
    0.6  # of points near an edge that lie on its fillet, and of those next to it that have some of it beside them
)
_FACING = np.cos(
    np.radians(30.0)
)  # between a point's normal and that of its fillet: faces that end there are square on it
_MIDDLE = 0.6  # radii below the face and behind the wall: 25 to 65 of the 90 degrees; the rest is near sharp edges, too
_ROUNDS = 3  # of fitting the face and the radius
_OWN = 0.7  # of a patch's points that lie on one fillet and of a fillet's points that are its: it is known already
_MOSTLY = 0.5  # of a patch's points that lie on fillets: it is none of the faces beside them
_FEW = 8  # points of a patch


@dataclass(frozen=True)
class _Crown:
    """A flat face with fillets of one signed radius, positive on convex edges, towards walls.

    Attributes:
        top: index of its patch.
        walls: indices of those of the walls.
        radius: of the fillets.
    """

    top: int
    walls: tuple[int, ...]
    radius: float


def crowned(patches: Sequence[Patch], noise: float) -> list[Change]:
    """One change for every flat face that is rounded further around than its labels say."""
    changes, taken = [], set[int]()
    for crown, level in _crowns(patches, noise):
        change = _relabelled(crown, level, noise)
        if change is not None and not taken & set(change.gone):
            taken |= set(change.gone)
            changes.append(change)
    return changes


def _crowns(patches: Sequence[Patch], noise: float) -> Iterator[tuple[_Crown, list[Patch]]]:
    """Flat faces that fillets touch, those with most of them first, with all walls that have one; and the patches.

    The face among these is level: points of its fillets may have tilted it.
    """
    resized, blends = blended(patches, noise)
    edges = [b for b in blends if len(b.faces) == 2]
    count = Counter(i for b in edges for i in b.faces if patches[i].surface.kind == "plane")
    for top, _ in sorted(count.items(), key=lambda item: (-item[1], item[0])):
        known = [b for b in edges if top in b.faces]
        radius = _usual(known, resized)
        others = (i for i in range(len(patches)) if i not in {top, *(b.patch for b in known)})
        upright = tuple(i for i in others if _upright(patches[i], patches[top], radius))
        told, level = tuple(sorted({i for b in known for i in b.faces} - {top})), list(patches)
        for _ in range(_ROUNDS):
            level[top] = _level(_Crown(top, upright, radius), level)
            radius = _fitted(_Crown(top, told, radius), level, noise)
        walls = tuple(i for i in upright if _meets(_Crown(top, (i,), radius), level, noise))
        if len(walls) > 1:
            yield _Crown(top, walls, radius), level


def _usual(blends: Sequence[Blend], patches: Sequence[Patch]) -> float:
    """The signed radius of most points of some fillets."""
    radii = [
        (-size(s) if s.flipped else size(s), len(patches[b.patch].xyz))
        for b in blends
        for s in [patches[b.patch].surface]
    ]
    convex = sum(n for r, n in radii if r > 0) >= sum(n for r, n in radii if r < 0)
    return float(np.median([r for r, _ in radii if (r > 0) == convex]))


def _upright(wall: Patch, top: Patch, radius: float) -> bool:
    """Whether a patch stands square on a flat face, and may have a fillet towards it."""
    ahead = abs(float(wall.surface.axis @ top.surface.axis))
    if wall.surface.kind == "cylinder":
        round_enough = wall.surface.flipped == (radius > 0) or wall.surface.radius > _WIDER * abs(radius)
        return ahead > np.sqrt(1 - _SQUARE**2) and round_enough
    return wall.surface.kind == "plane" and ahead < _SQUARE


def _fillet(crown: _Crown, wall: int, patches: Sequence[Patch]) -> Surface:
    faces = [patches[i].surface for i in (wall, crown.top)]
    return builder(faces)(crown.radius)


def _depths(crown: _Crown, patches: Sequence[Patch], xyz: Array) -> tuple[Array, Array]:
    """(N,) depths of points below the face, and (W, N) behind every wall; on concave edges in front of them.

    Infinite behind walls that have no points nearby.
    """
    way, near = -np.sign(crown.radius), _BEYOND * abs(crown.radius)
    below = way * patches[crown.top].surface.signed_distance(xyz)
    behind = np.full((len(crown.walls), len(xyz)), np.inf)
    level = np.flatnonzero(np.abs(below) < near)
    for row, index in zip(behind, crown.walls, strict=True):
        wall = patches[index]
        distance = wall.surface.signed_distance(xyz[level])
        at = level[np.abs(distance) < near]
        reach = np.hypot(near, near) + NEARBY * wall.reach
        at = at[cKDTree(wall.xyz).query(xyz[at], distance_upper_bound=reach)[0] < np.inf]
        row[at] = way * wall.surface.signed_distance(xyz[at])
    return below, behind


def _fitted(crown: _Crown, patches: Sequence[Patch], noise: float) -> float:
    """The signed radius that explains the points near a face best."""
    radius = abs(crown.radius)
    below, behind = _depths(crown, patches, _all(patches)[0])
    nearest = behind.min(axis=0)
    some = (np.abs(below) < _BEYOND * radius) & (np.abs(nearest) < _BEYOND * radius)
    if some.sum() < _FEW:
        return crown.radius
    worst = max(_WORSE * noise, _CHORD * radius)

    def cost(value: float) -> float:
        off = _off(below[some], nearest[some], value)
        return float(np.minimum(np.abs(off), worst).mean())

    best = minimize_scalar(cost, bounds=(radius / _LIKE, radius * _LIKE), method="bounded").x
    return float(np.copysign(best, crown.radius))


def _off(below: Array, behind: Array, radius: float) -> Array:
    """(N,) distances of points from a square edge that is rounded."""
    within = (below < radius) & (behind < radius)
    return np.where(within, radius - np.hypot(radius - below, radius - behind), np.minimum(below, behind))


def _on(crown: _Crown, patches: Sequence[Patch], some: Sequence[Patch], noise: float) -> Indices:
    """(N,) which of a crown's fillets the points of some patches lie on and face as, -1: none."""
    xyz, normals = _all(some)
    below, behind = _depths(crown, patches, xyz)
    nearest, radius = behind.argmin(axis=0), abs(crown.radius)
    least = behind[nearest, np.arange(len(xyz))]
    near = np.abs(_off(below, least, radius)) <= max(_WORSE * noise, _CHORD * radius)
    on = np.where(near & (below < radius) & (least < radius), nearest, -1)
    for k, wall in enumerate(crown.walls):
        at = np.flatnonzero(on == k)
        facing = np.einsum("ij,ij->i", _fillet(crown, wall, patches).normals(xyz[at]), normals[at])
        on[at[facing < _FACING]] = -1
    return on


def _all(patches: Sequence[Patch]) -> tuple[Array, Array]:
    """(N, 3) points and normals of patches."""
    return np.concatenate([p.xyz for p in patches]), np.concatenate([p.normals for p in patches])


def _meets(crown: _Crown, patches: Sequence[Patch], noise: float) -> bool:
    """Whether the points of a fillet towards a crown's only wall go along both the wall and the face."""
    radius, (wall,) = abs(crown.radius), crown.walls
    xyz = _all(patches)[0]
    below, behind = _depths(crown, patches, xyz)
    edge = np.maximum(below, behind[0]) < _MIDDLE * radius
    band = edge & (_on(crown, patches, patches, noise) == 0)
    if band.sum() < max(_FEW, _MEETING * edge.sum()):
        return False
    tree = cKDTree(xyz[band])
    for index, kept in ((wall, 0), (crown.top, 1)):
        patch = patches[index]
        below, behind = _depths(crown, patches, patch.xyz)
        far, other = (below, behind[0]) if kept == 0 else (behind[0], below)
        next_to = patch.xyz[(far > radius) & (far < radius + NEARBY * patch.reach) & (np.abs(other) < radius / 2)]
        if len(next_to) < _FEW:
            return False
        reach = NEARBY * patch.reach + radius * (np.pi / 4)
        if np.mean(tree.query(next_to, distance_upper_bound=reach)[0] < np.inf) < _MEETING:
            return False
    return True


def _relabelled(crown: _Crown, patches: Sequence[Patch], noise: float) -> Change | None:
    """Every fillet of a crown with its own points, and what these leave of the others; None if all are known."""
    on = [_on(crown, patches, [p], noise) for p in patches]
    fillets = range(len(crown.walls))
    if all(_is_known(k, on) for k in fillets):
        return None
    faces = {crown.top, *crown.walls}
    changed = [i for i, k in enumerate(on) if (k >= 0).any()]
    gone = [i for i in changed if i not in faces and (on[i] >= 0).mean() > _MOSTLY]
    new = []
    for i in (i for i in changed if i not in gone):
        rest = on[i] < 0
        if rest.sum() >= _FEW:
            new.append(supported(patches[i], patches[i].surface, patches[i].xyz[rest], patches[i].normals[rest]))
    number = next_number(patches)
    like = patches[crown.top]
    for k in fillets:
        xyz, normals = (
            np.concatenate([getattr(p, name)[o == k] for p, o in zip(patches, on, strict=True)])
            for name in ("xyz", "normals")
        )
        if len(xyz) >= _FEW:
            surface = _fillet(crown, crown.walls[k], patches)
            new.append(supported(replace(like, primitive=number + k), surface, xyz, normals))
    name = f"{len(fillets)} fillets of radius {abs(crown.radius):.3f} around patch {like.primitive}"
    return Change(name, tuple(changed), tuple(new), smooth=True)


def _is_known(fillet: int, on: Sequence[Indices]) -> bool:
    """Whether the points of a fillet are those of one patch."""
    counts = np.array([(k == fillet).sum() for k in on])
    best = int(counts.argmax())
    return bool(counts[best] >= _OWN * counts.sum() and counts[best] >= _OWN * len(on[best]))


def _level(crown: _Crown, patches: Sequence[Patch]) -> Patch:
    """A crown's face through those of its points that are farther from all walls than fillets reach, if there are."""
    patch = patches[crown.top]
    xyz = patch.xyz[_depths(crown, patches, patch.xyz)[1].min(axis=0) > abs(crown.radius)]
    if len(xyz) < _FEW:
        return patch
    middle = xyz.mean(axis=0)
    axis = np.linalg.svd(xyz - middle, full_matrices=False)[2][-1]
    return replace(patch, surface=plane(middle, axis if axis @ patch.surface.axis > 0 else -axis))
