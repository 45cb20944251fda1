"""Regularities between surfaces as equations of the refinement.

Two kinds: tangency, which the structure itself tells (a smooth edge), and relations that surfaces keep
within tolerances: parallel, perpendicular, coaxial, equal radius, coplanar.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.refine.mesh import slave
from brepgaussian.brep.refine.parameters import COUNT, derivative, update
from brepgaussian.brep.structure import SMOOTH, Structure
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]
Row = tuple[dict[int, Array], float]  # derivative by each surface's parameters, and the present value

_DIFFERENCE = 1e-6  # of the numeric derivative
_TANGENT_SAMPLES = 5  # on a smooth edge
_TANGENT_ANGLE = np.radians(20.0)  # smooth edges that deviate more are creases of low angle


def _across(vector: Array, axis: Array) -> Array:
    return vector - (vector @ axis) * axis


@dataclass(frozen=True)
class Tie:
    """One relation between two surfaces, `first < second`."""

    kind: str
    first: int
    second: int


# Each value is taken in the frame u, v of the first surface before any step, held fixed for derivatives.
_VALUE: dict[str, Callable[[Surface, Surface, Array], Array]] = {
    "parallel": lambda a, b, uv: uv @ (b.axis - np.sign(a.axis @ b.axis) * a.axis),
    "perpendicular": lambda a, b, uv: np.array([a.axis @ b.axis]),
    "coaxial": lambda a, b, uv: uv @ _across(b.origin - a.origin, a.axis),
    "coplanar": lambda a, b, uv: np.array([(b.origin - a.origin) @ a.axis]),
    "equal_radius": lambda a, b, uv: np.array([a.radius - b.radius]),
    "equal_minor": lambda a, b, uv: np.array([a.minor - b.minor]),
    "equal_angle": lambda a, b, uv: np.array([a.angle - b.angle]),
}
_IS_ANGLE = ("parallel", "perpendicular", "equal_angle")


@dataclass(frozen=True)
class Tolerances:
    """How far surfaces may be from a relation that they are taken to keep."""

    angle: float  # radians
    cone_angle: float  # the same where one is a cone
    length: float  # unit frame

    def of(self, tie: Tie, surfaces: Sequence[Surface]) -> float:
        """The tolerance of one relation."""
        cone = "cone" in (surfaces[tie.first].kind, surfaces[tie.second].kind)
        if tie.kind in _IS_ANGLE:
            return self.cone_angle if cone else self.angle
        return self.length


def value(tie: Tie, surfaces: Sequence[Surface]) -> Array:
    """How far a relation is from being kept (radians or unit frame)."""
    first = surfaces[tie.first]
    return _VALUE[tie.kind](first, surfaces[tie.second], np.array(first.frame()[:2]))


def detect(surfaces: Sequence[Surface], used: Sequence[int], tolerances: Tolerances) -> list[Tie]:
    """Relations that hold within tolerances: each surface is tied to the first of its class."""
    ties: list[Tie] = []

    def holds(kind: str, first: int, second: int) -> bool:
        tie = Tie(kind, first, second)
        return float(np.abs(value(tie, surfaces)).max()) <= tolerances.of(tie, surfaces)

    def classes(members: Sequence[int], kinds: Sequence[str]) -> list[list[int]]:
        groups: list[list[int]] = []
        for index in members:
            group = next((g for g in groups if all(holds(k, g[0], index) for k in kinds)), None)
            if group is None:
                groups.append([index])
            else:
                group.append(index)
                ties.extend(Tie(k, group[0], index) for k in kinds)
        return groups

    directed = [i for i in used if surfaces[i].kind != "sphere"]
    round_ = [i for i in used if surfaces[i].kind in ("cylinder", "cone", "torus")]
    # Planes and cylinders first: their directions are better known than cones'.
    directed.sort(key=lambda i: ("plane", "cylinder", "torus", "cone").index(surfaces[i].kind))
    round_.sort(key=lambda i: ("cylinder", "torus", "cone").index(surfaces[i].kind))
    directions = classes(directed, ["parallel"])
    for number, group in enumerate(directions):
        for other in directions[number + 1 :]:
            if holds("perpendicular", group[0], other[0]):
                ties.append(Tie("perpendicular", group[0], other[0]))
        planes = [i for i in group if surfaces[i].kind == "plane"]
        classes(planes, ["coplanar"])
        classes([i for i in round_ if i in group], ["coaxial"])
    classes([i for i in used if surfaces[i].kind in ("cylinder", "sphere")], ["equal_radius"])
    classes([i for i in used if surfaces[i].kind == "torus"], ["equal_minor"])
    classes([i for i in used if surfaces[i].kind == "cone"], ["equal_angle"])
    return ties


def tie_rows(ties: Sequence[Tie], surfaces: Sequence[Surface]) -> list[Row]:
    """Linear equations that keep the relations, by numeric derivatives of a few parameters."""
    rows: list[Row] = []
    for tie in ties:
        start = value(tie, surfaces)
        frame = np.array(surfaces[tie.first].frame()[:2])
        columns: dict[int, Array] = {}
        for index in (tie.first, tie.second):
            surface = surfaces[index]
            matrix = np.zeros((len(start), COUNT[surface.kind]))
            for k in range(matrix.shape[1]):
                delta = np.zeros(matrix.shape[1])
                delta[k] = _DIFFERENCE
                moved = update(surface, delta)
                pair = (moved, surfaces[tie.second]) if index == tie.first else (surfaces[tie.first], moved)
                matrix[:, k] = (_VALUE[tie.kind](*pair, frame) - start) / _DIFFERENCE
            columns[index] = matrix
        rows.extend(({i: m[k] for i, m in columns.items()}, float(start[k])) for k in range(len(start)))
    return rows


def tangent_rows(structure: Structure, surfaces: Sequence[Surface]) -> list[Row]:
    """Smooth edges stay smooth: the gap between the two surfaces where their normals are parallel is zero.

    To first order the gap is f_1 - s f_2 at a point of parallel normals (s = n_1 . n_2 = +-1), and its
    derivative that of f_1 - s f_2, since the point slides along both surfaces.
    """
    rows: list[Row] = []
    for edge in structure.edges:
        first, second = edge.surfaces
        if edge.convexity != SMOOTH or first < 0 or second < 0 or first == second:
            continue
        points = edge.polyline[np.linspace(0, len(edge.polyline) - 1, _TANGENT_SAMPLES).round().astype(int)]
        points, sign = touching(points, surfaces[first], surfaces[second])
        good = np.abs(sign) > np.cos(_TANGENT_ANGLE)
        points, sign = points[good], np.sign(sign[good])
        gap = surfaces[first].signed_distance(points) - sign * surfaces[second].signed_distance(points)
        one = derivative(surfaces[first], points)
        two = -sign[:, None] * derivative(surfaces[second], points)
        rows.extend(({first: a, second: b}, float(g)) for a, b, g in zip(one, two, gap, strict=True))
    return rows


def touching(points: Array, first: Surface, second: Surface) -> tuple[Array, Array]:
    """(N, 3) points near a line of contact where the normals are parallel, and (N,) n_1 . n_2 there."""
    h, table = 1e-4, np.zeros((len(points), 1), np.int64)
    sign = np.sign(np.einsum("ni,ni->n", first.normals(points), second.normals(points)))[:, None]
    start = points
    tangent = np.gradient(points, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    for _ in range(4):
        points = slave(points, table, [first])
        across = np.cross(first.normals(points), tangent)
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)

        def slope(x: Array, across: Array = across) -> Array:
            return np.einsum("ni,ni->n", first.normals(x) - sign * second.normals(x), across)

        bend = (slope(points + h * across) - slope(points - h * across)) / (2 * h)
        step = np.where(np.abs(bend) > 1e-3, -slope(points) / np.where(np.abs(bend) > 1e-3, bend, 1), 0)
        points = points + np.clip(step, -0.02, 0.02)[:, None] * across
    points = np.where(np.linalg.norm(points - start, axis=1, keepdims=True) < 0.05, points, start)
    return points, np.einsum("ni,ni->n", first.normals(points), second.normals(points))
