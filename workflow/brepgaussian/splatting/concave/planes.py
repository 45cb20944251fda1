"""Planar regions of a hull's mesh, largest first: where lids can lie."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.concave.prism import Lattice, plane_axes

Array = NDArray[np.float64]

PITCH_PIXELS = 1.25  # a cell a little larger than a pixel's footprint
_MAXIMUM_CELLS = 160_000  # per plane: a larger plane gets a coarser lattice
_MAXIMUM_PLANES = 40  # more planar faces than this are left to the surfels
_DIRECTION_BINS = 12  # a bin of normals is about 5 degrees wide
_SAME_DIRECTION = 0.97  # cosine of 14 degrees: marching-cubes normals scatter
_NEAR_DIRECTION = 0.9  # cosine of 26 degrees: fits turn by less than the difference
_MINIMUM_AREA = 0.002  # smaller lids hide nothing that a few pixels could show
_REFITS = 6
_BELOW = 0.99  # weight of what lies below a plane: a hull touches a face along contours and bulges between them
PARALLEL = 0.999  # cosine of 2.5 degrees: a region of which a part bulges is turned by less
_ON_PLANE = 0.9  # of a region's triangles lie on a plane that is its own
_MAXIMUM_TURN = 0.25  # rad: a strip of a cylinder turns more from one side to the other, a lid does not


@dataclass(frozen=True)
class Plane:
    """A plane `normal . x = offset` with an outward unit normal (3,)."""

    normal: Array
    offset: float

    def is_of(self, other: "Plane", near: float) -> bool:
        """Whether another plane is the same one, slightly turned or off; planes near the frame's origin, that is."""
        middle = other.offset * other.normal
        return bool(self.normal @ other.normal > PARALLEL and abs(middle @ self.normal - self.offset) < near)


@dataclass(frozen=True)
class PlanarRegion(Plane):
    """A plane and the triangles that lie on it.

    Attributes:
        triangles: (M,) indices.
        bend: angle by which their normals turn steadily from one side to the other, rad.
    """

    triangles: NDArray[np.int64]
    bend: float = 0.0

    def area(self, vertices: Array, triangles: NDArray[np.int64]) -> float:
        """Area of its triangles."""
        a, b, c = (vertices[triangles[self.triangles, k]] for k in range(3))
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)

    def turn(self, vertices: Array, triangles: NDArray[np.int64]) -> float:
        """Angle by which its triangles are turned against it, root mean square by area, rad."""
        a, b, c = (vertices[triangles[self.triangles, k]] for k in range(3))
        cross = np.cross(b - a, c - a)
        twice = np.linalg.norm(cross, axis=1)
        alike = np.clip(cross @ self.normal / np.maximum(twice, 1e-15), -1, 1)
        return float(np.sqrt(np.average(np.arccos(alike) ** 2, weights=twice)))

    def on(self, planes: Sequence[Plane], vertices: Array, triangles: NDArray[np.int64], near: float) -> "PlanarRegion":
        """The same triangles on that of the given planes within `near` of which most of them lie, if there is one.

        Of two faces on one plane views may have confirmed one alone, and slightly turned.
        """
        middles = vertices[triangles[self.triangles]].mean(axis=1)  # (M, 3)
        off = [
            float(np.quantile(np.abs(middles @ p.normal - p.offset), _ON_PLANE)) if p.normal @ self.normal > PARALLEL
            else np.inf
            for p in planes
        ]  # fmt: skip
        if not off or min(off) > near:
            return self
        best = planes[int(np.argmin(off))]
        return replace(self, normal=best.normal, offset=best.offset)

    def lattice(self, vertices: Array, triangles: NDArray[np.int64], pitch: float) -> Lattice:
        """A lattice over the bounding rectangle of the region."""
        first, second = plane_axes(self.normal)
        points = vertices[triangles[self.triangles]].reshape(-1, 3)
        flat = np.column_stack([points @ first, points @ second])
        low, high = flat.min(axis=0), flat.max(axis=0)
        rows, columns = np.ceil((high - low) / pitch).astype(int)
        origin = low[0] * first + low[1] * second + self.offset * self.normal
        return Lattice(origin, first, second, self.normal, pitch, (int(rows), int(columns)))


def axes_of(ways: Sequence[Array]) -> list[Array]:
    """Each of several unit directions (3,) once, whichever way it points."""
    found: list[Array] = []
    for way in ways:
        if all(abs(way @ other) < PARALLEL for other in found):
            found.append(way)
    return found


def lattice_over(region: PlanarRegion, mesh: tuple[Array, NDArray[np.int64]], footprint: float) -> Lattice:
    """A lattice over a region of a mesh about as fine as pixels of a `footprint` see it."""
    lattice = region.lattice(*mesh, PITCH_PIXELS * footprint)
    if np.prod(lattice.shape) > _MAXIMUM_CELLS:
        lattice = region.lattice(*mesh, lattice.pitch * float(np.sqrt(np.prod(lattice.shape) / _MAXIMUM_CELLS)))
    return lattice


