"""Primitives that are one surface twice, or hardly a surface at all: what assembly cannot use as it is.

Two nearly equal surfaces cut a sliver between them; a few points on a bad fit cut the solid anywhere. Where
the fits are good nothing here applies.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.patches import Patch, touch

Array = NDArray[np.float64]

_PLANE_SIGMAS = 2.5  # planes closer than this many noises are one: two steps of a stair stay two
_CURVED_SIGMAS = 4.0  # curved surfaces bend away soon if they differ
_QUANTILE = 0.9  # of one patch's points that must lie on the other's surface
_LEAST_COSINE = 0.97  # between their normals, 14 degrees, in the mean
_POOR_SHARE = 0.004  # of all points: fewer on a poor fit are left out
_POOR_SIGMAS = 1.8


def tidy(patches: Sequence[Patch], least: float, all_of_them: bool = False) -> list[Patch]:
    """Join patches of one surface (the better surface stays) and leave out poor small ones.

    Args:
        patches: to be tidied.
        least: believable noise, unit frame: beside patches without any, a tiny residual is not poor.
        all_of_them: leave none out: beside walls that points were put on, small faces that they were not look poor.
    """
    if not patches:
        return []
    noise = max(float(np.median([p.sigma for p in patches])), least)
    total = sum(len(p.xyz) for p in patches)
    few, poor = _POOR_SHARE * total, _POOR_SIGMAS * noise
    result = [p for p in patches if all_of_them or len(p.xyz) >= few or p.sigma <= poor]
    result.sort(key=lambda p: -len(p.xyz))
    merged = True
    while merged:
        merged = False
        for i, first in enumerate(result):
            for j in range(i + 1, len(result)):
                joint = _joint(first, result[j], noise)
                if joint is not None:
                    result[i] = joint
                    del result[j]
                    merged = True
                    break
            if merged:
                break
    return sorted(result, key=lambda p: p.primitive)


def _joint(first: Patch, second: Patch, noise: float) -> Patch | None:
    """Both as one patch if one of their surfaces explains both."""
    if first.surface.kind != second.surface.kind:
        return None
    factor = _PLANE_SIGMAS if first.surface.kind == "plane" else _CURVED_SIGMAS
    limit = factor * max(noise, min(first.sigma, second.sigma))
    best, best_error = None, limit
    for a, b in ((first, second), (second, first)):
        error = float(np.quantile(np.abs(a.surface.signed_distance(b.xyz)), _QUANTILE))
        cosine = float(np.mean(np.einsum("ij,ij->i", a.surface.normals(b.xyz), b.normals)))
        if error < best_error and cosine > _LEAST_COSINE and _touch(a, b):
            best, best_error = a, error
    if best is None:
        return None
    xyz, normals = np.concatenate([first.xyz, second.xyz]), np.concatenate([first.normals, second.normals])
    sigma = best.surface.rms(xyz)
    primitive = min(first.primitive, second.primitive)
    reach = max(first.reach, second.reach)
    return replace(best, xyz=xyz, normals=normals, sigma=sigma, primitive=primitive, reach=reach)


def _touch(first: Patch, second: Patch) -> bool:
    """Whether two patches overlap or lie side by side; planes apart are two faces, however level."""
    return first.surface.kind != "plane" or touch(second, first, 2)
