"""Planes across a hull as floors of what it fills: about which cells views agree, once what is above is gone."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.splatting.concave.openings import LEAST_COSINE, Images, grey_at, visible
from brepgaussian.splatting.concave.planes import PITCH_PIXELS, Plane
from brepgaussian.splatting.concave.prism import Lattice, Prism, plane_axes, signed_outline
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.sample import sample

Array = NDArray[np.float64]
Cells = NDArray[np.bool_]

_MOST_CELLS = 120  # along the longer side of a lattice
_COARSE = 2  # nodes of the hull for one of the hull that hides cells
_STANDS_VOXELS = 1.5  # over a plane, where it stands on a cell
_LIFT_CELLS = 3.0  # above its cell a ray starts: off the hull's own roughness
_LEAST_VIEWS = 3  # that see a cell, before they judge it
_TOLERANCES = 2.0  # by which a place may differ from view to view: in a corner its grey changes from cell to cell
AT_FIRST = 0.28  # of all views agree about a cell: floors have .3-.8, for other views see walls; others .05-.2
_AGREE = (0.4, 0.55, 0.7, 0.8, 0.85, 0.85)  # of those that see it, in one round after another
_SURE = 0.8  # from here on cells that too few views see are none
_SMOOTH_CELLS = 2  # narrower parts of a room are blur
_GROWTH_CELLS = 3  # by which a room may grow in a round: deep in a corner few of all views see the floor,
_STAYS = 0.7  # if so many that see it agree,
_MOST_GROWTHS = 16  # rounds,
_SETTLED = 0.01  # until no larger share of it is new
_BESIDE_CELLS = 3  # a room that may grow where its floor is moved
COARSELY = np.linspace(-6, 6, 13)  # voxels by which a floor is moved,
FINELY = np.linspace(-0.75, 0.75, 7)  # and then


@dataclass(frozen=True)
class Floor:
    """A plane across a hull.

    Attributes:
        hull: what stands on it.
        lattice: on the plane, over all of the hull.
        covered: (R, C) cells that the hull stands on.
        grey: (V, R, C) levels that views show at these, if nothing is in their way: -1 on background, NaN untold.
        top: height up to which the hull stands on it.
    """

    hull: Volume
    lattice: Lattice
    covered: Cells
    grey: NDArray[np.float32]
    top: float

    @staticmethod
    def of(images: Images, hull: Volume, plane: Plane, most: int = _MOST_CELLS, some: Cells | None = None) -> "Floor":
        """A plane across a hull, in at most so many cells along its longer side: all of them, or some (R, C)."""
        lattice = lattice_of(images, hull, plane, most)
        cells = lattice.centers().reshape(-1, 3)
        below, above = (
            sample(hull.field, (cells + v * hull.spacing * plane.normal - hull.origin) / hull.spacing, -hull.spacing)
            for v in (-_STANDS_VOXELS, _STANDS_VOXELS)
        )
        covered = ((below > 0) & (above > 0)).reshape(lattice.shape)
        if some is not None:
            covered &= some
        grey = np.full((len(images.views.cameras), *lattice.shape), np.nan, np.float32)
        grey[:, covered] = _greys(images, plane.normal, cells[covered.ravel()])
        return Floor(hull, lattice, covered, grey, float((hull.box @ plane.normal).max()) - plane.offset)

    def area(self, cells: NDArray[np.generic]) -> float:
        """Area of some cells (R, C), or of shares of them."""
        return float(cells.sum()) * self.lattice.pitch**2

    def shares(self, images: Images) -> Array:
        """(R, C) share of all views that agree about each covered cell; 0 elsewhere."""
        found = np.zeros(self.covered.shape)
        found[self.covered] = _agreement(self.grey[:, self.covered], _TOLERANCES * images.tolerance)[0]
        return found

    def without(self, hull: Volume, room: Cells) -> Volume:
        """A hull without all that it has over cells (R, C)."""
        return hull.without(Prism(self.lattice, room, 0.0, False, 0.0), self.top)

    @cached_property
    def _coarse(self) -> tuple[Volume, NDArray[np.int64], Array, Array]:
        """The hull on a coarser grid; (N,) nodes of it above the plane, (N, 2) over which cells, (N,) how high."""
        coarse = np.ascontiguousarray(self.hull.field[(slice(None, None, _COARSE),) * 3])
        hull = Volume(coarse, self.hull.origin, _COARSE * self.hull.spacing)
        steps = [hull.origin[k] + hull.spacing * np.arange(n) for k, n in enumerate(coarse.shape)]
        nodes = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
        cells, heights = self.lattice.coordinates(nodes)
        near = (heights > -hull.spacing) & (coarse.ravel() > -hull.spacing)
        above = np.flatnonzero(
            near & (cells >= 0).all(axis=1) & (cells <= np.array(self.lattice.shape) - 1).all(axis=1)
        )
        return hull, above, cells[above], heights[above]

    def _hiding(self, room: Cells) -> Volume:
        """The hull, coarsely, without all that it has over cells (R, C)."""
        hull, nodes, cells, heights = self._coarse
        lateral = ndimage.map_coordinates(signed_outline(room), cells.T, order=1) * self.lattice.pitch
        field = hull.field.ravel().copy()
        field[nodes] = np.minimum(field[nodes], np.maximum(lateral, -heights))
        return hull.with_field(field.reshape(hull.field.shape))

    def told(self, images: Images, room: Cells, least: float, untold: bool = False) -> Cells:
        """The cells (R, C) of a room about which so many views agree that see them, once all of it is gone.

        Args:
            images: of all views.
            room: (R, C).
            least: share of them.
            untold: whether cells that hardly any view sees stay.
        """
        kept = room & self.covered
        if not kept.any():
            return kept
        hiding = self._hiding(kept).scene()
        seen = _visible(images, hiding, self.lattice, self.lattice.centers()[kept])
        agree, count = _agreement(np.where(seen, self.grey[:, kept], np.nan), _TOLERANCES * images.tolerance)
        kept[kept] = np.where(count >= _LEAST_VIEWS, agree >= least, untold)
        return kept

    def room(self, images: Images) -> Cells:
        """(R, C) cells about which nearly all views agree that see them, without what covers them."""
        room = self.shares(images) >= AT_FIRST
        for least in _AGREE:
            room = self.told(images, room, least, untold=least < _SURE)
        return _opened(room)

    def grown(self, images: Images, room: Cells) -> Cells:
        """A room (R, C) with what is beside it, as far as views agree."""
        for _ in range(_MOST_GROWTHS):
            before, room = room, _opened(room)
            wide = ndimage.binary_dilation(room, iterations=_GROWTH_CELLS) & self.covered
            if not (wide & ~room).any():
                break
            # with the wide one a rib's foot is gone, too, and views past it speak against the room
            room = self.told(images, _opened(room | self.told(images, wide, _STAYS)), _STAYS)
            if (room & ~before).sum() <= _SETTLED * room.sum():
                break
        return self.surely(images, room)

    def surely(self, images: Images, room: Cells) -> Cells:
        """(R, C) the cells of a room about which nearly all views agree."""
        return _opened(self.told(images, room, _AGREE[-1]))

    def settled(self, images: Images, room: Cells, *moves: Array) -> "Floor":
        """The plane moved by some voxels, to where views that see a room (R, C) agree about most of it."""
        hull, normal = self.hull, self.lattice.normal
        scene = self.without(hull, room).scene()
        cells = self.lattice.centers()[ndimage.binary_dilation(room, iterations=_BESIDE_CELLS)]

        def agreed(height: float) -> int:
            places = cells + height * normal
            seen = _visible(images, scene, self.lattice, places)
            agree, count = _agreement(np.where(seen, _greys(images, normal, places), np.nan), images.tolerance)
            return int(np.count_nonzero((count >= _LEAST_VIEWS) & (agree >= _AGREE[-1])))

        best = 0.0
        for some in moves:
            best = max((best + float(move) * hull.spacing for move in some), key=agreed)
        return Floor.of(images, hull, Plane(normal, self.lattice.offset + best))


def lattice_of(images: Images, hull: Volume, plane: Plane, most: int) -> Lattice:
    """Cells of a plane over the box around a hull, about as fine as pixels see it, at most so many along a side."""
    first, second = plane_axes(plane.normal)
    flat = np.column_stack([hull.box @ first, hull.box @ second])
    low, high = flat.min(axis=0), flat.max(axis=0)
    pitch = max(PITCH_PIXELS * images.views.cameras.footprint(), float((high - low).max()) / most)
    rows, columns = np.ceil((high - low) / pitch).astype(int)
    origin = low[0] * first + low[1] * second + plane.offset * plane.normal
    return Lattice(origin, first, second, plane.normal, pitch, (int(rows), int(columns)))


def _opened(room: Cells) -> Cells:
    return np.asarray(ndimage.binary_opening(room, iterations=_SMOOTH_CELLS))


def _agreement(grey: NDArray[np.float32], tolerance: float) -> tuple[Array, NDArray[np.int64]]:
    """(N,) share of the views of each place that show about what half of them do, and (N,) how many views it has.

    Args:
        grey: (V, N) levels, -1 on background, NaN unseen.
        tolerance: grey levels.
    """
    count = np.isfinite(grey).sum(axis=0)
    ordered = np.sort(grey, axis=0)  # NaN last
    common = np.take_along_axis(ordered, np.maximum(count - 1, 0)[None] // 2, axis=0)[0]
    with np.errstate(invalid="ignore"):
        same = (np.abs(grey - common) <= tolerance) & (grey >= 0)
    return same.sum(axis=0) / np.maximum(count, 1), count


def _greys(images: Images, normal: Array, cells: Array) -> NDArray[np.float32]:
    """(V, N) grey levels of cells (N, 3) of a plane, -1 on background, NaN on contours and from behind the plane."""
    cameras = images.views.cameras
    grey = np.full((len(cameras), len(cells)), np.nan, np.float32)
    for view, center in enumerate(cameras.centers):
        sight = center - cells
        index = np.flatnonzero(sight @ normal > LEAST_COSINE * np.linalg.norm(sight, axis=1))
        grey[view, index] = grey_at(images, view, cells[index])
    return grey


def _visible(images: Images, scene: Scene, lattice: Lattice, cells: Array) -> NDArray[np.bool_]:
    """(V, N) which cells (N, 3) each view sees past a hull."""
    seen = np.zeros((len(images.views.cameras), len(cells)), bool)
    normals = np.broadcast_to(lattice.normal, cells.shape)
    for view, center in enumerate(images.views.cameras.centers):
        seen[view, visible(scene, cells, normals, center, _LIFT_CELLS * lattice.pitch)] = True
    return seen
