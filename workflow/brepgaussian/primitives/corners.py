"""Corners of four planes: chamfers that meet around a plate, the feet of a pyramid.

Three planes always have a common point, the fourth only by design. Fitted one by one it passes beside that point by
an error of the points, and a tiny edge stands where the part has a corner. The directions are known by now; four of
them depend on each other linearly, and so do the offsets of planes through one point. Hence the smallest shifts that
make all such corners hold follow from one linear system.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.artifacts.primitives import Relation
from brepgaussian.log import get_logger
from brepgaussian.primitives.patches import Cloud, Noise, Patch, adjacent

Array = NDArray[np.float64]
log = get_logger("primitives")

_BESIDE = 8.0  # spacings, and noises, from a corner to points of each of its planes: few lie in a narrow wedge
_MISSED = 1.5  # noises by which the fourth plane may pass beside the point of three: smooth errors are as large
_LEAST_VOLUME = 0.05  # spanned by three normals: flatter ones have no certain point
_HOLDS = 1e-6  # noises by which a corner's equation may be left
_FIXED = 1e-12  # weight of the shift of a plane that a relation holds where it is

Corner = tuple[int, int, int, int]


def meet(
    patches: Sequence[Patch], relations: Sequence[Relation], cloud: Cloud, noise: Noise
) -> tuple[list[Patch], list[Corner]]:
    """The patches with planes shifted such that four that nearly have a common corner have one, and these corners.

    Planes that touch a curved patch stay where they are.
    """
    corners = _corners(patches, cloud, noise)
    held = {i for r in relations if r.kind in ("tangent", "bend") for i in (r.first, r.second)}
    while corners:
        rows, missed = _equations(patches, corners)
        loose = np.array([_FIXED if i in held else 1 / max(len(p.members), 1) for i, p in enumerate(patches)])
        shift = -loose * (rows.T @ np.linalg.lstsq((rows * loose) @ rows.T, missed, rcond=1e-9)[0])
        left = np.abs(missed + rows @ shift)
        if left.max() < _HOLDS * noise.distance and np.abs(shift).max() <= _MISSED * noise.distance:
            log.info("corners of four planes: %d", len(corners))
            return [_shifted(p, float(s), cloud) for p, s in zip(patches, shift, strict=True)], corners
        del corners[int(np.argmax(np.abs(missed)))]
    return list(patches), []


def _corners(patches: Sequence[Patch], cloud: Cloud, noise: Noise) -> list[Corner]:
    """Fours of planes that pass near one point beside which all of them have points."""
    flat = [i for i, p in enumerate(patches) if p.surface.kind == "plane"]
    table = adjacent(patches, cloud)
    trees = {i: cKDTree(cloud.xyz[patches[i].members]) for i in flat}
    beside = _BESIDE * (cloud.spacing + noise.distance)

    def reaches(index: int, point: Array) -> bool:
        return bool(trees[index].query(point, distance_upper_bound=beside)[0] <= beside)

    found: set[Corner] = set()
    for three in combinations(flat, 3):
        if sum(table[a, b] for a, b in combinations(three, 2)) < 2:
            continue
        normals = np.array([patches[i].surface.axis for i in three])
        if abs(np.linalg.det(normals)) < _LEAST_VOLUME:
            continue
        point = np.linalg.solve(normals, [patches[i].surface.origin @ n for i, n in zip(three, normals, strict=True)])
        if not all(reaches(i, point) for i in three):
            continue
        for fourth in flat:
            off = abs(float(patches[fourth].surface.signed_distance(point[None])[0]))
            if fourth in three or off > _MISSED * noise.distance:
                continue
            if table[fourth, list(three)].any() and reaches(fourth, point):
                a, b, c, d = sorted((*three, fourth))
                found.add((a, b, c, d))
    return sorted(found)


def _equations(patches: Sequence[Patch], corners: Sequence[Corner]) -> tuple[Array, Array]:
    """(C, P) how the planes' offsets enter each corner's equation, and (C,) by how much it does not hold."""
    rows, missed = np.zeros((len(corners), len(patches))), np.zeros(len(corners))
    for k, corner in enumerate(corners):
        surfaces = [patches[i].surface for i in corner]
        normals = np.array([s.axis for s in surfaces])
        weights = np.linalg.svd(normals.T)[2][-1]  # sum of weights times normals is zero
        rows[k, list(corner)] = weights
        missed[k] = sum(w * float(s.origin @ s.axis) for w, s in zip(weights, surfaces, strict=True))
    return rows, missed


def _shifted(patch: Patch, shift: float, cloud: Cloud) -> Patch:
    surface = patch.surface
    return patch if shift == 0 else patch.on(replace(surface, origin=surface.origin + shift * surface.axis), cloud)
