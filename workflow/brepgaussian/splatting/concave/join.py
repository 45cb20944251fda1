"""Two openings of one hole.

A hole too long to be seen through shows the same outline on both sides, and no floor. A rim that is as bright as the
face around it may hide on one side, not on both.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.concave.prism import Prism, signed_outline
from brepgaussian.splatting.concave.scene import Scene

Array = NDArray[np.float64]
Lidded = tuple[Prism, Array]

_OPPOSITE = 0.999  # cosine of 2.5 degrees
_SAME_AREA = 1.5  # ratio of two outlines of one hole
_SAME_RIM = 1.2  # the same, of a rim and a straight hole: throats are narrower by more
_MOST_TRUE_ERROR = 0.1  # of the rays contradict a hole that goes through: true ones have .02-.06
_LEANING = 0.9  # cosine of 26 degrees
_SAME_WAY = 0.99  # cosine of 8 degrees: between a hole's axis and the direction that an oblique mouth tells
_STEEPEST = 0.5  # cosine of 60 degrees: between a hole's axis and the normal of an oblique mouth
_BEYOND = 3.0  # unit frame: clear of the object
_FAR_SIDE = 0.25  # quantile of what rays hit from there: those through an open middle hit the near side
_UPWARDS = 0.2  # cosine: of what a hull leaves across a wide mouth, as skin
_MOSTLY_GONE = 0.5  # of an opening: its border is the pocket's walls and floor
_SAME_MOUTH = 0.8  # of a mouth lies in the other hole


def joined(prisms: Sequence[Prism], tolerance: float) -> list[Prism]:
    """The same concavities, but two that face each other are one hole.

    If both are blind, but tell no floor, it goes through. If both go through, it reaches from one to the other, and if
    their widths differ, the narrower is the hole: the other's outline is that of its chamfer. If only one of them is
    countersunk, and the other goes straight down as wide as that one's rim, neither is.

    Args:
        prisms: concavities of one hull.
        tolerance: distance by which the axes and walls of one hole may seem to differ.
    """
    left = list(prisms)
    for i in range(len(left)):
        for j in range(i + 1, len(left)):
            if not face_each_other(left[i], left[j], tolerance):
                continue
            narrow, wide = sorted((i, j), key=lambda k: throat(left[k]))
            distance = distance_between(left[i], left[j])
            if left[i].endless and left[j].endless and left[wide].area < _SAME_AREA * left[narrow].area:
                left[narrow] = replace(left[narrow], depth=distance, through=True)
                left[wide] = replace(left[wide], depth=min(left[wide].depth, distance))
            elif left[i].through and left[j].through:
                if _is_straight_after_all(left[narrow], left[wide]):
                    left[narrow] = replace(left[narrow], draft=0.0, sink=np.inf)
                if left[narrow].depth < distance:
                    left[narrow] = replace(left[narrow], depth=distance)
                wider = throat(left[wide]) - throat(left[narrow])
                if wider > tolerance:
                    left[wide] = _rim_of(left[wide], wider)
    return left


def _is_straight_after_all(sunk: Prism, other: Prism) -> bool:
    """Whether a countersunk mouth is none, by what its hole's other mouth tells: near rims, light looks like that."""
    if not sunk.rim or other.rim or other.error > _MOST_TRUE_ERROR:
        return False
    return bool(max(sunk.area, other.area) <= _SAME_RIM * min(sunk.area, other.area))


def square_ends(found: Sequence[Prism], tolerance: float) -> list[Prism]:
    """The same concavities, but a hole with one oblique mouth reaches from the square one to that.

    Its direction is told by a degree or two from an oblique mouth, and exactly by the plane of a square one.

    Args:
        found: concavities that were found together in one hull.
        tolerance: distance by which the axes of one hole may seem to differ.
    """
    left = dict(enumerate(found))
    for i, oblique in enumerate(found):
        ends = [j for j, square in left.items() if j != i and _is_other_end(square, oblique, tolerance)]
        if ends:
            square = left[ends[0]]
            cells = oblique.lattice.centers()[oblique.outline]
            depth = float((square.lattice.offset - cells @ square.lattice.normal).max())
            left[ends[0]] = replace(square, depth=max(depth, square.depth), through=True, endless=False)
            del left[i]
    return list(left.values())


