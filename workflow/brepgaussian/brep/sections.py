"""Patches that are prismatic walls under wrong labels: keyways and grooves as planes, slots as planes and round ends.

Narrow walls meet within a few pixels, and tangent ones show no edge at all. Labels then go across them, and one
cylinder, cone or torus explains what are two or three planes, or two bulging walls what is a slot with round ends.
In the section across the walls, where these are lines and arcs, all points together know better. These are proposals
for the images.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.patches import Patch, next_number, supported
from brepgaussian.brep.simplify import Change
from brepgaussian.geometry.surfaces import plane

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_CURVED = ("cylinder", "cone", "torus")
_ACROSS = 0.25  # root mean square cosine between the normals of prismatic walls and the direction along them
_KNOWN = np.cos(np.radians(8.0))  # between a direction and a neighbour's, which knows it better
_LEAST_TURN = np.radians(40.0)  # of the normals from one end of a section to the other: less is a bulging plane,
_LEAST_BEND = np.radians(35.0)  # and from one piece to the next
_SQUARE = np.radians(25.0)  # that walls may lean from square to the floor between them: grooves narrow in a hull
_ENDS = 0.05  # quantile of the normals' angles at either end: stray normals
_MOST_PIECES = 3
_LEAST_SHARE = 0.12  # of the points on each piece
_LEAST_POINTS = 20
_ROUNDS = 6  # of giving points to the piece that explains them best
_AS_WELL = 1.05  # times the present residual that the pieces may have: keyways 1.03, true cylinders from 1.15
_CLEARLY = 0.85  # of the residual of fewer pieces, that one more must leave
_NORMAL_NOISE = 0.15  # radians: of a surfel's normal beside an edge


@dataclass(frozen=True)
class _Section:
    """Points seen along a direction.

    Attributes:
        along, first, second: (3,) unit axes; points are (N, 2) in the latter two, normals (N, 2) unit.
    """

    along: Array
    first: Array
    second: Array
    points: Array
    normals: Array

    def direction(self, angle: float) -> Array:
        """(3,) unit vector at an angle in the section."""
        return np.asarray(np.cos(angle) * self.first + np.sin(angle) * self.second)


def angular(patches: Sequence[Patch], square: bool) -> list[Change]:
    """One change for every curved patch that is two or three planes along one direction.

    Args:
        patches: of a job.
        square: whether planes that may be square to each other are made so, as the walls of keyways are.
    """
    result: list[Change] = []
    number = next_number(patches)
    for i, patch in enumerate(patches):
        if patch.surface.kind not in _CURVED:
            continue
        planes = _planes(patch, _directions(patches, i), square)
        if planes is None:
            continue
        names = [patch.primitive, *range(number, number + len(planes) - 1)]
        number += len(planes) - 1
        new = tuple(replace(p, primitive=name) for p, name in zip(planes, names, strict=True))
        result.append(Change(f"patch {patch.primitive} as {len(planes)} planes", (i,), new))
    return result


def _directions(patches: Sequence[Patch], index: int) -> Array:
    """(K, 3) directions of the other planes and cylinders."""
    rows = [p.surface.axis for k, p in enumerate(patches) if k != index and p.surface.kind in ("plane", "cylinder")]
    return np.array(rows).reshape(-1, 3)


def _planes(patch: Patch, known: Array, square: bool) -> list[Patch] | None:
    """The planes that explain a patch about as well as its own surface; the fewest that do."""
    section = _section(patch.xyz, patch.normals, known)
    if section is None:
        return None
    angles = _angles(section.normals)
    low, high = np.quantile(angles, [_ENDS, 1 - _ENDS])
    if high - low < _LEAST_TURN:
        return None
    best: tuple[float, list[Patch]] | None = None
    for count in range(2, _MOST_PIECES + 1):
        pieces = _pieces(section, np.linspace(low, high, count), angles)
        if pieces is None:
            continue
        lines = [_line(section.points[m], section.normals[m]) for m in pieces]
        if min(_turn(n, m) for (n, _), (m, _) in pairwise(lines)) < _LEAST_BEND:
            continue
        off = [section.points[m] @ n - d for m, (n, d) in zip(pieces, lines, strict=True)]
        rms = float(np.sqrt(np.mean(np.concatenate(off) ** 2)))
        if best is None or rms < _CLEARLY * best[0]:
            facing = _faced(section, [n for n, _ in lines], known, square)
            best = rms, [_plane(patch, members, n) for members, n in zip(pieces, facing, strict=True)]
    return best[1] if best is not None and best[0] <= _AS_WELL * patch.sigma else None


def _section(xyz: Array, normals: Array, known: Array) -> _Section | None:
    """The section across prismatic walls; None if the points' normals lie in no plane."""
    vectors = np.linalg.eigh(normals.T @ normals / len(normals))[1]
    along = vectors[:, 0]
    if len(known):
        cosines = known @ along
        best = int(np.argmax(np.abs(cosines)))
        if abs(cosines[best]) > _KNOWN:
            along = known[best]
    if np.sqrt(np.mean((normals @ along) ** 2)) > _ACROSS:
        return None
    first = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    first /= np.linalg.norm(first)
    second = np.cross(along, first)
    axes = np.column_stack([first, second])
    flat = normals @ axes
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-9)
    return _Section(along, first, second, xyz @ axes, flat)


