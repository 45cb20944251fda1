"""Which regularities the refined surfaces keep: those that the images show, and those that they came with."""

from collections.abc import Sequence
from dataclasses import replace

import networkx as nx
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
# Cylinders that cross split each other only where they are equal and meet in full: half a pixel off, they are meant to.
_CROSSING, _LEAST_CROSSING = 1e-3, np.radians(20.0)
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


def crossings(structure: Structure, surfaces: Sequence[Surface]) -> list[Tie]:
    """Equal radii and axes that meet, of cylinders that share an edge and nearly keep both.

    A little apart, the larger one goes through in one piece; where they are equal, either parts the other.
    """
    found = []
    for first, second in sorted({tuple(sorted(e.surfaces)) for e in structure.edges}):
        if first < 0 or first == second or any(surfaces[i].kind != "cylinder" for i in (first, second)):
            continue
        angle = np.linalg.norm(np.cross(surfaces[first].axis, surfaces[second].axis))
        ties = [Tie(kind, (first, second)) for kind in ("equal_radius", "crossing")]
        near = all(float(np.abs(value(tie, surfaces)).max()) < _CROSSING for tie in ties)
        if near and angle > np.sin(_LEAST_CROSSING):
            found += ties
    return found


def parting(structure: Structure, surfaces: Sequence[Surface]) -> tuple[Surface, ...]:
    """The surfaces with cylinders that nearly part each other made to do so; empty if none do.

    Of those that meet, the longest stays, for it is known best, and the others follow from one to the next.
    """
    graph = nx.Graph(sorted({tie.members for tie in crossings(structure, surfaces)}))
    result = list(surfaces)
    for members in nx.connected_components(graph):
        first = max(sorted(members), key=lambda i: _length(structure, i, surfaces[i]))
        for one, other in nx.bfs_edges(graph, first, sort_neighbors=sorted):
            result[other] = _met(result[one], result[other])
    return tuple(result) if len(graph) else ()


def _length(structure: Structure, index: int, surface: Surface) -> float:
    """How far the edges of a surface's faces reach along its axis."""
    along = [edge.polyline @ surface.axis for edge in structure.edges if index in edge.surfaces]
    return float(np.ptp(np.concatenate(along)))


def _met(first: Surface, other: Surface) -> Surface:
    """The other cylinder with the radius of the first, moved to where their axes meet."""
    across = np.cross(first.axis, other.axis)
    across /= np.linalg.norm(across)
    return replace(other, radius=first.radius, origin=other.origin + ((first.origin - other.origin) @ across) * across)
