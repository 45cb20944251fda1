"""Which regularities the refined surfaces keep: those that the images show, and those that they came with."""

from collections.abc import Sequence

import numpy as np

from brepgaussian.brep.refine.constraints import ANGLES, Tie, Tolerances, detect, value
from brepgaussian.brep.refine.solve import Step
from brepgaussian.brep.structure import Structure
from brepgaussian.geometry.surfaces import Surface

# The images tell directions and lengths at least this well.
_ANGLE, _CONE_ANGLE, _LENGTH = np.radians(0.05), np.radians(0.1), 2e-4
# What surfaces that the images hardly determine may be off, as far as formal standard deviations allow.
_MOST_ANGLE, _MOST_LENGTH, _TRUST = np.radians(1.5), 2e-3, 10.0
_EXACT = 1e-6  # radians and unit frame: surfaces were snapped to a relation
_ASTRAY_ANGLE, _ASTRAY_LENGTH = np.radians(6.0), 0.01  # by which small faces stray from the relations they came with


def shown(structure: Structure, surfaces: Sequence[Surface], step: Step) -> list[Tie]:
    """Relations of refined surfaces, whose covariance the last step knows, that hold to within what is known."""
    limits = (_ANGLE, _CONE_ANGLE, _LENGTH, _MOST_ANGLE, _MOST_LENGTH, _TRUST)
    return detect(structure, surfaces, Tolerances(*limits, covariance=step.covariance, start=step.start))


def given(structure: Structure, surfaces: Sequence[Surface], step: Step) -> list[Tie]:
    """Relations that surfaces have been snapped to before; `step` only says which represents a class."""
    limits = (_EXACT, _EXACT, _EXACT, 0.0, 0.0, 0.0)
    return detect(structure, surfaces, Tolerances(*limits, covariance=step.covariance, start=step.start))


def unopposed(ties: Sequence[Tie], kept: Sequence[Tie], surfaces: Sequence[Surface]) -> list[Tie]:
    """The relations, beside those that are kept, from which refined surfaces have strayed by little."""
    near = []
    for tie in ties:
        most = _ASTRAY_ANGLE if tie.kind in ANGLES else _ASTRAY_LENGTH
        if tie not in kept and float(np.abs(value(tie, surfaces)).max()) < most:
            near.append(tie)
    return near