def _angles(normals: Array) -> Array:
    """(N,) angles of (N, 2) normals, continuous around their mean direction."""
    mean = normals.mean(axis=0)
    cosine, sine = normals @ mean, normals @ np.array([-mean[1], mean[0]])
    return np.asarray(np.arctan2(sine, cosine) + np.arctan2(mean[1], mean[0]))


def _pieces(section: _Section, start: Array, angles: Array) -> list[Indices] | None:
    """Points of lines that start at some angles of their normals; None if one of them is left with too few."""
    nearest = np.abs(angles[:, None] - start).argmin(axis=1)
    least = max(_LEAST_SHARE * len(angles), _LEAST_POINTS)
    for _ in range(_ROUNDS):
        lines = []
        for k in range(len(start)):
            mine = nearest == k
            if mine.sum() < least:
                return None
            lines.append(_line(section.points[mine], section.normals[mine]))
        spread = np.median(np.abs(np.concatenate([
            section.points[nearest == k] @ n - d for k, (n, d) in enumerate(lines)])))  # fmt: skip
        cost = np.column_stack([
            ((section.points @ n - d) / max(spread, 1e-9)) ** 2 + ((section.normals - n) ** 2).sum(1) / _NORMAL_NOISE**2
            for n, d in lines
        ])  # fmt: skip
        nearest = cost.argmin(axis=1)
    pieces = [np.flatnonzero(nearest == k) for k in range(len(start))]
    return pieces if min(len(p) for p in pieces) >= least else None


def _line(points: Array, normals: Array) -> tuple[Array, float]:
    """Unit normal (2,) and offset of a line through (N, 2) points, facing as their normals do."""
    normal = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][1]
    mean = normals.mean(axis=0)
    mean /= max(float(np.linalg.norm(mean)), 1e-9)
    normal = normal if normal @ mean > 0 else -normal
    if normal @ mean < _KNOWN:  # a piece that is hardly longer than its points scatter
        normal = mean
    return normal, float(np.median(points @ normal))


def _faced(section: _Section, normals: Sequence[Array], known: Array, square: bool) -> list[Array]:
    """(3,) normals of the pieces: neighbours' where these are near, and square to the middle piece if asked."""
    across = np.sqrt(1 - _KNOWN**2)
    others = [d for d in known if abs(d @ section.along) < across]
    others += [np.cross(section.along, d) for d in others]
    result = []
    for flat in normals:
        normal = flat[0] * section.first + flat[1] * section.second
        best = max(others, key=lambda d: abs(float(d @ normal)), default=normal)
        near = abs(float(best @ normal)) > _KNOWN
        result.append(_in_section(np.sign(best @ normal) * best if near else normal, section))
    if square:
        middle = result[len(result) // 2]
        side = np.cross(section.along, middle)
        for k, normal in enumerate(result):
            if abs(float(normal @ side)) > np.cos(_SQUARE):
                result[k] = np.sign(normal @ side) * side
    return result


def _in_section(direction: Array, section: _Section) -> Array:
    flat = direction - (direction @ section.along) * section.along
    return np.asarray(flat / np.linalg.norm(flat))


def _turn(first: Array, second: Array) -> float:
    """Angle between two unit vectors."""
    return float(np.arccos(np.clip(first @ second, -1, 1)))


def _plane(patch: Patch, members: Indices, normal: Array) -> Patch:
    """Some points of a patch on a plane of a given normal."""
    xyz = patch.xyz[members]
    origin = xyz.mean(axis=0)
    surface = plane(origin + (np.median(xyz @ normal) - origin @ normal) * normal, normal)
    return supported(patch, surface, xyz, patch.normals[members])
