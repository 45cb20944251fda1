"""Rooms over a floor: between ribs on a plate, around the foot of a hexagon on a flange, in a box with tubes.

A hull fills such a room up to whatever silhouettes graze, in facets of any direction, so it often has no lid. But about
its floor views agree, those that see it. Which do is told by what stands in the room: all of it is taken away at first,
and comes back where views differ. At the height of a floor views agree about more of a plane than above or below it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.agreement import Rays, better, disagreements, rays_at_object
from brepgaussian.splatting.concave.floors import AT_FIRST, COARSELY, FINELY, Floor, lattice_of
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.planes import PARALLEL, Plane, planar_regions
from brepgaussian.splatting.concave.prism import Lattice, over
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume

Array = NDArray[np.float64]
Cells = NDArray[np.bool_]

_SWEPT_CELLS = 60  # along the longer side of a lattice that only tells heights
_MOST_DIRECTIONS = 6  # of floors
_STEP_VOXELS = 2.0  # between heights
_PEAK_STEPS = 2  # on either side, among which a floor has most cells
_SKIN_VOXELS = (0.8, 5.0)  # under a face that is known: there views agree about that
_NEAR_VOXELS = 1.5  # a floor that is so near to a face that is known is that
_MOST_FLOORS = 10  # that are looked at, largest first
_LEAST_WIDTH_PIXELS = 14.0  # of a room
_LID_COST = 0.3  # tolerances, capped, by which views differ on what the hull has over a room, at least: .5-2 measured
_SHOWN_COST = 0.15  # on a face that the hull shows, at most; hulls over rooms have .3 and more
_NEAR_CELLS = 1  # of a lattice that only tells heights, on either side, whose rays say so
_LID_VOXELS = 1.5  # by which a lid is rough
_LID_SHARE = 0.6  # of what the hull has over a pocket is one, and of what it has beside it
_FRAME_CELLS = (2, 6)  # beside it
_GAIN = 0.7  # of the disagreement is left at most: .25-.55 on true ones; beside those that are still filled more
_LEAST_RAYS = 60
_REACH_VOXELS = 2.0  # rays on which a room changes less than this don't judge it

logger = log.get_logger("stage1")


def open_levels(images: Images, hull: Volume, planes: Sequence[Plane]) -> Volume:
    """Carve the rooms over a hull's faces, and over floors parallel to these, but for pockets.

    These have a lid, and the outline of their opening tells them more exactly.

    Args:
        images: of all views.
        hull: what silhouettes leave, faces flattened.
        planes: of the faces that views have confirmed, best known first.

    Returns:
        The opened hull.
    """
    if not planes:
        return hull
    least = (_LEAST_WIDTH_PIXELS * images.views.cameras.footprint()) ** 2
    seen = _Seen.of(hull, rays_at_object(images))
    swept = [peak for normal in _directions(planes) for peak in _peaks(images, seen, normal, planes)]
    likely = [plane for area, plane in sorted(swept, key=lambda peak: -peak[0]) if area >= least]
    looked = 0
    for plane in [*planes, *_shown(seen, planes), *likely]:
        floor = Floor.of(images, seen.hull, plane)
        room = floor.shares(images) >= AT_FIRST
        if floor.area(room) < least or seen.differs_over(floor, room) < _LID_COST:
            continue
        looked += 1
        for base, part in _rooms(images, seen, floor, planes, least):
            if seen.differs_over(base, part) >= _LID_COST:
                seen = seen.opened(images, base, part)
        if looked >= _MOST_FLOORS:
            break
    return seen.hull


def _shown(seen: "_Seen", planes: Sequence[Plane]) -> Iterator[Plane]:
    """Planes of a hull's flat regions about which views agree, beyond those that are known: tops of ribs, slopes."""
    mesh = seen.scene.vertices, seen.scene.triangles
    for region in planar_regions(*mesh, 2 * seen.hull.spacing, planes):
        if any(plane.is_of(region, 2 * seen.hull.spacing) for plane in planes):
            continue
        corners = mesh[0][mesh[1][region.triangles]].reshape(-1, 3)
        low, high = corners.min(axis=0) - seen.hull.spacing, corners.max(axis=0) + seen.hull.spacing
        on = (np.abs(seen.at @ region.normal - region.offset) < seen.hull.spacing) & (seen.at > low).all(axis=1)
        on &= (seen.at < high).all(axis=1)
        if on.any() and seen.costs[on].mean() < _SHOWN_COST:
            yield Plane(region.normal, region.offset)