def _is_other_end(square: Prism, oblique: Prism, tolerance: float) -> bool:
    """Whether a concavity square to its plane, without a floor, may come out at the mouth of one that leans."""
    lattice, normal = oblique.lattice, square.lattice.normal
    if not _has_no_floor(square) or not _STEEPEST < -float(lattice.normal @ normal) < _OPPOSITE:
        return False
    way = oblique.tilt[0] * lattice.first + oblique.tilt[1] * lattice.second - lattice.normal
    if any(oblique.tilt) and way @ normal < _SAME_WAY * np.linalg.norm(way):
        return False
    across = oblique.area * abs(float(lattice.normal @ normal))
    away = oblique.middle - square.middle
    aside = away - (away @ normal) * normal
    alike = max(across, square.area) < _SAME_AREA * min(across, square.area)
    return bool(alike and away @ normal < 0 and np.linalg.norm(aside) < tolerance)


def in_line(found: Sequence[Lidded], again: Callable[[Array, Array], Sequence[Lidded]]) -> list[Prism]:
    """Concavities in curved faces; two that face each other and have no floor are one hole along the line of both.

    A face's normal is the direction of a hole only where the face on its other side is parallel: in a cone both ends
    lean, so they are looked at once more along that line. The end that is told better stays.

    Args:
        found: concavities of one hull, each with the places (N, 3) of its lid.
        again: what lies under a lid's places in a direction (3,), from the solid to who looks; best told first.
    """
    left = dict(enumerate(found))
    for i, j in combinations(range(len(found)), 2):
        line = _line(left[i], left[j]) if i in left and j in left else None
        if line is None:
            continue
        ends = left[i], left[j]
        if min(_facing(line, *ends)) < _OPPOSITE:
            looked = [next(iter(again(lid, way)), None) for (_, lid), way in zip(ends, (line, -line), strict=True)]
            open_ends = [end for end in looked if end is not None and _has_no_floor(end[0])]
            if len(open_ends) < len(ends):
                continue
            ends = open_ends[0], open_ends[1]
        near, far = sorted((prism for prism, _ in ends), key=lambda prism: prism.error)
        left[i] = replace(near, depth=distance_between(near, far), through=True), ends[0][1]
        del left[j]
    return [prism for prism, _ in left.values()]


def opposite(prism: Prism, lid: Array, scene: Scene) -> Array | None:
    """Places (N, 3) of a lid moved to where a concavity without floor would come out of a hull; None if it has one.

    The other mouth may be hard to see: silhouettes open the middle of some holes, and the rest of a lid is in pieces.
    """
    if not prism.endless or not _has_no_floor(prism):
        return None
    normal = prism.lattice.normal
    beyond = lid - _BEYOND * normal
    far = scene.distances(beyond, np.broadcast_to(normal, lid.shape))
    far = far[np.isfinite(far)]  # the rest looks through
    return np.asarray(beyond + float(np.quantile(far, _FAR_SIDE)) * normal) if len(far) else None


def _line(first: Lidded, second: Lidded) -> Array | None:
    """(3,) unit direction from the second lid to the first, if they may be two ends of one hole."""
    areas = sorted((first[0].area, second[0].area))
    if not (_has_no_floor(first[0]) and _has_no_floor(second[0])) or areas[1] > _SAME_AREA * areas[0]:
        return None
    line = first[1].mean(axis=0) - second[1].mean(axis=0)
    line /= np.linalg.norm(line)
    return line if min(_facing(line, first, second)) > _LEANING else None