def planar_regions(
    vertices: Array, triangles: NDArray[np.int64], tolerance: float, known: Sequence[Plane] = ()
) -> list[PlanarRegion]:
    """Find planes on which much of a mesh lies.

    Args:
        vertices: (K, 3); triangles: (T, 3), counter-clockwise from outside.
        tolerance: distance within which a triangle lies on a plane (the hull's cell).
        known: planes on which some of it lies; a fit would lean towards what is left of a lid just below one.
    """
    normals, areas, centers = _measures(vertices, triangles)
    free = areas > 0
    found: list[PlanarRegion] = []
    for plane in known:
        near = free & (np.abs(centers @ plane.normal - plane.offset) < tolerance)
        on = np.flatnonzero(near & (normals @ plane.normal > _SAME_DIRECTION))
        if areas[on].sum() >= _MINIMUM_AREA:
            found.append(PlanarRegion(plane.normal, plane.offset, on))
            free[on] = False
    while len(found) < _MAXIMUM_PLANES:
        seed = _dominant(normals, areas, centers, free, tolerance)
        if seed is None:
            break
        normal, members = seed
        normal, offset, members = _refit(normal, members, normals, areas, centers, free, tolerance)
        large = len(members) > 0 and areas[members].sum() >= _MINIMUM_AREA
        bend = _bend(normal, normals[members], centers[members], areas[members]) if large else 0.0
        if large and bend <= _MAXIMUM_TURN:
            found.append(PlanarRegion(normal, offset, members, bend))
        free[members] = False
        free[seed[1]] = False
    return found


def region_on(plane: Plane, vertices: Array, triangles: NDArray[np.int64], tolerance: float) -> PlanarRegion | None:
    """What lies on a plane that is known, if it is large enough; arguments are those of `planar_regions`."""
    normals, areas, centers = _measures(vertices, triangles)
    near = np.abs(centers @ plane.normal - plane.offset) < tolerance
    on = np.flatnonzero(near & (normals @ plane.normal > _SAME_DIRECTION))
    return PlanarRegion(plane.normal, plane.offset, on) if areas[on].sum() >= _MINIMUM_AREA else None


def _measures(vertices: Array, triangles: NDArray[np.int64]) -> tuple[Array, Array, Array]:
    """Unit normals (T, 3), areas (T,) and middles (T, 3) of triangles; zero normals of those without area."""
    corners = vertices[triangles]  # (T, 3, 3)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(cross, axis=1) / 2
    return cross / np.maximum(2 * areas, 1e-15)[:, None], areas, corners.mean(axis=1)


def _dominant(
    normals: Array, areas: Array, centers: Array, free: NDArray[np.bool_], tolerance: float
) -> tuple[Array, NDArray[np.int64]] | None:
    """The direction and offset that hold most free area."""
    index = np.flatnonzero(free)
    if not len(index):
        return None
    side = 2 * _DIRECTION_BINS + 1
    bins = np.round(normals[index] * _DIRECTION_BINS).astype(int) + _DIRECTION_BINS
    code = (bins[:, 0] * side + bins[:, 1]) * side + bins[:, 2]
    weight = np.bincount(code, areas[index])
    best = int(weight.argmax())
    if weight[best] < _MINIMUM_AREA / 4:
        return None
    in_bin = index[code == best]
    normal = np.average(normals[in_bin], axis=0, weights=areas[in_bin])
    normal /= np.linalg.norm(normal)
    alike = index[normals[index] @ normal > _SAME_DIRECTION]
    cells = np.floor(centers[alike] @ normal / tolerance).astype(int)
    cells -= cells.min()
    area = np.bincount(cells, areas[alike])
    pair = area + np.append(area[1:], 0)  # two neighbouring cells, as a plane may lie on their border
    peak = int(pair.argmax())
    members = alike[(cells == peak) | (cells == peak + 1)]
    return normal, np.union1d(members, in_bin if areas[members].sum() < _MINIMUM_AREA else members)


def _refit(
    normal: Array,
    members: NDArray[np.int64],
    normals: Array,
    areas: Array,
    centers: Array,
    free: NDArray[np.bool_],
    tolerance: float,
) -> tuple[Array, float, NDArray[np.int64]]:
    offset = 0.0
    index = np.flatnonzero(free & (normals @ normal > _NEAR_DIRECTION))
    for fit in range(_REFITS):
        if len(members) < 3:
            break
        weights = areas[members]
        if fit:
            height = centers[members] @ normal - offset
            weights = weights * np.where(height > 0, 1 - _BELOW, _BELOW)
        mean = np.average(centers[members], axis=0, weights=weights)
        spread = centers[members] - mean
        smallest = np.linalg.eigh(spread.T @ (weights[:, None] * spread))[1][:, 0]
        normal = smallest * np.sign(smallest @ normal)
        offset = float(mean @ normal)
        near = index[np.abs(centers[index] @ normal - offset) < tolerance]
        members = near[normals[near] @ normal > _SAME_DIRECTION]
    return normal, offset, members


def _bend(normal: Array, normals: Array, centers: Array, areas: Array) -> float:
    """Angle by which the normals turn steadily along the region, as on a cylinder, rad."""
    axes = np.column_stack(plane_axes(normal))
    weights = areas / areas.sum()
    where = centers @ axes - weights @ (centers @ axes)  # (N, 2)
    turn = normals @ axes - weights @ (normals @ axes)
    moment = where.T @ (weights[:, None] * where) + 1e-12 * np.eye(2)
    shape = np.linalg.solve(moment, where.T @ (weights[:, None] * turn))  # (2, 2) change of normal per length
    bends, directions = np.linalg.eigh((shape + shape.T) / 2)
    # sides of a rectangle of this spread
    across = np.sqrt(12 * np.einsum("ij,ik,kj->j", directions, moment, directions))
    return float((np.abs(bends) * across).max())