def _rooms(
    images: Images, seen: "_Seen", floor: Floor, planes: Sequence[Plane], least: float
) -> Iterator[tuple[Floor, Cells]]:
    """Rooms (R, C) over a floor, or over the one that it nearly is, largest first."""
    room = floor.room(images)
    near = [p for p in planes if p.normal @ floor.lattice.normal > PARALLEL and _is_near(p, floor)]
    if floor.area(room) < least or (not near and seen.has_lid(floor, room)):
        return
    floor = Floor.of(images, seen.hull, near[0]) if near else floor.settled(images, room, COARSELY, FINELY)
    room = floor.room(images)
    if floor.area(room) < least or not seen.agrees(images, floor, room):
        return
    room = floor.grown(images, room)
    if not near:
        floor = floor.settled(images, room, FINELY)
        room = floor.surely(images, room)
    labels, count = ndimage.label(room)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)[1:] * floor.lattice.pitch**2
    for k in [k for k in np.argsort(-sizes, kind="stable") if sizes[k] >= least]:
        if near or not seen.has_lid(floor, labels == k + 1):
            yield floor, labels == k + 1


def _is_near(plane: Plane, floor: Floor) -> bool:
    return abs(plane.offset - floor.lattice.offset) < _NEAR_VOXELS * floor.hull.spacing


@dataclass(frozen=True)
class _Seen:
    """A hull, rays at it, its surface, (N, 3) where they hit that, and (N,) by how much they differ, in tolerances."""

    hull: Volume
    rays: Rays
    scene: Scene
    at: Array
    costs: Array

    @staticmethod
    def of(hull: Volume, rays: Rays, scene: Scene | None = None) -> "_Seen":
        """What rays say of a hull (whose surface may be given)."""
        scene = scene or hull.scene()
        return _Seen(hull, rays, scene, *rays.told(scene))

    def differs_over(self, floor: Floor, room: Cells) -> float:
        """Mean of what rays differ by that hit the hull over cells (R, C) of a floor."""
        within, height = over(floor.lattice, room, self.at)
        above = within & (height > 0)
        return float(self.costs[above].mean()) if above.any() else 0.0

    def over_cells(self, lattice: Lattice) -> tuple[NDArray[np.int64], Array, Array]:
        """(M,) cells of a lattice that rays hit the hull over, (M,) how high above it, and (M,) by what they differ."""
        at, height = lattice.coordinates(self.at)
        index = np.round(at).astype(int)
        inside = (index >= 0).all(axis=1) & (index < lattice.shape).all(axis=1)
        return np.ravel_multi_index(tuple(index[inside].T), lattice.shape), height[inside], self.costs[inside]

    def has_lid(self, floor: Floor, room: Cells) -> bool:
        """Whether most of what the hull has over cells (R, C) of a floor is parallel to it, and goes on around them."""
        within, height = over(floor.lattice, room, self.at)
        above = np.sort(height[within & (height > 0)])
        if not len(above):
            return False
        thick = 2 * _LID_VOXELS * self.hull.spacing
        count = np.searchsorted(above, above + thick) - np.arange(len(above))
        best = int(count.argmax())
        if count[best] <= _LID_SHARE * len(above):
            return False
        near, far = (ndimage.binary_dilation(room, iterations=n) for n in _FRAME_CELLS)
        beside, height = over(floor.lattice, far & ~near, self.at)
        level = (height > above[best]) & (height < above[best] + thick)
        return bool((beside & level).sum() > _LID_SHARE * (beside & (height > -thick)).sum())

    def agrees(self, images: Images, floor: Floor, room: Cells) -> bool:
        """Whether views agree better without what stands over cells (R, C) of a floor."""
        said = self._said(images, floor.without(self.hull, room).scene())
        return better(said, _GAIN, _LEAST_RAYS, untold=False)

    def opened(self, images: Images, floor: Floor, room: Cells) -> "_Seen":
        """The hull without what stands over a room (R, C), if views agree much better then."""
        opened = floor.without(self.hull, room)
        after = opened.scene()
        said = self._said(images, after)
        good = better(said, _GAIN, _LEAST_RAYS, untold=False)
        logger.info(
            "room of area %.4f over a floor with normal %s at %.4f: views disagree by %.2f for %.2f of the hull, "
            "%d rays%s",
            floor.area(room), np.round(floor.lattice.normal, 2).tolist(), floor.lattice.offset, said[1], said[0],
            said[2], "" if good else ": not believed",
        )  # fmt: skip
        return _Seen.of(opened, self.rays, after) if good else self

    def _said(self, images: Images, after: Scene) -> tuple[float, float, int]:
        return disagreements(images, self.scene, after, _REACH_VOXELS * self.hull.spacing, self.rays)