def _facing(line: Array, first: Lidded, second: Lidded) -> tuple[float, float]:
    """Cosines between a line and the directions in which two concavities open, the second one against it."""
    return float(line @ first[0].lattice.normal), -float(line @ second[0].lattice.normal)


def _has_no_floor(prism: Prism) -> bool:
    """Whether a concavity is straight, and may go through."""
    return (prism.endless or prism.through) and not any(prism.tilt) and not prism.tapered


def told_once(found: Sequence[Prism], known: Sequence[Prism], tolerance: float) -> list[Prism]:
    """Those found that others, which are known or no worse told, don't explain.

    A crooked hull shows the far end of a hole through askew, and spans the walls of a pocket with a lid that leans. A
    lid in a hole that goes through is none, however few rays contradict the little that lies below it.

    Args:
        found, known: concavities of one hull.
        tolerance: how far beyond its end a hole may meet another one's mouth; lids lie half as far within pockets.
    """
    kept: list[int] = []
    for k in sorted(range(len(found)), key=lambda k: found[k].error):
        others = [*known, *(found[other] for other in kept)]
        if not any(_is_mouth_of(found[k], o, tolerance) or _is_within(found[k], o, tolerance / 2) for o in others):
            kept.append(k)
    holes = [found[k] for k in kept if found[k].through and found[k].error <= _MOST_TRUE_ERROR]
    once = [found[k] for k in sorted(kept)]
    return [p for p in once if p.through or not any(_is_within(p, hole, tolerance / 2) for hole in holes)]


def _is_within(lid: Prism, pocket: Prism, tolerance: float) -> bool:
    """Whether most of a concavity's opening is gone once another one around it is opened.

    That has a floor, or else the opening faces the same way: the far mouth of a hole is one more view of it.
    """
    if pocket.through and lid.lattice.normal @ pocket.lattice.normal < _UPWARDS:
        return False
    inside = pocket.signed_distance(lid.lattice.centers()[lid.outline], 0.0) < -tolerance
    return bool(inside.mean() > _MOSTLY_GONE)


def _is_mouth_of(mouth: Prism, hole: Prism, tolerance: float) -> bool:
    """Whether a mouth is the far end of a hole that is known better: of one that leans, or seen from a plane that does.

    Into an end of a leaning hole through which no view sees, what rays tell may be anything.
    """
    facing = -float(mouth.lattice.normal @ hole.lattice.normal)
    leaning = any(hole.tilt) or (mouth.through and facing <= _OPPOSITE)
    if not (hole.through and leaning and facing >= _LEANING):
        return False
    inside = hole.signed_distance(mouth.lattice.centers()[mouth.outline], tolerance) < tolerance
    return bool(inside.mean() > _SAME_MOUTH)


def face_each_other(first: Prism, second: Prism, tolerance: float) -> bool:
    """Whether two concavities may be the two ends of one hole, which is straight but for its rims."""
    if any(first.tilt) or any(second.tilt) or first.tapered or second.tapered:
        return False
    if first.lattice.normal @ second.lattice.normal > -_OPPOSITE or distance_between(first, second) <= 0:
        return False
    aside = second.middle - first.middle
    aside -= (aside @ first.lattice.normal) * first.lattice.normal
    return bool(np.linalg.norm(aside) < tolerance)


def throat(prism: Prism) -> float:
    """Radius of the circle that is as large as the narrowest part."""
    cells = np.count_nonzero(signed_outline(prism.outline) < -prism.rim / prism.lattice.pitch)
    return float(np.sqrt(cells / np.pi) * prism.lattice.pitch)


def _rim_of(prism: Prism, narrower: float) -> Prism:
    """A rim whose cone goes on until the hole is narrower by some length than the throat it has."""
    sink = prism.sink + narrower
    return replace(prism, depth=sink / prism.draft if prism.draft else 0.0, sink=sink, through=False)


def distance_between(first: Prism, second: Prism) -> float:
    """How far the second's opening lies below the first's."""
    return float((first.middle - second.middle) @ first.lattice.normal)
