"""Inner edges between planar faces that are rounded: fillets, which masks merge with both faces.

No image shows a border there, so the regions tell two planes that meet in a sharp edge; and silhouettes tell little
of inner corners. Whether the corner is filled, and by what radius, views tell: on the right surface they agree.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.log import get_logger
from brepgaussian.splatting.concave.agreement import Rays, mean_cost, rays_at_object
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.shapes import SURE, Costs
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.faces.confirm import Face

Array = NDArray[np.float64]

_LEAST_SINE = 0.5  # of the angle between two planes: flatter than 30 degrees has no corner to speak of
_LEAST_RADIUS_VOXELS = 3.0  # smaller ones are left to the primitives
_RADII = 8  # tried, in equal ratios
_MOST_RADIUS = 0.35  # unit frame
_LEAST_LENGTH_VOXELS = 8.0  # of the edge
_LEAST_FRONT = 0.9  # share of a face's cells that lie in front of the other plane
_FINER = 5  # radii tried between the neighbours of the best
_PAST_VOXELS = 2.0  # past its tangent lines in which a fillet clears what is left standing
_BEHIND_VOXELS = 4.0  # behind the planes: a face cut too far under the fillet left a slot there
_GAIN = 0.9  # a fillet leaves at most this share of the views' disagreement, as leaning walls do
_LEAST_RAYS = 200

logger = get_logger("stage1")


@dataclass(frozen=True)
class Edge:
    """The line in which two planes meet at an inner edge.

    Attributes:
        point: (3,) on it; direction: (3,) unit.
        normals: (2, 3) unit, out of the solid.
        span: first and last position along the direction at which both faces are.
        reach: how far both faces extend from it.
    """

    point: Array
    direction: Array
    normals: Array
    span: tuple[float, float]
    reach: float

    @property
    def cosine(self) -> float:
        """Of the angle between the normals."""
        return float(self.normals[0] @ self.normals[1])

    def tangent_length(self, radius: float) -> float:
        """Distance from the line at which a fillet touches the planes."""
        return radius * float(np.sqrt((1 - self.cosine) / (1 + self.cosine)))

    def radius(self, tangent_length: float) -> float:
        """The inverse of `tangent_length`."""
        return tangent_length / self.tangent_length(1.0)

    def heights(self, points: Array) -> Array:
        """(N, 2) heights of points (N, 3) above the two planes."""
        return np.asarray((points - self.point) @ self.normals.T)

    def corner(self, points: Array, length: float, slack: float) -> NDArray[np.bool_]:
        """(N,) whether points lie in front of both planes, no farther along them than `length` from the line.

        They may lie behind the planes by `slack`.
        """
        along = (points - self.point) @ self.direction
        most = length * np.sqrt(1 - self.cosine**2)
        heights = self.heights(points)
        inside = ((heights < most) & (heights > -slack)).all(axis=1)
        return np.asarray(inside & (along >= self.span[0]) & (along <= self.span[1]))

    @property
    def bisector(self) -> Array:
        """(3,) unit, half-way between the normals."""
        both = self.normals.sum(axis=0)
        return np.asarray(both / np.linalg.norm(both))

    @property
    def half_arc(self) -> float:
        """Cosine of half the angle of a fillet's arc."""
        return float(np.sqrt((1 + self.cosine) / 2))

    def off_axis(self, points: Array, radius: float) -> Array:
        """(N, 3) offsets of points (N, 3) from a fillet's axis, across it."""
        off = points - self.point - radius * self.normals.sum(axis=0) / (1 + self.cosine)
        return np.asarray(off - (off @ self.direction)[:, None] * self.direction)

    def filled(self, points: Array, radius: float) -> Array:
        """(N,) about the signed distance to the two half-spaces with a fillet between them, inside positive."""
        off = self.off_axis(points, radius)
        bisector = self.normals.sum(axis=0)
        chord = -(off @ bisector) / np.linalg.norm(bisector) - radius * self.half_arc
        fillet = np.minimum(np.linalg.norm(off, axis=1) - radius, chord)
        return np.asarray(np.maximum(fillet, -self.heights(points).min(axis=1)))


@dataclass(frozen=True)
class Fillet:
    """A rounded inner edge and its radius, unit frame."""

    edge: Edge
    radius: float


