"""Caps: surfaces guessed from open borders where a whole face has no points.

A loop of open border points in one plane suggests a plane; a circle of them in a planar patch suggests a
cylinder on it. Caps have no support: the minimum cut takes them only where they close the solid cheaply.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.borders import clusters
from brepgaussian.brep.patches import Patch, guessed
from brepgaussian.geometry.circles import circle_through
from brepgaussian.geometry.surfaces import cylinder, plane

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_LINK = 4.0  # of reach: steps between border points of one loop (corners are thin)
_NEAR = 0.8  # of reach: border points lie this far inside the true border
_LEAST = 12  # border points that suggest a plane or a circle
_LEAST_SPREAD = 2.0  # of reach: a loop narrower than this is a line and fixes no plane
_SHARE = 0.5  # of a loop's points that its circle must hold
_MOST_PLANES = 4  # looked for in one loop
_DRAWS = 300
_SNAP = np.radians(5.0)  # directions closer than this to one that is known are taken as it
_EDGE_QUANTILE = 0.85  # of border points' positions: where the border is
_ARC = np.radians(120.0)  # a circle must be seen over at least this angle
_PARALLEL = 1e-6  # cosine between a cylinder's axis and the normal of a plane along it
_FEW = 6  # caps up to this number go through the whole box: their borders are the least certain
_ROUND = 40  # points that stand for a cap's circle


def find_caps(patches: Sequence[Patch], borders: Sequence[Indices], seed: int) -> list[Patch]:
    """Guess caps from the open borders of patches (those that repeat a known surface are left out)."""
    some = [(i, b) for i, b in enumerate(borders) if len(b)]
    if not some:
        return []
    reach = float(np.median([patches[i].reach for i, _ in some]))
    rng = np.random.default_rng(seed)
    rings = [r for i, b in some if patches[i].surface.kind == "plane" for r in _circles(patches[i], b, reach, rng)]
    found = _cylinders(rings, reach)
    xyz = np.concatenate([patches[i].xyz[b] for i, b in some])
    inward = np.concatenate([np.tile(patches[i].xyz.mean(axis=0), (len(b), 1)) for i, b in some])
    directions = [p.surface.axis for p in patches if p.surface.kind != "sphere"]
    found += _planes(xyz, inward, directions, reach, rng)
    caps: list[Patch] = []
    for guess in found:
        cap = _tangent(guess, patches, reach)
        if any(_repeats(cap, other, reach) for other in patches):
            continue
        same = next((k for k, other in enumerate(caps) if _repeats(cap, other, reach)), None)
        if same is None:
            caps.append(cap)
        else:  # another piece of the same loop
            both = np.concatenate([caps[same].xyz, caps[same].surface.project(cap.xyz)])
            caps[same] = replace(caps[same], xyz=both, normals=caps[same].surface.normals(both).copy())
    return [replace(c, whole=True) for c in caps] if len(caps) <= _FEW else caps


def _tangent(cap: Patch, patches: Sequence[Patch], reach: float) -> Patch:
    """A plane that all but touches a cylinder along a line is put onto it: a fillet ends there."""
    if cap.surface.kind != "plane":
        return cap
    normal = cap.surface.axis
    for patch in patches:
        surface = patch.surface
        if surface.kind != "cylinder" or abs(surface.axis @ normal) > _PARALLEL:
            continue
        away = float((surface.origin - cap.surface.origin) @ normal)
        shift = away - np.sign(away) * surface.radius
        touch = surface.origin - np.sign(away) * surface.radius * normal
        axis = surface.axis
        near = patch.xyz - touch - ((patch.xyz - touch) @ axis)[:, None] * axis
        if abs(shift) < reach and np.linalg.norm(near, axis=1).min() < 2 * reach:
            moved = plane(cap.surface.origin + shift * normal, normal)
            return guessed(moved, moved.project(cap.xyz), cap.reach)
    return cap


def _repeats(cap: Patch, other: Patch, reach: float) -> bool:
    """Whether a cap is next to nothing but a known surface once more."""
    if cap.surface.kind != other.surface.kind:
        return False
    return bool(np.abs(other.surface.signed_distance(cap.xyz)).max() < 1.5 * reach)


def _planes(
    xyz: Array, inward: Array, directions: Sequence[Array], reach: float, rng: np.random.Generator
) -> list[Patch]:
    """Planes through loops of border points."""
    result = []
    for group in clusters(xyz, _LINK * reach):
        left = group
        for _ in range(_MOST_PLANES):
            if len(left) < _LEAST:
                break
            inliers, normal = _best_plane(xyz[left], _NEAR * reach, rng)
            if len(inliers) < _LEAST:
                break
            on = xyz[left[inliers]]
            spread = np.linalg.svd(on - on.mean(axis=0), compute_uv=False)[1] / np.sqrt(len(on))
            if spread < 0.5 * _LEAST_SPREAD * reach:
                left = np.delete(left, inliers)
                continue
            normal = _snapped(normal, directions)
            if np.mean((on - inward[left[inliers]]) @ normal) < 0:
                normal = -normal
            offset = float(np.quantile(on @ normal, _EDGE_QUANTILE))
            surface = plane(on.mean(axis=0) + (offset - on.mean(axis=0) @ normal) * normal, normal)
            result.append(guessed(surface, surface.project(on), reach))
            left = np.delete(left, inliers)
    return result


def _best_plane(points: Array, limit: float, rng: np.random.Generator) -> tuple[Indices, Array]:
    """Indices near the plane that most points agree on, and its normal."""
    triples = np.array([rng.choice(len(points), 3, replace=False) for _ in range(_DRAWS)])
    a, b, c = (points[triples[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1)
    good = length > limit**2
    if not good.any():
        return np.zeros(0, np.int64), np.array([0.0, 0.0, 1.0])
    normals, a = normals[good] / length[good, None], a[good]
    counts = (np.abs(points @ normals.T - np.einsum("ij,ij->i", a, normals)) < limit).sum(axis=0)
    best = int(np.argmax(counts))
    near = np.flatnonzero(np.abs((points - a[best]) @ normals[best]) < limit)
    center = points[near].mean(axis=0)
    normal = np.linalg.svd(points[near] - center)[2][2]
    return np.flatnonzero(np.abs((points - center) @ normal) < limit), normal


def _snapped(normal: Array, directions: Sequence[Array]) -> Array:
    """The known direction next to a normal, or the normal across two known ones, if close."""
    known = [d / np.linalg.norm(d) for d in directions]
    crosses = [np.cross(p, q) for i, p in enumerate(known) for q in known[:i]]
    known += [c / np.linalg.norm(c) for c in crosses if np.linalg.norm(c) > np.sin(_SNAP)]
    if not known:
        return normal
    cosines = np.array(known) @ normal
    best = int(np.argmax(np.abs(cosines)))
    return np.sign(cosines[best]) * known[best] if abs(cosines[best]) > np.cos(_SNAP) else normal


Ring = tuple[Array, Array, float, bool]  # centre, axis, radius, hole


def _circles(patch: Patch, border: Indices, reach: float, rng: np.random.Generator) -> list[Ring]:
    """Circles among the open border points of a planar patch."""
    x, y, axis = patch.surface.frame()
    points = patch.xyz[border]
    flat = np.column_stack([(points - patch.surface.origin) @ x, (points - patch.surface.origin) @ y])
    result: list[Ring] = []
    for group in clusters(points, _LINK * reach):
        if len(group) < _LEAST:
            continue
        circle = _best_circle(flat[group], _NEAR * reach, rng)
        if circle is None:
            continue
        center, radius, inliers = circle
        angles = np.sort(np.arctan2(*(flat[group[inliers]] - center).T[::-1]))
        widest = float(np.diff(np.append(angles, angles[0] + 2 * np.pi)).max())
        if len(inliers) < max(_LEAST, _SHARE * len(group)) or 2 * np.pi - widest < _ARC:
            continue
        own = np.column_stack([(patch.xyz - patch.surface.origin) @ x, (patch.xyz - patch.surface.origin) @ y])
        ring = np.abs(np.linalg.norm(own - center, axis=1) - radius) < 3 * reach
        hole = bool(np.mean(np.linalg.norm(own[ring] - center, axis=1) > radius) > 0.5)
        distances = np.linalg.norm(flat[group[inliers]] - center, axis=1)
        radius = float(np.quantile(distances, 1 - _EDGE_QUANTILE if hole else _EDGE_QUANTILE))
        result.append((patch.surface.origin + center[0] * x + center[1] * y, axis, radius, hole))
    return result


def _best_circle(points: Array, limit: float, rng: np.random.Generator) -> tuple[Array, float, Indices] | None:
    """Centre, radius and inliers of the circle that most points agree on; least squares at the end."""
    triples = np.array([rng.choice(len(points), 3, replace=False) for _ in range(_DRAWS)])
    best, best_inliers = None, np.zeros(0, np.int64)
    for triple in triples:
        circle = circle_through(points[triple])
        if circle is None or circle[1] > 1.0:
            continue
        inliers = np.flatnonzero(np.abs(np.linalg.norm(points - circle[0], axis=1) - circle[1]) < limit)
        if len(inliers) > len(best_inliers):
            best, best_inliers = circle, inliers
    if best is None or len(best_inliers) < 3:
        return None
    refined = circle_through(points[best_inliers])
    if refined is None or refined[1] < 2 * limit:
        return None
    return refined[0], refined[1], best_inliers


def _cylinders(rings: Sequence[Ring], reach: float) -> list[Patch]:
    """Cylinders on circles; two circles on one axis make one cylinder between them."""
    result, used = [], set()
    for i, (center, axis, radius, hole) in enumerate(rings):
        if i in used:
            continue
        ends, radii = [center], [radius]
        for j in range(i + 1, len(rings)):
            other, other_axis, other_radius, _ = rings[j]
            offset = other - center
            along = offset @ axis
            if (
                abs(abs(axis @ other_axis) - 1) < 1e-6
                and np.linalg.norm(offset - along * axis) < reach
                and abs(radius - other_radius) < reach
                and abs(along) > reach
            ):
                ends.append(other)
                radii.append(other_radius)
                used.add(j)
        middle = np.mean([e - ((e - center) @ axis) * axis for e in ends], axis=0)
        surface = cylinder(middle, axis, float(np.mean(radii)), flipped=hole)
        x, y, _ = surface.frame()
        turn = np.linspace(0, 2 * np.pi, _ROUND, endpoint=False)
        rim = surface.radius * (np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * y)
        xyz = np.concatenate([middle + ((e - middle) @ axis) * axis + rim for e in ends])
        cap = guessed(surface, xyz, reach)
        result.append(cap if len(ends) > 1 else replace(cap, whole=True))
    return result
