"""Facets taken for one fillet: an inner fillet's hull is cut into planes, and its points may keep two of them.

No single surface explains two planes that meet at half a right angle as well as they do themselves, but what touches
the faces on both sides has one free parameter; the images decide.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from scipy.optimize import minimize_scalar

from brepgaussian.brep.fillets import fillet_between
from brepgaussian.brep.patches import Patch, neighbours, touch
from brepgaussian.brep.simplify import Change, explains, fitted_to, joined
from brepgaussian.geometry.rolling import rolling
from brepgaussian.geometry.surfaces import Surface, unit

_LEAST_TURN = np.cos(np.radians(20.0))  # between two facets of a fillet: those of less are merged as one surface
_MOST_TURN = np.cos(np.radians(80.0))  # and of more, since a fillet of a square edge turns by 90 degrees in all
_LEANS = np.cos(np.radians(10.0))  # a lone facet against the faces beside it: its points may lie far from half way
_SQUARE_ENOUGH = np.sin(np.radians(30.0))  # between the faces beside a lone facet,
_ASKEW = np.sin(np.radians(10.0))  # and of the facet's normal against their edge
_RADII = (np.log(0.5), np.log(20.0))  # of a fillet, over the mean height of its points above the farther face
_KINDS = ("cylinder", "torus")


def facets_as_fillets(patches: Sequence[Patch], noise: float, rng: np.random.Generator) -> Iterator[Change]:
    """Neighbours that one fillet between the faces on their other sides explains to within some noises.

    Args:
        patches: of the present solid.
        noise: of the points.
        rng: of the fits that the fillets start from.
    """
    for i, j in combinations(range(len(patches)), 2):
        pair = [patches[i], patches[j]]
        if not _MOST_TURN < _turn(pair[0], pair[1]) < _LEAST_TURN or not touch(pair[0], pair[1]):
            continue
        around = sorted({*neighbours(i, patches), *neighbours(j, patches)} - {i, j})
        for kind in _KINDS:
            start = fitted_to(kind, pair, noise, rng)
            made = None if start is None else fillet_between(joined(start, pair), [patches[k] for k in around])
            if made is not None and all(explains(made, p, noise) for p in pair):
                name = f"patches {pair[0].primitive} and {pair[1].primitive} as one fillet ({kind})"
                yield Change(name, (i, j), (joined(made, pair),), smooth=True)
                break


def lone_facets(patches: Sequence[Patch]) -> list[Change]:
    """Planes across the edge of two others as fillets that touch both, for a solid that the images refuse.

    A fillet whose hull was cut to a strip has the points of a chamfer, which fit no cylinder; one that touches both
    faces has one free parameter, and the images tell it from a chamfer.
    """
    found = []
    for i, patch in enumerate(patches):
        if patch.surface.kind != "plane":
            continue
        sides = [patches[k] for k in neighbours(i, patches, "plane")]
        for pair in combinations((s for s in sides if _MOST_TURN < _turn(patch, s) < _LEANS), 2):
            made = _across(patch, pair[0].surface, pair[1].surface)
            if made is not None:
                name = f"patch {patch.primitive} as a fillet of {pair[0].primitive} and {pair[1].primitive}"
                found.append(Change(name, (i,), (joined(made, [patch]),), smooth=True))
    return found


def _across(patch: Patch, first: Surface, second: Surface) -> Surface | None:
    """The cylinder that touches two planes and is nearest to the points of a third across their edge, if it is one."""
    along = np.cross(first.axis, second.axis)
    if np.linalg.norm(along) < _SQUARE_ENOUGH or abs(float(unit(along) @ patch.surface.axis)) > _ASKEW:
        return None
    heights = [float(s.signed_distance(patch.xyz).mean()) for s in (first, second)]
    if heights[0] * heights[1] <= 0:  # before one and behind the other: it goes on beyond their edge
        return None
    side, size = -np.sign(heights[0]), max(np.abs(heights))

    def misfit(scale: float) -> float:
        return float(rolling(first, second, side * size * np.exp(scale)).rms(patch.xyz))

    best = minimize_scalar(misfit, bounds=_RADII, method="bounded")
    return rolling(first, second, side * size * np.exp(float(best.x)))


def _turn(first: Patch, second: Patch) -> float:
    """Cosine of the angle by which one patch's points are turned against the surface of the other."""
    return float(np.median(np.einsum("ij,ij->i", first.surface.normals(second.xyz), second.normals)))
