"""Relations made exact to the last bit, because the kernel asks for it.

Least squares leave axes parallel, square or coaxial to 1e-10. OCC intersects two cylinders with parallel axes in
lines, but with axes 1e-10 apart by a general method that loses them, and whole cells with them.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.patches import Patch
from brepgaussian.geometry.surfaces import Surface, unit

Array = NDArray[np.float64]

_SAME = 1e-7  # radians, unit frame: what is nearer to a relation than this holds it; nothing moves by more


def exact(patches: Sequence[Patch]) -> list[Patch]:
    """The patches with directions that are nearly parallel or square, and axes that are nearly one, exactly so."""
    directions: list[Array] = []
    axes: list[tuple[Array, Array]] = []  # a direction and a point
    result = []
    for patch in patches:
        surface = patch.surface
        if surface.kind != "sphere":
            surface = replace(surface, axis=_known(surface.axis, directions))
        if surface.kind not in ("plane", "sphere"):
            surface = _coaxial(surface, axes)
        result.append(replace(patch, surface=surface))
    return result


def _known(axis: Array, directions: list[Array]) -> Array:
    """A direction that was met before, if it is nearly the same (or the opposite); else a new one, square to others."""
    for known in directions:
        if np.linalg.norm(np.cross(known, axis)) < _SAME:
            return known if known @ axis > 0 else -known
    square = [known for known in directions if abs(float(known @ axis)) < _SAME]
    if len(square) > 1 and np.linalg.norm(np.cross(square[0], square[1])) > _SAME:
        across = unit(np.cross(square[0], square[1]))
        axis = across if across @ axis > 0 else -across
    elif square:
        axis = unit(axis - (square[0] @ axis) * square[0])
    directions.append(axis)
    return axis


def _coaxial(surface: Surface, axes: list[tuple[Array, Array]]) -> Surface:
    """A surface moved onto an axis that was met before, if its own is nearly the same."""
    for direction, through in axes:
        if abs(float(direction @ surface.axis)) < 1 - _SAME**2:
            continue
        offset = surface.origin - through
        along = through + (offset @ direction) * direction
        if np.linalg.norm(surface.origin - along) < _SAME:
            return replace(surface, origin=along)
    axes.append((surface.axis, surface.origin))
    return surface
