"""Patches that may be the skin which the reconstruction leaves over an inner edge, or beside a fillet in one.

No silhouette shows an inner edge, and few images show the walls beside it undisturbed: there the reconstructed surface
cuts the corner. Labels find patches in that skin, with surfaces like chamfers and fillets. Its points lie in the air
before both walls, with normals between theirs. So do those of a real fillet or chamfer: the images decide.
Where a wall runs into an inner fillet, the surface cuts across as well: a ramp, nearly parallel to both.
"""

from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.brep.patches import Patch, touch

Array = NDArray[np.float64]

_SHARE = 0.8  # of a skin's points that lie before both walls
_POOR = 1.5  # noises: a well-fitting patch that is not small is a face
_SMALL, _LARGEST = 0.01, 0.04  # of all points: a patch that fits well but is doubtful, and the largest skin
_SLACK = 3.0  # noises behind a wall that a point before it may seem to lie
_BETWEEN = np.cos(np.radians(80.0))  # a skin's normals (median) are nearer than this to those of both walls,
_ASIDE = np.sin(np.radians(25.0))  # and this near to the plane of the two
_LEAST_CORNER = np.cos(np.radians(30.0))  # between the walls' normals
_ROUNDED = 0.012  # unit frame, two voxels of a hull: skins like fillets lie up to .007 before their walls, fillets of
# milled pockets .020 and more. Flat skins may be as deep as a hull bulges.
_DEEPEST = 0.9  # quantile
_RAMP = np.cos(np.radians(20.0))  # a ramp's normals (median) are nearer than this to those of both sides
_TINY = 1e-12


def skins(patches: Sequence[Patch]) -> tuple[int, ...]:
    """Indices of patches that may be skins over inner edges of the others."""
    return _between(patches, _doubtful, _hides)


def ramps(patches: Sequence[Patch]) -> tuple[int, ...]:
    """Indices of patches that may be ramps between others that run into one another smoothly."""
    return _between(patches, lambda patch, _, total: len(patch.xyz) < _LARGEST * total, _levels)


def _between(
    patches: Sequence[Patch],
    may_be: Callable[[Patch, float, int], bool],
    lies: Callable[[Patch, Patch, Patch, float], bool],
) -> tuple[int, ...]:
    """Indices of patches that may be false and lie so between two larger ones beside them, small ones first."""
    if not patches:
        return ()
    noise = float(np.median(np.repeat([p.sigma for p in patches], [len(p.xyz) for p in patches])))
    total = sum(len(p.xyz) for p in patches)
    trees = [cKDTree(p.xyz) for p in patches]
    found: list[int] = []
    for i in sorted(range(len(patches)), key=lambda k: (len(patches[k].xyz), k)):
        patch = patches[i]
        larger = (j for j, p in enumerate(patches) if j not in found and j != i and len(p.xyz) >= len(patch.xyz))
        walls = [patches[j] for j in larger if touch(patch, patches[j], tree=trees[j])]
        if may_be(patch, noise, total) and any(lies(patch, *pair, noise) for pair in combinations(walls, 2)):
            found.append(i)
    return tuple(sorted(found))


def _doubtful(patch: Patch, noise: float, total: int) -> bool:
    share = len(patch.xyz) / total
    return share < _SMALL or (share < _LARGEST and patch.sigma > _POOR * noise)


def _hides(skin: Patch, first: Patch, second: Patch, noise: float) -> bool:
    """Whether a patch hides an inner edge between two walls."""
    pair = first, second
    if not _in_air(skin, pair, noise) or (skin.surface.kind == "cylinder" and _depth(skin, pair) > _ROUNDED):
        return False
    beside = [wall.surface.normals(skin.xyz) for wall in pair]
    near = [float(np.median(_cosine(n, skin.normals))) for n in beside]
    across = np.cross(beside[0], beside[1])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), _TINY)
    aside = float(np.median(np.abs(_cosine(across, skin.normals))))
    return min(near) > _BETWEEN and aside < _ASIDE and float(np.median(_cosine(beside[0], beside[1]))) < _LEAST_CORNER


def _levels(ramp: Patch, first: Patch, second: Patch, noise: float) -> bool:
    """Whether a patch lies before two others that are nearly parallel to it where it is, one of them curved."""
    pair = first, second
    if all(wall.surface.kind == "plane" for wall in pair) or not _in_air(ramp, pair, noise):
        return False
    return all(float(np.median(_cosine(wall.surface.normals(ramp.xyz), ramp.normals))) > _RAMP for wall in pair)


def _in_air(patch: Patch, walls: tuple[Patch, Patch], noise: float) -> bool:
    """Whether a patch lies before both of two walls, but for their noise."""
    slack = _SLACK * max(noise, *(wall.sigma for wall in walls))
    before = [wall.surface.signed_distance(patch.xyz) > -slack for wall in walls]
    return bool(np.mean(before[0] & before[1]) >= _SHARE)


def _depth(skin: Patch, walls: tuple[Patch, Patch]) -> float:
    """How far a patch lies before the nearer of two walls where it is farthest from their edge."""
    away = np.minimum(*(wall.surface.signed_distance(skin.xyz) for wall in walls))
    return float(np.quantile(away, _DEEPEST))


def _cosine(first: Array, second: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->i", first, second))
