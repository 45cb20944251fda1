"""Curves and corners of the published solid, for `brep.h5` (paper, section on primitive fitting and assembly)."""

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.brep import Curve
from brepgaussian.artifacts.points import Points
from brepgaussian.brep.structure import Structure


def curves_of(structure: Structure, points: Points) -> tuple[Curve, ...]:
    """The solid's edges between two surfaces as trimmed curves, in the solid's order."""
    return tuple(Curve(kind=e.kind, faces=e.surfaces, t_range=e.t_range, points=e.polyline) for e in structure.edges)


def corners_of(structure: Structure) -> NDArray[np.float64]:
    """(C, 3) vertices where three or more faces meet."""
    return np.array([v.point for v in structure.vertices if v.corner]).reshape(-1, 3)
