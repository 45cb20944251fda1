"""Facets taken for one fillet: an inner fillet's hull is cut into planes, and its points may keep two of them.

No single surface explains two planes that meet at half a right angle as well as they do themselves, but what touches
the faces on both sides has one free parameter; the images decide.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from brepgaussian.brep.fillets import fillet_between
from brepgaussian.brep.patches import Patch, neighbours, touch
from brepgaussian.brep.simplify import Change, explains, fitted_to, joined

_LEAST_TURN = np.cos(np.radians(20.0))  # between two facets of a fillet: those of less are merged as one surface
_MOST_TURN = np.cos(np.radians(80.0))  # and of more, since a fillet of a square edge turns by 90 degrees in all
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


def _turn(first: Patch, second: Patch) -> float:
    """Cosine of the angle by which one patch's points are turned against the surface of the other."""
    return float(np.median(np.einsum("ij,ij->i", first.surface.normals(second.xyz), second.normals)))
