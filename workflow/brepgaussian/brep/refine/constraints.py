"""Regularities between surfaces as equations of the refinement.

Relations that surfaces keep within tolerances: parallel, perpendicular, coaxial, equal radius, coplanar, four
surfaces through one corner. What the structure itself tells, smooth edges, is in `tangency`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.refine.mesh import slave
from brepgaussian.brep.refine.parameters import COUNT, derivative, update
from brepgaussian.brep.structure import Structure
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]
Row = tuple[dict[int, Array], float]  # derivative by each surface's parameters, and the present value

_DIFFERENCE = 1e-6  # of the numeric derivative
_SQUARE = np.radians(2.0)
_SHORT_EDGE = 0.005  # unit frame, three pixels of an 800-px view: its ends may be one corner
_ONE_CORNER = 1e-3  # unit frame, half a pixel: surfaces that miss a common point by less are meant to meet there
_LEAST_CORNER = 0.1  # singular value of the normals at a corner: below, they hardly determine a point


def _across(vector: Array, axis: Array) -> Array:
    return vector - (vector @ axis) * axis


def _inscribed(cone: Surface, cap: Surface, side: Surface) -> float:
    """Radius of a cone's circle in a plane across its axis, less the distance of its centre from another plane."""
    along = (cap.origin - cone.origin) @ cap.axis / (cone.axis @ cap.axis)
    center = cone.origin + along * cone.axis
    return float(cone.radius + along * np.tan(cone.angle) - abs((center - side.origin) @ side.axis))


def _miss(first: Surface, second: Surface) -> float:
    """By how much two axes miss each other."""
    across = np.cross(first.axis, second.axis)
    return float((second.origin - first.origin) @ across / max(float(np.linalg.norm(across)), _DIFFERENCE))


def _gap(face: Surface, round_: Surface) -> float:
    """Height of a cylinder above a plane along its axis, or the distance by which it reaches through.

    The same of a torus beside a plane across its axis, or beside a cylinder about it.
    """
    if round_.kind == "torus":
        beside = abs(face.radius - round_.radius) if face.kind == "cylinder" else _height(face, round_)
        return beside - round_.minor
    return _height(face, round_) - round_.radius


def _height(flat: Surface, other: Surface) -> float:
    return float(abs((other.origin - flat.origin) @ flat.axis))


@dataclass(frozen=True)
class Tie:
    """One relation between surfaces.

    Attributes:
        kind: `parallel`, `perpendicular`, `coaxial`, `coplanar`, `equal_radius`, `equal_minor`, `equal_angle`
            of two surfaces; `touching` of a plane and a cylinder along it, or of a torus and a plane across its axis
            or a cylinder about it (a fillet); `inscribed` of a cone, the plane that
            cuts it in a circle, and a plane that touches the circle (a nut's chamfer); `corner` of four surfaces
            through one point (chamfers that meet).
        members: indices of the surfaces.
        near: (3,) where they meet, of a corner.
    """

    kind: str
    members: tuple[int, ...]
    near: tuple[float, ...] = ()


def _apart(surfaces: Sequence[Surface], near: Array) -> float:
    """By how much four surfaces miss a common point: their distances from the nearest one, where these balance."""
    return _balanced(surfaces, near)[2]


def _balanced(surfaces: Sequence[Surface], near: Array) -> tuple[Array, Array, float]:
    """Of four surfaces, about a place (3,): the point (1, 3) where their distances balance, (4,) unit weights with
    which their normals there add up to nothing, and the sum of the distances with these weights.
    """
    point = slave(near[None], np.arange(len(surfaces))[None], surfaces)
    balance = np.linalg.svd(np.concatenate([s.normals(point) for s in surfaces]))[0][:, -1]
    balance = balance * np.sign(balance[np.argmax(np.abs(balance))])
    return point, balance, float(balance @ np.array([s.signed_distance(point)[0] for s in surfaces]))


# Each value is taken in the frame u, v of the first surface before any step, held fixed for derivatives.
_VALUE: dict[str, Callable[[Sequence[Surface], Array], Array]] = {
    "parallel": lambda s, uv: uv @ (s[1].axis - np.sign(s[0].axis @ s[1].axis) * s[0].axis),
    "perpendicular": lambda s, uv: np.array([s[0].axis @ s[1].axis]),
    "coaxial": lambda s, uv: uv @ _across(s[1].origin - s[0].origin, s[0].axis),
    "coplanar": lambda s, uv: np.array([(s[1].origin - s[0].origin) @ s[0].axis]),
    "equal_radius": lambda s, uv: np.array([s[0].radius - s[1].radius]),
    "equal_minor": lambda s, uv: np.array([s[0].minor - s[1].minor]),
    "equal_angle": lambda s, uv: np.array([s[0].angle - s[1].angle]),
    "touching": lambda s, uv: np.array([_gap(*s)]),
    "inscribed": lambda s, uv: np.array([_inscribed(*s)]),
    "crossing": lambda s, uv: np.array([_miss(*s)]),
}
ANGLES = ("parallel", "perpendicular", "equal_angle")