def round_edges(
    images: Images, silhouettes: Volume, hull: Volume, faces: Sequence[Face]
) -> tuple[Volume, list[Face], list[Fillet]]:
    """Fill the inner edges at which views agree better about a fillet than about what the hull has there.

    Args:
        images: of all views.
        silhouettes: the visual hull, outside of which nothing is.
        hull: cut down to the faces.
        faces: confirmed ones.

    Returns:
        The hull with its fillets, the faces without what lies below these, and the fillets.
    """
    faces = list(faces)
    fillets: list[Fillet] = []
    rays: Rays | None = None
    scene: Scene | None = None  # of the hull as it is
    for i, j in itertools.combinations(range(len(faces)), 2):
        edge = inner_edge(faces[i], faces[j], hull.spacing)
        if edge is None:
            continue
        rays, scene = rays or rays_at_object(images), scene or hull.scene()
        found = _best(rays, edge, silhouettes, hull, scene)
        if found is not None:
            (radius, hull), scene = found, None
            fillets.append(Fillet(edge, radius))
            under = edge.tangent_length(radius)
            faces[i], faces[j] = (_clear_of(faces[k], edge, under) for k in (i, j))
    return hull, [face for face in faces if face.outline.any()], fillets


def inner_edge(face: Face, other: Face, spacing: float) -> Edge | None:
    """The inner edge in which two faces' planes meet, or None if they don't, or not beside both faces."""
    if not (face.outline.any() and other.outline.any()):
        return None
    normals = np.stack([face.lattice.normal, other.lattice.normal])
    cross = np.cross(*normals)
    sine = float(np.linalg.norm(cross))
    if sine < _LEAST_SINE:
        return None
    direction = cross / sine
    offsets = [float(face.lattice.origin @ normals[0]), float(other.lattice.origin @ normals[1]), 0.0]
    point = np.linalg.solve(np.stack([*normals, direction]), offsets)
    least, most, reach = -np.inf, np.inf, np.inf
    for one, ahead in ((face, normals[1]), (other, normals[0])):
        cells = one.lattice.centers()[one.outline] - point
        height = cells @ ahead
        if (height > -spacing).mean() < _LEAST_FRONT:
            return None
        distance, along = height / sine, cells @ direction
        near = distance < max(_MOST_RADIUS, float(distance.min()) + spacing)
        half = one.lattice.pitch / 2  # of a cell
        least, most = max(least, float(along[near].min()) - half), min(most, float(along[near].max()) + half)
        within = (along >= least) & (along <= most)
        if not within.any():
            return None
        reach = min(reach, float(distance[within].max()))
        if float(distance[within].min()) > _MOST_RADIUS:
            return None
    if most - least < _LEAST_LENGTH_VOXELS * spacing:
        return None
    return Edge(point, direction, normals, (least, most), reach)


def _best(rays: Rays, edge: Edge, silhouettes: Volume, hull: Volume, scene: Scene) -> tuple[float, Volume] | None:
    """Radius of the fillet about which views agree best, and the hull with it, or None if it is no better.

    `scene` is the hull's surface.
    """
    largest = min(_MOST_RADIUS, edge.radius(edge.reach))
    smallest = _LEAST_RADIUS_VOXELS * hull.spacing
    if largest < smallest:
        return None
    local = _Local(edge, silhouettes, hull, edge.tangent_length(largest))
    if not _has_surface(local.hull):
        return None
    concerned = rays.hitting(scene, lambda points: edge.corner(points, local.length, hull.spacing))
    before = concerned.costs(local.scene(local.hull))
    if before[1].sum() < _LEAST_RAYS:
        return None
    trials = _Trials(concerned, local)
    trials.measure(np.geomspace(smallest, largest, _RADII))
    if not trials.costs or trials.mean(trials.lowest()) >= mean_cost(before):
        return None
    ratio = (largest / smallest) ** (1 / (_RADII - 1))
    trials.measure(np.geomspace(trials.lowest() / ratio, trials.lowest() * ratio, _FINER + 2)[1:-1])
    radius = trials.between()
    trials.measure(np.array([radius]))
    if radius not in trials.costs:
        return None
    sure = concerned.advantage(before, trials.costs[radius]) > SURE
    if not sure or trials.mean(radius) > _GAIN * mean_cost(before):
        return None
    logger.info(
        "fillet of radius %.3f: views disagree by %.2f for %.2f of the sharp edge",
        radius, trials.mean(radius), mean_cost(before),
    )  # fmt: skip
    return radius, local.merged(local.rounded(radius))


