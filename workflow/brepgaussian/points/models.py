"""Surfaces of labels, for their curves: pieces of one surface bend alike, and short ones alone know it badly."""

import numpy as np

from brepgaussian.artifacts.points import Points
from brepgaussian.errors import StageError
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.primitives.stage import primitives_of
from brepgaussian.settings.primitives import PrimitivesSettings

_WORSE = 1.5  # times its own rms that a patch may have on a shared surface; they differ by what points scatter
_NOISE = 0.001  # unit frame; a rms below is not told from it


def shared_surfaces(points: Points, surfaces: list[Surface]) -> list[Surface]:
    """The surface of each label as the fit of all of them together has it, where that explains its points as well.

    Args:
        points: labelled, without curves.
        surfaces: primitive of each label by itself.
    """
    try:
        fitted = primitives_of(points, PrimitivesSettings()).items
    except StageError:  # no label has points enough
        return surfaces
    result = []
    for label, own in enumerate(surfaces):
        mine = np.flatnonzero(points.label == label)
        on = np.array([len(np.intersect1d(item.support, mine, assume_unique=True)) for item in fitted])
        best = fitted[int(on.argmax())].surface if on.any() else own
        xyz = points.xyz[mine].astype(float)
        explains = len(mine) > 0 and best.rms(xyz) <= max(_WORSE * own.rms(xyz), _NOISE)
        result.append(best if explains else own)
    return result
