"""Where a round face ends: at a plane that touches it, though no point of the plane may lie there."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.surfaces import Surface
from brepgaussian.primitives.patches import Cloud, Patch

_PARALLEL = np.sin(np.radians(3.0))  # sine between a plane and an axis along it, before the two are tied
_AWAY = 0.3  # of the radius: a plane farther from touching is none of the ends; tolerances judge the others
_SPACINGS = 2.0  # from its last points to where a face ends
_BEYOND = 0.03  # share of a face's points past its end: wrong labels


def end_at(patches: Sequence[Patch], cloud: Cloud) -> NDArray[np.bool_]:
    """(P, P) symmetric: whether a cylinder's points end where a plane would touch it.

    Points of the plane may be missing there: half of a pocket's wall that no view shows.
    """
    result = np.zeros((len(patches),) * 2, bool)
    for i, round_ in enumerate(patches):
        if round_.surface.kind != "cylinder":
            continue
        for j, flat in enumerate(patches):
            if flat.surface.kind == "plane" and _ends_at(round_, flat.surface, cloud):
                result[i, j] = result[j, i] = True
    return result


def _ends_at(patch: Patch, wall: Surface, cloud: Cloud) -> bool:
    surface = patch.surface
    height = float((surface.origin - wall.origin) @ wall.axis)
    if abs(wall.axis @ surface.axis) > _PARALLEL or abs(abs(height) - surface.radius) > _AWAY * surface.radius:
        return False
    towards = -np.sign(height) * wall.axis
    towards = towards - (towards @ surface.axis) * surface.axis
    towards /= np.linalg.norm(towards)
    offset = cloud.xyz[patch.members] - surface.origin
    along = np.arctan2(offset @ np.cross(surface.axis, towards), offset @ towards) * surface.radius  # arc lengths
    beyond, least = float(np.mean(along > 0)), _SPACINGS * cloud.spacing
    if min(beyond, 1 - beyond) > _BEYOND:
        return False
    return bool(np.quantile(np.abs(along), _BEYOND) < least)
