"""Low round walls, of pads and of rims, whose points are too few and too worn to tell that they are one.

A wall that is hardly higher than points lie apart has no clean normals: silhouettes leave a skirt around its foot, and
labels make strips of it, flat ones, cones, cylinders of any radius. Between two parallel faces, all strips that lie on
one circle are the wall of a round step.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.patches import Patch
from brepgaussian.brep.simplify import Change, joined
from brepgaussian.geometry.circles import circle_of_most
from brepgaussian.geometry.surfaces import Surface, cylinder

Array = NDArray[np.float64]

_PARALLEL = np.cos(np.radians(3.0))  # between the two faces
_LEVEL = np.cos(np.radians(20.0))  # a flat strip that leans less from them is a piece of one
_LOW = 4.0  # reaches between the faces at most; of higher walls points tell more
_WITHIN = 0.5  # reaches past either face that a strip's points may lie
_MOST = 0.9  # of a strip's points that lie there
_SMALL = 0.04  # of all points that a strip has at most
_AROUND = 0.6  # of the circle's sectors that have points of strips
_SECTORS = 36
_OFF = 0.75  # reaches from the circle to half of the points: a skirt is a voxel or two wide
_LEAST = 3.0  # reaches that its radius has at least
_KNOWN = 0.7  # of the strips' points that one cylinder has: the wall is known


def low_walls(patches: Sequence[Patch]) -> list[Change]:
    """The strips between two parallel faces as one cylinder, once for every pair of faces with such a wall."""
    changes, taken = [], set[int]()
    planes = [i for i, p in enumerate(patches) if p.surface.kind == "plane"]
    for pair in combinations(planes, 2):
        strips = tuple(i for i in _strips(pair, patches) if i not in taken)
        some = [patches[i] for i in strips]
        wall = _wall(patches[pair[0]].surface.axis, some) if len(some) > 1 else None
        if wall is not None:
            taken |= set(strips)
            names = ", ".join(str(p.primitive) for p in some)
            changes.append(Change(f"patches {names} as one low wall", strips, (joined(wall, some),)))
    return changes


def _strips(pair: tuple[int, int], patches: Sequence[Patch]) -> Iterator[int]:
    """Small patches between two faces that lie a little above each other and look the same way."""
    first, second = (patches[i] for i in pair)
    normal, reach = first.surface.axis, max(first.reach, second.reach)
    heights = sorted(float(p.surface.origin @ normal) for p in (first, second))
    if float(normal @ second.surface.axis) < _PARALLEL or heights[1] - heights[0] > _LOW * reach:
        return
    low, high = heights[0] - _WITHIN * reach, heights[1] + _WITHIN * reach
    most = _SMALL * sum(len(p.xyz) for p in patches)
    for i, patch in enumerate(patches):
        level = patch.surface.kind == "plane" and abs(float(patch.surface.axis @ normal)) > _LEVEL
        if i in pair or level or patch.cap or len(patch.xyz) > most:
            continue
        height = patch.xyz @ normal
        if np.mean((height > low) & (height < high)) >= _MOST:
            yield i


def _wall(normal: Array, strips: Sequence[Patch]) -> Surface | None:
    """The cylinder along a direction that strips lie on, if they go around most of it, and none of them is it."""
    xyz = np.concatenate([p.xyz for p in strips])
    reach = max(p.reach for p in strips)
    basis = np.linalg.svd(normal[None])[2][1:]  # (2, 3) across the wall
    flat = xyz @ basis.T
    middle, radius = circle_of_most(flat, reach)
    off = np.abs(np.linalg.norm(flat - middle, axis=1) - radius)
    kept = off <= reach
    out = (flat - middle) / np.maximum(np.linalg.norm(flat - middle, axis=1), 1e-12)[:, None]
    sectors = np.unique(np.floor(np.arctan2(out[kept, 1], out[kept, 0]) / (2 * np.pi) * _SECTORS))
    around = len(sectors) >= _AROUND * _SECTORS
    if radius < _LEAST * reach or not around or np.median(off) > _OFF * reach or _is_known(normal, strips):
        return None
    facing = np.einsum("ij,ij->i", np.concatenate([p.normals for p in strips]) @ basis.T, out)
    height = float(np.median(xyz @ normal))
    return cylinder(middle @ basis + height * normal, normal, radius, bool(np.median(facing) < 0))


def _is_known(normal: Array, strips: Sequence[Patch]) -> bool:
    """Whether most of the points are of one cylinder that stands square on the faces."""
    total = sum(len(p.xyz) for p in strips)
    upright = [p for p in strips if p.surface.kind == "cylinder" and abs(float(p.surface.axis @ normal)) > _PARALLEL]
    return any(len(p.xyz) > _KNOWN * total for p in upright)
