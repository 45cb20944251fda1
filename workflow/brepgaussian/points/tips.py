"""Where a chamfer gets narrower than the points lie apart, its two neighbours seem to meet in an edge of their own.

There the chamfer's primitive says better where its curves end: no edge of the two others lies beyond it.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.geometry.surfaces import Surface
from brepgaussian.points.curves import Curve, extended
from brepgaussian.points.graph import Index

Array = NDArray[np.float64]

_INSIDE = 0.25  # spacings by which a curve beyond the third patch may seem to lie within it, and points beyond it
_MOST_BEYOND = 3.0  # spacings that the curve lies beyond it: where the third patch is wider, it has points
_BESIDE = 2.5  # spacings from the curve to the points that stand for it
_STRAY = 0.1  # of them
_MEETING = 3.0  # spacings from a curve's end to those of the third patch's curves


def without_tips(
    curves: list[Curve], xyz: Array, labels: Index, surfaces: list[Surface], spacing: float, step: float
) -> list[Curve]:
    """The curves without those beyond a third patch, whose own curves go on there until they meet.

    Arguments are those of `find_curves`.
    """
    sides = [_sides(xyz, labels, surface, len(surfaces)) for surface in surfaces]
    result = list(curves)
    for tip in (curve for curve in curves if not curve.closed):
        near = xyz[np.isin(labels, tip.pair)]
        near = near[cKDTree(tip.points).query(near)[0] < _BESIDE * spacing]
        ended: list[int] = []
        for k, surface in enumerate(surfaces):
            if k not in tip.pair and _is_beyond(tip, near, surface, sides[k], spacing):
                found = _beside(tip, k, result, spacing)
                ended += found if {p for i in found for p in result[i].pair} >= set(tip.pair) else []
        for i in dict.fromkeys(ended):
            (other,) = set(tip.pair) - set(result[i].pair)
            result[i] = _to_the_tip(result[i], tip, surfaces, surfaces[other], spacing, step)
        if ended:
            result = [curve for curve in result if curve is not tip]
    return result


def _sides(xyz: Array, labels: Index, surface: Surface, count: int) -> Array:
    """(K,) on which side of a surface the points of each patch lie: the median of their distances, 0 = no points."""
    distance = surface.signed_distance(xyz)
    return np.array([np.median(distance[labels == k]) if (labels == k).any() else 0.0 for k in range(count)])


def _is_beyond(tip: Curve, near: Array, surface: Surface, sides: Array, spacing: float) -> bool:
    """Whether a curve lies a little beyond a third surface, and no points do.

    Args:
        tip: the curve; near: (M, 3) points of its two patches beside it.
        surface: of the third patch; sides: (K,) on which side of it those of each patch lie.
    """
    one, other = sides[list(tip.pair)]
    if one * other <= 0:
        return False
    beyond = -np.sign(one) * surface.signed_distance(tip.points)
    if beyond.min() < -_INSIDE * spacing or beyond.max() > _MOST_BEYOND * spacing:
        return False
    points = -np.sign(one) * surface.signed_distance(near)
    return bool((points > _INSIDE * spacing).mean() < _STRAY) if len(near) else False


def _beside(tip: Curve, k: int, curves: list[Curve], spacing: float) -> list[int]:
    """Indices of the curves of a third patch with either of a curve's own that end beside it."""
    tree = cKDTree(tip.points)
    return [
        i
        for i, curve in enumerate(curves)
        if k in curve.pair
        and len(set(curve.pair) & set(tip.pair)) == 1
        and not curve.closed
        and tree.query(curve.points[[0, -1]])[0].min() < _MEETING * spacing
    ]


def _to_the_tip(
    curve: Curve, tip: Curve, surfaces: list[Surface], other: Surface, spacing: float, step: float
) -> Curve:
    """A curve carried on along a tip until it meets, or comes nearest to, the other patch there."""
    tree = cKDTree(tip.points)
    ends = tree.query(curve.points[[0, -1]])[0]
    path = curve.points if ends[1] <= ends[0] else curve.points[::-1]
    length = float(np.linalg.norm(np.diff(tip.points, axis=0), axis=1).sum()) + _MEETING * spacing
    tail = extended(path, surfaces[curve.pair[0]], surfaces[curve.pair[1]], length, step)
    away = np.flatnonzero(tree.query(tail)[0] >= _MEETING * spacing)
    tail = tail[: away[0]] if len(away) else tail  # a curve may leave the tip, or lead away from it
    if not len(tail):
        return curve
    off = np.abs(other.signed_distance(tail))
    value = other.signed_distance(np.concatenate([path[-1:], tail]))
    crossed = np.flatnonzero(value[:-1] * value[1:] <= 0)
    last = int(crossed[0]) if len(crossed) else int(np.argmin(off))
    return replace(curve, points=np.concatenate([path, tail[: last + 1]]))