@dataclass(frozen=True)
class Tolerances:
    """How far surfaces may be from a relation that they are taken to keep.

    Surfaces that the images determine well must be close to it; the others may be off by what is not known
    of them, up to a limit.

    Attributes:
        angle: radians; `cone_angle`: the same where one is a cone; `length`: unit frame.
        most_angle, most_length: limits for surfaces that are hardly determined.
        trust: formal standard deviations that a relation may be off (formal ones are too small).
        covariance: (P, P) formal covariance of all surfaces' parameters.
        start: (S + 1,) first parameter of each surface.
    """

    angle: float
    cone_angle: float
    length: float
    most_angle: float
    most_length: float
    trust: float
    covariance: Array
    start: NDArray[np.int64]

    def keeps(self, tie: Tie, surfaces: Sequence[Surface]) -> bool:
        """Whether a relation is kept."""
        off = float(np.abs(value(tie, surfaces)).max())
        cone = any(surfaces[i].kind == "cone" for i in tie.members)
        angular = tie.kind in ANGLES
        least = (self.cone_angle if cone else self.angle) if angular else self.length
        if off <= least or off > (self.most_angle if angular else self.most_length):
            return off <= least
        return off <= self.trust * max(self._deviation(row) for row in tie_rows([tie], surfaces))

    def _deviation(self, row: Row) -> float:
        """Formal standard deviation of a relation's value."""
        at = np.concatenate([np.arange(self.start[i], self.start[i + 1]) for i in row[0]])
        slope = np.concatenate(list(row[0].values()))
        return float(np.sqrt(max(slope @ self.covariance[np.ix_(at, at)] @ slope, 0.0)))

    def uncertainty(self, index: int) -> float:
        """For sorting: trace of one surface's covariance."""
        span = slice(self.start[index], self.start[index + 1])
        return float(np.trace(self.covariance[span, span]))


def value(tie: Tie, surfaces: Sequence[Surface]) -> Array:
    """How far a relation is from being kept (radians or unit frame)."""
    members = [surfaces[i] for i in tie.members]
    return _value(tie, members, np.array(members[0].frame()[:2]))


def _value(tie: Tie, members: Sequence[Surface], frame: Array) -> Array:
    if tie.kind == "corner":
        return np.array([_apart(members, np.array(tie.near))])
    return _VALUE[tie.kind](members, frame)


def detect(structure: Structure, surfaces: Sequence[Surface], tolerances: Tolerances) -> list[Tie]:
    """Relations that hold within tolerances: each surface is tied to the first of its class."""
    used = {f.surface for f in structure.faces if f.surface >= 0}
    ties: list[Tie] = []

    def holds(kind: str, first: int, second: int) -> bool:
        return tolerances.keeps(Tie(kind, (first, second)), surfaces)

    def classes(members: Sequence[int], kinds: Sequence[str]) -> list[list[int]]:
        groups: list[list[int]] = []
        for index in members:
            group = next((g for g in groups if all(holds(k, g[0], index) for k in kinds)), None)
            if group is None:
                groups.append([index])
            else:
                group.append(index)
                ties.extend(Tie(k, (group[0], index)) for k in kinds)
        return groups

    # What is known best stands for its class.
    order = sorted(sorted(used), key=tolerances.uncertainty)
    directed = [i for i in order if surfaces[i].kind != "sphere"]
    round_ = [i for i in order if surfaces[i].kind in ("cylinder", "cone", "torus")]
    # Planes and cylinders first: their directions are better known than cones'.
    directed.sort(key=lambda i: ("plane", "cylinder", "torus", "cone").index(surfaces[i].kind))
    round_.sort(key=lambda i: ("cylinder", "torus", "cone").index(surfaces[i].kind))
    directions = classes(directed, ["parallel"])
    for number, group in enumerate(directions):
        for other in directions[number + 1 :]:
            if holds("perpendicular", group[0], other[0]):
                ties.append(Tie("perpendicular", (group[0], other[0])))
        planes = [i for i in group if surfaces[i].kind == "plane"]
        classes(planes, ["coplanar"])
        classes([i for i in round_ if i in group], ["coaxial"])
    classes([i for i in order if surfaces[i].kind in ("cylinder", "sphere")], ["equal_radius"])
    classes([i for i in order if surfaces[i].kind == "torus"], ["equal_minor"])
    classes([i for i in order if surfaces[i].kind == "cone"], ["equal_angle"])
    kept = set(ties)
    for cone, cap, side in _chamfers(structure, surfaces):
        square = Tie("perpendicular", (side, cone))
        if all(t in kept or tolerances.keeps(t, surfaces) for t in (square, Tie("inscribed", (cone, cap, side)))):
            ties.append(Tie("inscribed", (cone, cap, side)))
    return ties + _touching(structure, surfaces, tolerances) + _corners(structure, surfaces)