def _has_surface(field: NDArray[np.float32]) -> bool:
    """Whether a field (K, L, M) changes its sign."""
    return bool(field.min() < 0 < field.max())


class _Trials:
    """What views say about fillets of several radii."""

    def __init__(self, rays: Rays, local: "_Local") -> None:
        self.rays, self.local = rays, local
        self.costs: dict[float, Costs] = {}

    def measure(self, radii: Array) -> None:
        """Try some radii (N,)."""
        for radius in map(float, radii):
            field = self.local.rounded(radius)
            if _has_surface(field):
                self.costs[radius] = self.rays.costs(self.local.scene(field))

    def mean(self, radius: float) -> float:
        """How much they disagree about one; infinite where too few rays tell."""
        costs = self.costs[radius]
        return mean_cost(costs) if costs[1].sum() >= _LEAST_RAYS else np.inf

    def lowest(self) -> float:
        """The radius about which they disagree least."""
        return min(self.costs, key=lambda radius: (self.mean(radius), radius))

    def between(self) -> float:
        """The radius at the bottom of the parabola through the lowest and its neighbours."""
        radii = sorted(self.costs)
        k = radii.index(self.lowest())
        if not 0 < k < len(radii) - 1:
            return radii[k]
        three = np.array(radii[k - 1 : k + 2])
        costs = np.array([self.mean(r) for r in three])
        if not np.isfinite(costs).all():
            return radii[k]
        slopes = np.diff(costs) / np.diff(three)
        second = (slopes[1] - slopes[0]) / (three[2] - three[0])
        return float((three[0] + three[1]) / 2 - slopes[0] / (2 * second)) if second > 0 else radii[k]


class _Local:
    """The part of a hull around an inner edge."""

    def __init__(self, edge: Edge, silhouettes: Volume, hull: Volume, length: float) -> None:
        self.edge, self.whole, self.length = edge, hull, length + _PAST_VOXELS * hull.spacing
        corners = np.array([c for s in edge.span for c in _corners(edge, s, self.length)])
        margin = _PAST_VOXELS * hull.spacing
        low = np.floor((corners.min(axis=0) - margin - hull.origin) / hull.spacing).astype(int)
        high = np.ceil((corners.max(axis=0) + margin - hull.origin) / hull.spacing).astype(int) + 1
        shape = np.array(hull.field.shape)
        self.part = tuple(slice(max(a, 0), min(b, n)) for a, b, n in zip(low, high, shape, strict=True))
        self.hull, self.silhouettes = hull.field[self.part], silhouettes.field[self.part]
        steps = [hull.origin[k] + hull.spacing * np.arange(s.start, s.stop) for k, s in enumerate(self.part)]
        self.points = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
        self.origin = np.array([s[0] for s in steps])

    def rounded(self, radius: float) -> NDArray[np.float32]:
        """The field with a fillet and nothing else in the corner."""
        length = self.edge.tangent_length(radius) + _PAST_VOXELS * self.whole.spacing
        corner = self.edge.corner(self.points, length, _BEHIND_VOXELS * self.whole.spacing).reshape(self.hull.shape)
        filled = np.minimum(self.edge.filled(self.points, radius).reshape(self.hull.shape), self.silhouettes)
        return np.where(corner, filled, self.hull).astype(np.float32)

    def scene(self, field: NDArray[np.float32]) -> Scene:
        """The surface of a field here."""
        return Scene(*replace(self.whole, field=field, origin=self.origin).mesh())

    def merged(self, field: NDArray[np.float32]) -> Volume:
        """The whole hull with a field here."""
        result = self.whole.field.copy()
        result[self.part] = field
        return self.whole.with_field(result)


def _corners(edge: Edge, along: float, length: float) -> Iterator[Array]:
    """Three points (3,) of an edge's corner at one position along it."""
    point = edge.point + along * edge.direction
    yield point
    for k in range(2):
        ahead = edge.normals[1 - k] - edge.cosine * edge.normals[k]
        yield point + length * ahead / np.linalg.norm(ahead)


def _clear_of(face: Face, edge: Edge, distance: float) -> Face:
    """A face without the cells that lie nearer to an edge, along its span."""
    inside = edge.corner(face.lattice.centers().reshape(-1, 3), distance, face.lattice.pitch)
    return replace(face, outline=face.outline & ~inside.reshape(face.outline.shape))
