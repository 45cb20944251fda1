"""Pieces of one cylinder or cone that lie apart: the chamfers of a nut, the lands of a slotted shaft.

A short arc alone knows its axis and radius badly; several arcs of one surface know them well. A family is
found from a pair of pieces along a known direction, joined by every piece that its surface explains, and kept
if the one surface is a shorter description than the pieces' own. A piece too short to show that it bends, and so
a plane, joins where the family's surface explains it better.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.fit import cone_about, cylinder_about, data_length, oriented, plausible, refine
from brepgaussian.geometry.fit_choose import EFFECTIVE
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.log import get_logger
from brepgaussian.primitives.guided import ALONG, Known
from brepgaussian.primitives.merging import EQUAL_COUNT, misfit
from brepgaussian.primitives.patches import Cloud, Noise, Patch, observations, spreads, thinned
from brepgaussian.settings.primitives import PrimitivesSettings

Array = NDArray[np.float64]
log = get_logger("primitives")

SLOPE = np.radians(12.0)  # largest difference of the mean angles from the direction in a family
PIECE_PRICE = 3.0  # parameters of a piece of its own along a known direction: less than any free fit
FAMILY_PRICE = {"cylinder": 3.0, "cone": 4.0}
MOST_PIECES = 24  # the smallest curved pieces that pairs are made of


def join_families(
    patches: list[Patch], known: Known, cloud: Cloud, noise: Noise, settings: PrimitivesSettings
) -> list[Patch]:
    """Give the pieces of one cylinder or cone their common surface and make them one patch."""
    patches = list(patches)
    while True:
        found = _best_family(patches, known, cloud, noise, settings)
        if found is None:
            return patches
        surface, group = found
        members = np.unique(np.concatenate([patches[i].members for i in group]))
        labels = tuple(sorted({v for i in group for v in patches[i].labels}))
        log.info("labels %s are pieces of one %s", list(labels), surface.kind)
        joined = Patch(labels, members, surface, *spreads(surface, cloud, members))
        patches = [p for i, p in enumerate(patches) if i not in group] + [joined]
        patches.sort(key=lambda p: (p.labels, int(p.members[0])))


def _best_family(
    patches: list[Patch], known: Known, cloud: Cloud, noise: Noise, settings: PrimitivesSettings
) -> tuple[Surface, list[int]] | None:
    curved = [i for i, p in enumerate(patches) if p.surface.kind != "plane"]
    curved = sorted(curved, key=lambda i: (len(patches[i].members), i))[:MOST_PIECES]
    some = {i: thinned(patches[i].members, EQUAL_COUNT // 2) for i in curved}
    flat = [i for i, p in enumerate(patches) if p.surface.kind == "plane"]
    best: tuple[Surface, list[int]] | None = None
    best_gain = 0.0
    for direction in known.directions:
        slopes = {i: float(np.mean(cloud.normals[some[i]] @ direction)) for i in curved}
        for first, second in _pairs(curved, slopes):
            for surface in _through([first, second], some, direction, cloud, settings):
                group = [i for i in curved if misfit(patches[i], surface, cloud, noise) <= 1]
                if first not in group or second not in group:
                    continue
                surface = _refitted(surface, group, some, cloud)
                group = [
                    *(i for i in group if misfit(patches[i], surface, cloud, noise) <= 1),
                    *(i for i in flat if _better(surface, patches[i], cloud, noise)),
                ]
                gain = _gain(surface, [patches[i] for i in group], len(known.directions), cloud, noise)
                if len(group) > 1 and gain > best_gain:
                    best, best_gain = (surface, group), gain
    return best


def _better(surface: Surface, piece: Patch, cloud: Cloud, noise: Noise) -> bool:
    """Whether a surface explains a piece better than its own, in distances and in normals."""
    rms, turn = spreads(surface, cloud, piece.members)
    return rms < piece.rms and turn < piece.turn and misfit(piece, surface, cloud, noise) <= 1


def _pairs(curved: list[int], slopes: dict[int, float]) -> Iterator[tuple[int, int]]:
    for n, i in enumerate(curved):
        for j in curved[:n]:
            if abs(np.arcsin(np.clip(slopes[i], -1, 1)) - np.arcsin(np.clip(slopes[j], -1, 1))) < SLOPE:
                yield j, i


def _through(
    group: list[int], some: dict[int, NDArray[np.int64]], direction: Array, cloud: Cloud, settings: PrimitivesSettings
) -> Iterator[Surface]:
    both = np.concatenate([some[i] for i in group])
    share = np.concatenate([np.full(len(some[i]), 1 / (len(group) * len(some[i]))) for i in group])
    for kind, make in (("cylinder", cylinder_about), ("cone", cone_about)):
        if kind not in settings.kinds:
            continue
        start = make(direction, cloud.xyz[both], cloud.normals[both], share)
        if start is None:
            continue
        surface = _refitted(start, group, some, cloud)
        if plausible(surface, cloud.xyz[both], settings.largest_radius):
            yield surface


def _refitted(surface: Surface, group: list[int], some: dict[int, NDArray[np.int64]], cloud: Cloud) -> Surface:
    both = np.concatenate([some[i] for i in group])
    weights = np.concatenate([np.full(len(some[i]), 1 / len(some[i])) for i in group])
    surface = refine(surface, cloud.xyz[both], weights, iterations=12, free=ALONG[surface.kind])
    return oriented(surface, cloud.xyz[both], cloud.normals[both])


def _gain(surface: Surface, pieces: list[Patch], choices: int, cloud: Cloud, noise: Noise) -> float:
    """How much shorter one surface describes the pieces than their own."""
    length = (FAMILY_PRICE[surface.kind] - PIECE_PRICE * len(pieces)) * np.log(EFFECTIVE) + 2 * np.log(choices)
    for piece in pieces:
        points, normals = cloud.xyz[piece.members], cloud.normals[piece.members]
        count = observations(piece, cloud, noise)
        floors = max(noise.distance, piece.rms), max(noise.turn, piece.turn)
        length += data_length(surface, points, normals, *floors, count=count)
        length -= data_length(piece.surface, points, normals, *floors, count=count)
    return -float(length)