# Faces that touch each other where they meet, and what they keep besides.
_TOUCHING = {
    ("plane", "cylinder"): ("perpendicular",),
    ("plane", "torus"): ("parallel",),
    ("cylinder", "torus"): ("parallel", "coaxial"),
}


def _touching(structure: Structure, surfaces: Sequence[Surface], tolerances: Tolerances) -> list[Tie]:
    """Faces that share an edge and nearly touch along it: no slit or crossing is meant."""
    edges = [e.surfaces for e in structure.edges if min(e.surfaces) >= 0]
    found = []
    for pair in sorted({pair for a, b in edges for pair in ((a, b), (b, a))}):
        besides = _TOUCHING.get((surfaces[pair[0]].kind, surfaces[pair[1]].kind))
        if besides and all(tolerances.keeps(Tie(kind, pair), surfaces) for kind in (*besides, "touching")):
            found.append(Tie("touching", pair))
    return found


def _corners(structure: Structure, surfaces: Sequence[Surface]) -> list[Tie]:
    """Corners of four faces, and those that an edge, shorter than its ends are known, tears apart."""
    places = [(v.surfaces, v.point) for v in structure.vertices]
    for edge in structure.edges:
        length = np.linalg.norm(np.diff(edge.polyline, axis=0), axis=1).sum()
        if not edge.closed and length <= _SHORT_EDGE and -1 not in edge.vertices:
            around = {s for v in edge.vertices for s in structure.vertices[v].surfaces}
            places.append((tuple(sorted(around)), edge.polyline.mean(axis=0)))
    found = []
    for members, place in places:
        if len(members) != 4 or members[0] < 0:
            continue
        normals = np.concatenate([surfaces[i].normals(place[None]) for i in members])
        known = np.linalg.svd(normals, compute_uv=False)[-1] > _LEAST_CORNER
        tie = Tie("corner", members, tuple(place.tolist()))
        if known and abs(value(tie, surfaces)[0]) < _ONE_CORNER:
            found.append(tie)
    return found


def _chamfers(structure: Structure, surfaces: Sequence[Surface]) -> list[tuple[int, int, int]]:
    """Cones that meet one plane in a circle and another along their axis: cone, the one, the other."""
    near: dict[int, set[int]] = {}
    for edge in structure.edges:
        for a, b in (edge.surfaces, edge.surfaces[::-1]):
            if a >= 0 and b >= 0 and surfaces[a].kind == "cone" and surfaces[b].kind == "plane":
                near.setdefault(a, set()).add(b)
    found = []
    for cone, planes in sorted(near.items()):
        cosine = {p: abs(surfaces[p].axis @ surfaces[cone].axis) for p in planes}
        caps = [p for p in sorted(planes) if cosine[p] > np.cos(_SQUARE)]
        sides = [p for p in sorted(planes) if cosine[p] < np.sin(_SQUARE)]
        found += [(cone, cap, side) for cap in caps for side in sides]
    return found


def tie_rows(ties: Sequence[Tie], surfaces: Sequence[Surface]) -> list[Row]:
    """Linear equations that keep the relations, by numeric derivatives of a few parameters."""
    rows: list[Row] = []
    for tie in ties:
        if tie.kind == "corner":
            rows.append(_corner_row(tie, surfaces))
            continue
        start = value(tie, surfaces)
        members = [surfaces[i] for i in tie.members]
        frame = np.array(members[0].frame()[:2])
        columns: dict[int, Array] = {}
        for place, index in enumerate(tie.members):
            matrix = np.zeros((len(start), COUNT[members[place].kind]))
            for k in range(matrix.shape[1]):
                delta = np.zeros(matrix.shape[1])
                delta[k] = _DIFFERENCE
                moved = [*members[:place], update(members[place], delta), *members[place + 1 :]]
                matrix[:, k] = (_value(tie, moved, frame) - start) / _DIFFERENCE
            columns[index] = matrix
        rows.extend(({i: m[k] for i, m in columns.items()}, float(start[k])) for k in range(len(start)))
    return rows


def _corner_row(tie: Tie, surfaces: Sequence[Surface]) -> Row:
    """The same of a corner: its place slides along all faces, so that to first order only their distances change."""
    members = [surfaces[i] for i in tie.members]
    point, balance, apart = _balanced(members, np.array(tie.near))
    parts = (b * derivative(s, point)[0] for b, s in zip(balance, members, strict=True))
    return dict(zip(tie.members, parts, strict=True)), apart