def _directions(planes: Sequence[Plane]) -> list[Array]:
    """Unit normals (3,) that floors may have: those of faces, and their opposites."""
    found: list[Array] = []
    for plane in planes:
        for normal in (plane.normal, -plane.normal):
            if all(normal @ other < PARALLEL for other in found):
                found.append(normal)
    return found[:_MOST_DIRECTIONS]


def _peaks(images: Images, seen: _Seen, normal: Array, planes: Sequence[Plane]) -> Iterator[tuple[float, Plane]]:
    """Planes on which views agree about more than above or below them, and the area about which they do."""
    hull = seen.hull
    low, high = float((hull.box @ normal).min()), float((hull.box @ normal).max())
    step = _STEP_VOXELS * hull.spacing
    offsets = np.arange(low + step, high - step, step)
    known = np.array([p.offset for p in planes if p.normal @ normal > PARALLEL])
    under = (known[:, None] - offsets) / hull.spacing
    offsets = offsets[~((under > _SKIN_VOXELS[0]) & (under < _SKIN_VOXELS[1])).any(axis=0)]
    lattice = lattice_of(images, hull, Plane(normal, 0.0), _SWEPT_CELLS)
    places, heights, costs = seen.over_cells(lattice)
    if not ndimage.binary_opening(_doubtful(places, costs, lattice.shape)).any():
        return
    areas = np.zeros(len(offsets))
    for k, offset in enumerate(offsets):
        above = heights > offset
        doubtful = _doubtful(places[above], costs[above], lattice.shape)
        areas[k] = _agreed_area(images, Floor.of(images, hull, Plane(normal, float(offset)), _SWEPT_CELLS, doubtful))
    for k, area in enumerate(areas):
        if area == areas[max(k - _PEAK_STEPS, 0) : k + _PEAK_STEPS + 1].max():
            yield float(area), Plane(normal, float(offsets[k]))


def _doubtful(places: NDArray[np.int64], costs: Array, shape: tuple[int, int]) -> Cells:
    """(R, C) cells over which rays differ on the hull: under a face all of one grey any plane seems to be a floor.

    Args:
        places, costs: (M,) cells that rays hit the hull over, and by what they differ there.
        shape: of the lattice.
    """
    cells = int(np.prod(shape))
    sums = np.bincount(places, costs, cells), np.bincount(places, minlength=cells).astype(float)
    cost, count = (ndimage.uniform_filter(s.reshape(shape), 2 * _NEAR_CELLS + 1) for s in sums)
    return np.asarray(cost >= _LID_COST * count)


def _agreed_area(images: Images, floor: Floor) -> float:
    """Area of a floor's cells about which views agree, if nothing is in their way.

    Each counts by how many do more than by chance: about what lies a little off a floor fewer do.
    """
    more = np.maximum(floor.shares(images) - AT_FIRST, 0) / (1 - AT_FIRST)
    return floor.area(np.where(ndimage.binary_opening(more > 0), more, 0.0))
