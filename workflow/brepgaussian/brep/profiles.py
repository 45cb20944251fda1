"""Patches that are two or three straight faces of revolution under one label: a countersink and its throat, a groove.

A narrow cone and the short cylinder below it have one grey, and the points round off the edge between them: a torus
explains both, and a cone does badly. Two straight pieces of the profile - distance from the axis over height -
explain it as well as the torus, and better than the cone. A narrow groove's walls and floor, rounded off by the hull,
are a torus, too: three pieces explain it clearly better.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.brep.patches import Patch, next_number, supported, touch
from brepgaussian.brep.simplify import Change
from brepgaussian.geometry.surfaces import Surface, cone, cylinder, plane

Array = NDArray[np.float64]

_ALONG = np.cos(np.radians(8.0))  # between the torus's axis and the normal of a plane beside it, which knows it better
# Residuals of two lines over the surface's own. Torus: .9-1.0 for countersinks, from 1.2 for fillets. Of a straight
# surface two lines explain any bulge better (.8-1.0): .5-.7 for countersinks.
_AS_WELL = {"torus": 1.1, "cone": 0.75, "cylinder": 0.75}
_GROOVE = 0.8  # residual of a groove's three lines over the surface's own, at most: a fillet's arc leaves more
_WALLED = ("plane", "cylinder", "plane")  # kinds of a groove's pieces
_LEAST_SHARE = 0.1  # of the points on each piece
_LEAST_POINTS = 20
_LEAST_TURN = np.radians(10.0)  # between the pieces
_SQUARE = np.radians(8.0)  # a line this near to the axis, or to square to it, is a cylinder or a plane,
_LEANING = np.radians(25.0)  # or this near in a groove, which narrows in a hull
_FLAT = np.radians(35.0)  # a cone as near to square to its axis may be a shoulder: 25 measured; of a drill tip 31
_BENT = np.radians(65.0)  # that normals of a narrow plane may turn by: hulls round its edges. Of a fillet 72
_WITHIN = 0.1  # quantile of the normals at both ends
_BREAKS = 160  # places along a profile at which pieces of a groove may meet


def straightened(patches: Sequence[Patch]) -> list[Change]:
    """One change for every patch that is two straight pieces: a patch for each of them in its place."""
    result: list[Change] = []
    number = next_number(patches)
    for i, patch in enumerate(patches):
        if patch.surface.kind not in _AS_WELL:
            continue
        pieces = _pieces(patch, [p for k, p in enumerate(patches) if k != i])
        if pieces is not None:
            kinds = " and ".join(p.surface.kind for p in pieces)
            new = (pieces[0], replace(pieces[1], primitive=number + len(result)))
            result.append(Change(f"patch {patch.primitive} as {kinds}", (i,), new))
    return result


def grooved(patches: Sequence[Patch]) -> list[Change]:
    """One change for every patch that is a groove around an axis: two walls and a floor in its place."""
    result: list[Change] = []
    number = next_number(patches)
    for i, patch in enumerate(patches):
        if patch.surface.kind not in _AS_WELL:
            continue
        pieces = _groove(patch, [p for k, p in enumerate(patches) if k != i])
        if pieces is not None:
            names = patch.primitive, number, number + 1
            number += 2
            new = tuple(replace(p, primitive=name) for p, name in zip(pieces, names, strict=True))
            result.append(Change(f"patch {patch.primitive} as a groove", (i,), new))
    return result


def flattened(patches: Sequence[Patch]) -> list[Change]:
    """One change for every cone or torus that is nearly flat, about the normal of a plane: a plane across its axis.

    Of the walls of a groove, few views show the inner ends, and hulls narrow there. At the foot of a shank the points
    of a narrow shoulder bend up.
    """
    normals = [p.surface.axis for p in patches if p.surface.kind == "plane"]
    result: list[Change] = []
    for i, patch in enumerate(patches):
        axis = patch.surface.axis
        flat = patch.surface.kind == "cone" and patch.surface.angle > np.pi / 2 - _FLAT
        if patch.surface.kind == "torus":
            flat = float(np.median(np.abs(patch.normals @ axis))) > np.cos(_FLAT)
        square = [n for n in normals if abs(float(n @ axis)) > _ALONG]
        if not (flat and square):
            continue
        normal = max(square, key=lambda n: abs(float(n @ axis)))
        middle = patch.xyz[np.argsort(patch.xyz @ normal)[len(patch.xyz) // 2]]
        surface = plane(middle, np.copysign(1.0, float(np.median(patch.normals @ normal))) * normal)
        name = f"patch {patch.primitive} flat"
        result.append(Change(name, (i,), (supported(patch, surface, patch.xyz, patch.normals),)))
    return result


def unbent(patches: Sequence[Patch]) -> list[Change]:
    """One change for every cylinder of a short arc: a plane through its points, which may bend at its edges only."""
    result: list[Change] = []
    for i, patch in enumerate(patches):
        if patch.surface.kind != "cylinder":
            continue
        mean = patch.normals.mean(axis=0)
        middle = mean / max(float(np.linalg.norm(mean)), 1e-9)
        side = np.cross(patch.surface.axis, middle)
        turned = np.arctan2(patch.normals @ side, patch.normals @ middle)
        if np.ptp(np.quantile(turned, [_WITHIN, 1 - _WITHIN])) > _BENT:
            continue
        centre = patch.xyz.mean(axis=0)
        normal = np.linalg.svd(patch.xyz - centre, full_matrices=False)[2][2]
        if abs(float(normal @ middle)) < np.cos(_BENT / 2):
            continue  # hardly wider than its points scatter
        surface = plane(centre, np.copysign(1.0, float(normal @ middle)) * normal)
        new = supported(patch, surface, patch.xyz, patch.normals)
        result.append(Change(f"patch {patch.primitive} unbent", (i,), (new,)))
    return result


@dataclass(frozen=True)
class _Profile:
    """A patch around an axis, its points in order along the profile.

    Attributes:
        patch: whose points these are.
        through, axis: (3,) a point on the axis and its unit direction.
        order: (N,) indices of the patch's points.
        points: (N, 2) distance from the axis and height; slope: (N, 2) the same of the normals.
    """

    patch: Patch
    through: Array
    axis: Array
    order: NDArray[np.intp]
    points: Array
    slope: Array

    @property
    def least(self) -> int:
        """Points of the smallest piece."""
        return max(int(_LEAST_SHARE * len(self.order)), _LEAST_POINTS)

    def piece(self, part: slice, square: float = _SQUARE) -> Patch:
        """The straight surface of some successive points."""
        index = self.order[part]
        surface = _straight(self.points[part], self.slope[part], self.through, self.axis, square)
        return supported(self.patch, surface, self.patch.xyz[index], self.patch.normals[index])


def _profile(patch: Patch, others: Sequence[Patch]) -> _Profile:
    axis, through = _axis(patch, others)
    offset = patch.xyz - through
    height = offset @ axis
    radial = offset - height[:, None] * axis
    radius = np.linalg.norm(radial, axis=1)
    slope = np.column_stack(
        [np.einsum("ij,ij->i", patch.normals, radial) / np.maximum(radius, 1e-9), patch.normals @ axis]
    )
    profile = np.column_stack([radius, height])  # (N, 2)
    order = _along(profile, slope)
    return _Profile(patch, through, axis, order, profile[order], slope[order])


def _groove(patch: Patch, others: Sequence[Patch]) -> list[Patch] | None:
    """Wall, floor and wall of a groove, or None if the patch is none."""
    profile = _profile(patch, others)
    count, least = len(profile.order), profile.least
    if count < 3 * least:
        return None
    breaks = np.unique(np.linspace(least, count - least, _BREAKS).astype(int))
    before, after = _misfits(profile.points)[breaks - 1], _misfits(profile.points[::-1])[::-1][breaks]
    between = np.full((len(breaks), len(breaks)), np.inf)
    for k, start in enumerate(breaks):
        ends = breaks >= start + least
        between[k, ends] = _misfits(profile.points[start:])[breaks[ends] - start - 1]
    total = before[:, None] + between + after
    first, second = np.unravel_index(int(np.argmin(total)), total.shape)
    if not np.sqrt(total[first, second] / count) <= _GROOVE * patch.surface.rms(patch.xyz):
        return None
    parts = [slice(0, breaks[first]), slice(breaks[first], breaks[second]), slice(breaks[second], count)]
    pieces = [profile.piece(part, _LEANING) for part in parts]
    up, down = (float(profile.slope[part, 1].mean()) for part in (parts[0], parts[2]))
    return pieces if tuple(p.surface.kind for p in pieces) == _WALLED and up * down < 0 else None


def _pieces(patch: Patch, others: Sequence[Patch]) -> tuple[Patch, Patch] | None:
    """The two straight pieces of a patch, or None if its own surface explains the profile better."""
    profile = _profile(patch, others)
    count, least = len(profile.order), profile.least
    if count < 2 * least:
        return None
    before, after = _misfits(profile.points), _misfits(profile.points[::-1])[::-1]
    at = least + int(np.argmin(before[least - 1 : count - least] + after[least : count - least + 1]))
    if np.sqrt((before[at - 1] + after[at]) / count) > _AS_WELL[patch.surface.kind] * patch.surface.rms(patch.xyz):
        return None
    found = [profile.piece(part) for part in (slice(0, at), slice(at, count))]
    middles = [profile.slope[:at].mean(axis=0), profile.slope[at:].mean(axis=0)]
    turn = np.arctan2(*middles[0]) - np.arctan2(*middles[1])
    return (found[0], found[1]) if abs(np.angle(np.exp(1j * turn))) > _LEAST_TURN else None


def _axis(patch: Patch, others: Sequence[Patch]) -> tuple[Array, Array]:
    """Unit direction (3,) of the axis and a point (3,) on it, which the points' normals meet."""
    direction = patch.surface.axis
    tree = cKDTree(patch.xyz)
    beside = [
        p for p in others
        if p.surface.kind == "plane" and abs(p.surface.axis @ direction) > _ALONG and touch(p, patch, tree=tree)
    ]  # fmt: skip
    if beside:
        best = max(beside, key=lambda p: len(p.xyz)).surface.axis
        direction = best if best @ direction > 0 else -best
    flat = np.eye(3) - np.outer(direction, direction)
    across = np.cross(direction, patch.normals)  # (N, 3) an axis through c meets the normal at x: (x - c) . across = 0
    design = across @ flat
    moved = np.linalg.lstsq(design, np.einsum("ij,ij->i", patch.xyz - patch.surface.origin, across), rcond=1e-6)[0]
    return direction, patch.surface.origin + flat @ moved


