"""Primitives drawn to the curves that the images show, and the points after them.

Trained surfels lie off by several thousandths, smoothly, so a primitive of a thousand of them is no better;
a snapped curve is. Points move with their primitive, so what they scatter about it stays as it was.
"""

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.fit_refine import refine
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.points.curves import Curve
from brepgaussian.points.graph import Index

Array = NDArray[np.float64]
_NODE_SIGMA = 0.004  # unit frame; smooth error of surfels
_TOLD_SIGMA = 0.0008  # unit frame; a fifth of a pixel at 800 px, by which rims are off (.0003-.001 measured)
_NODES_WORTH = 30.0  # independent points that the nodes of a patch stand for, as their errors are correlated
_CURVE_SIGMA = 0.0012  # unit frame; a third of a pixel at 800 px
_SHARP_PX = 0.3  # by which views differ about an edge that is where the curve is: .2-.3; about others .5-1.5
_CURVE_SHARE = 0.25  # of a curve's points that are independent
_OUTLIER = 0.008  # unit frame; a curve point farther from the primitive hardly counts
_ROUNDS = 3
MOST = 0.01  # unit frame; a primitive that leaves its points by more was drawn to a wrong curve,
FEWER = 0.005  # by so much perhaps: surfels of outer faces lie within .002, those of narrow grooves are off by .008
_NEARLY_ALL = 0.9  # of a patch's nodes
_LEAST_CURVE = 6  # points


def anchor_surfaces(
    surfaces: list[Surface],
    xyz: Array,
    labels: Index,
    curves: list[Curve],
    told: NDArray[np.bool_] | None = None,
    most: float = MOST,
) -> list[Surface]:
    """Each primitive refitted to its nodes and, with much more weight, to the curves along its borders.

    Args:
        surfaces: primitive of each label.
        xyz: (N, 3) nodes; labels: (N,) their labels.
        curves: snapped to the images.
        told: (N,) nodes that lie on a wall whose rim the views have told; they lie better than others.
        most: by which a primitive may leave its nodes (all but a tenth of them).
    """
    sigmas_of = np.where(told, _TOLD_SIGMA, _NODE_SIGMA) if told is not None else np.full(len(xyz), _NODE_SIGMA)
    result = []
    for k, surface in enumerate(surfaces):
        members = xyz[labels == k]
        rims = [c for c in curves if k in c.pair]
        if not len(members) or sum(len(c.points) for c in rims) < _LEAST_CURVE:
            result.append(surface)
            continue
        points = np.concatenate([members, *(c.points for c in rims)])
        sigmas = _CURVE_SIGMA * np.maximum(1, (np.array([c.scatter for c in rims]) / _SHARP_PX) ** 2)
        sigma = np.repeat(sigmas, [len(c.points) for c in rims])
        base = np.concatenate(
            [
                min(_NODES_WORTH / len(members), 1.0) / sigmas_of[labels == k] ** 2,
                _CURVE_SHARE / sigma**2,
            ]
        )
        found = surface
        for _ in range(_ROUNDS):
            distance = np.abs(found.signed_distance(points))
            found = refine(found, points, base / (1 + (distance / _OUTLIER) ** 2) ** 2)
        same_way = (found.normals(members) * surface.normals(members)).sum(1) > 0
        result.append(found if _moved(surface, found, members) < most and same_way.mean() > _NEARLY_ALL else surface)
    return result


def drawn_far(before: list[Surface], after: list[Surface], xyz: Array, labels: Index) -> bool:
    """Whether `anchor_surfaces` would have left a primitive as it was, if it could move by `FEWER` at most."""
    pairs = enumerate(zip(before, after, strict=True))
    return any(old is not new and _moved(old, new, xyz[labels == k]) >= FEWER for k, (old, new) in pairs)


def _moved(before: Surface, after: Surface, members: Array) -> float:
    """By how much a primitive moved under nearly all of its nodes (M, 3)."""
    moved = np.abs(after.signed_distance(members) - before.signed_distance(members))
    return float(np.quantile(moved, _NEARLY_ALL))


def follow(xyz: Array, labels: Index, before: list[Surface], after: list[Surface]) -> Array:
    """(N, 3) points shifted by as much as their primitive moved under them."""
    moved = xyz.copy()
    for k, (old, new) in enumerate(zip(before, after, strict=True)):
        here = np.flatnonzero(labels == k)
        if old is new or not len(here):
            continue
        rise = np.clip(old.signed_distance(xyz[here]) - new.signed_distance(xyz[here]), -MOST, MOST)
        moved[here] += rise[:, None] * new.normals(xyz[here])
    return moved