def _along(profile: Array, slope: Array) -> NDArray[np.intp]:
    """Order of points along a profile that bends one way: across the mean normal."""
    mean = slope.mean(axis=0)
    return np.argsort(profile @ np.array([-mean[1], mean[0]]), kind="stable")


def _misfits(profile: Array) -> Array:
    """(N,) squared residuals of the best line through the first k + 1 points, for every k."""
    x, y = (profile - profile.mean(axis=0)).T
    count = np.arange(1, len(x) + 1)
    sx, sy = np.cumsum(x), np.cumsum(y)
    xx = np.cumsum(x * x) - sx * sx / count
    yy = np.cumsum(y * y) - sy * sy / count
    xy = np.cumsum(x * y) - sx * sy / count
    return np.asarray(np.maximum((xx + yy) / 2 - np.hypot((xx - yy) / 2, xy), 0))


def _straight(profile: Array, slope: Array, through: Array, axis: Array, square: float) -> Surface:
    """The plane, cylinder or cone whose profile is the best line through points (N, 2) with normals (N, 2)."""
    middle = profile.mean(axis=0)
    along = np.linalg.svd(profile - middle, full_matrices=False)[2][0]
    normal = np.array([-along[1], along[0]])
    normal *= np.sign(normal @ slope.mean(axis=0)) or 1.0
    center = through + middle[1] * axis
    tilt = np.arcsin(min(abs(normal[1]), 1.0))  # 0 for a cylinder
    if tilt > np.pi / 2 - square:
        return plane(center, np.sign(normal[1]) * axis)
    flipped = bool(normal[0] < 0)
    if tilt < square:
        return cylinder(center, axis, middle[0], flipped)
    widens = axis if (along[0] * along[1] > 0) else -axis
    return cone(center, widens, middle[0], tilt, flipped)
