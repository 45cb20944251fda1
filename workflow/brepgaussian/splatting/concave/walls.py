"""Walls of concavities as faces: which surfel lies on which piece of which wall, and where exactly.

Pixels are as large as what tells a narrow wall's surfels apart, rays through the opening tell of the wall as a whole.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.log import get_logger
from brepgaussian.splatting.concave.agreement import better, disagreements
from brepgaussian.splatting.concave.bends import Bend
from brepgaussian.splatting.concave.draw import MOST_FAR, circle_about, fitted
from brepgaussian.splatting.concave.drilled import is_narrow
from brepgaussian.splatting.concave.openings import Images, opened, rectify
from brepgaussian.splatting.concave.prism import Lattice, Prism
from brepgaussian.splatting.concave.rims import at_rim
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.sections import PIECES, Section
from brepgaussian.splatting.concave.volume import Volume

Array = NDArray[np.float64]

_PARALLEL = 0.999  # cosine of 2.5 degrees
_SAME_CELLS = 1.5  # by which walls of one hole may seem to differ, seen from its two ends
_DRAWN_MEAN, _DRAWN_CELLS = 1.5, 4.0  # where views show the rim of one end only: a round hole's other is drawn square
_FEW_BEYOND = 0.1  # of its cells
_SAMPLES = 64  # of a section's border
_NOTABLE_CELLS = 0.7  # from a rim to the cells: less is what cells are off by
_FEW_RAYS = 20  # that tell something, for them to judge
_FAR_CELLS = 1.5  # of the hull; a surfel farther from a wall is not on it
_NUMBERS = PIECES + 1  # of a concavity: the pieces of its walls, its floor
_FLAT = np.cos(np.radians(25.0))  # of a surfel's normal and the floor's
_MOSTLY = 0.8  # of what lies deep inside is floor, or the floor is not flat
_ALIKE = np.cos(np.radians(35.0))  # of a surfel's normal and the wall's

logger = get_logger("stage1")


@dataclass(frozen=True)
class OnWalls:
    """Surfels and walls.

    Attributes:
        piece: (N,) number of the piece of a wall that a surfel lies on, -1 = none.
        foot: (N, 3) where on the wall; normal: (N, 3) the wall's there, out of the solid. Their own if on none.
    """

    piece: NDArray[np.int64]
    foot: Array
    normal: Array


def drawn(images: Images, scene: Scene, hull: Volume, prism: Prism, margin: float) -> Prism:
    """A concavity with the section that its outline is a drawing of, if there is one; views say exactly where.

    Args:
        images: of all views.
        scene, hull: before it is cut.
        prism: the concavity.
        margin: by which it is cut longer.
    """

    if prism.section is not None and is_narrow(prism.outline):
        return prism  # found by its rim
    rough = None if prism.domed else fitted(prism.outline, opened)
    if rough is None:
        return prism
    stack, centers = rectify(images, scene, prism.lattice), images.views.cameras.centers
    section = at_rim(rough, stack, centers, images.tolerance)
    if section is None or not section.at_rim:  # of a round opening, parts may look like the face around it
        around = at_rim(circle_about(prism.outline), stack, centers, images.tolerance)
        if around is not None and around.at_rim:
            rough = section = around  # the cells tell nothing to weigh it against
    if section is None:
        logger.info("opening of area %.4f: its rim is no %s", prism.area, rough.shape)
        return prism
    logger.info("opening of area %.4f: %s cells, misfit %.2f", prism.area, section.shape, section.misfit)
    at_cells, result = replace(prism, section=rough), replace(prism, section=section)
    if np.abs(rough.signed_distance(section.border(_SAMPLES))).max() < _NOTABLE_CELLS:
        return result
    # a chamfer's rim is wider than the wall below
    cut = [hull.without(one, margin).scene() for one in (at_cells, result)]
    old, new, count = said = disagreements(images, cut[0], cut[1], hull.spacing)
    wider = better(said, 1.0, _FEW_RAYS, untold=True)
    logger.info(
        "its rim for its cells: views disagree by %.2f for %.2f, %d rays%s",
        new,
        old,
        count,
        "" if wider else ": not taken",
    )
    return result if wider else at_cells


def agreed(prisms: Sequence[Prism]) -> list[Prism]:
    """The same concavities; those that tell of one hole from several sides have the section that is told best."""
    result = list(prisms)
    for k, first in _holes(result).items():
        if first != k:
            better, worse = sorted((first, k), key=lambda i: _doubt(_drawing(result[i])))
            result[worse] = _like(result[worse], result[better])
    told = [prism for prism in result if prism.section is not None and prism.section.at_rim]
    for k, prism in enumerate(result):
        if prism.section is None:
            ends = ((_like(prism, other), _are_ends(prism, other)) for other in told if _are_straight(prism, other))
            result[k] = next((end for end, opposite in ends if _fits(end, opposite)), prism)
    return result


def _like(prism: Prism, other: Prism) -> Prism:
    """A concavity with the walls of another one, whose end it is."""
    throat = _carried(_throat(other), other.lattice, prism.lattice)
    return replace(prism, section=throat.grown(_sink(prism)))


def _fits(prism: Prism, opposite: bool) -> bool:
    """Whether a concavity's section goes along its outline of cells, and holds all of it.

    It does so less where it is that of the `opposite` mouth, whose rim views show: there is no other hole.
    """
    outline, section = replace(prism, section=None), _drawing(prism)
    off = np.abs(outline.lateral(section.border(_SAMPLES))) / prism.lattice.pitch
    # a bore is open wherever the recess about its hub is looked into, and its border one of the recess's
    beyond = section.signed_distance(np.argwhere(prism.outline).astype(float)) >= MOST_FAR
    if opposite and _drawn_alike(off):
        return bool(beyond.mean() < _FEW_BEYOND)
    return bool(off.max() < MOST_FAR and not beyond.any())


def _holes(prisms: Sequence[Prism]) -> dict[int, int]:
    """Of every concavity with a section, the first one that has the same walls: a hole is seen from both its ends."""
    first: dict[int, int] = {}
    for k, prism in enumerate(prisms):
        if prism.section is not None:
            same = (i for i in first.values() if _same_walls(prisms[i], prism))
            first[k] = next(same, k)
    return first


def _doubt(section: Section) -> tuple[bool, float]:
    """What a section that is told better has less of."""
    return not section.at_rim, section.misfit


def _drawing(prism: Prism) -> Section:
    """The section of a concavity that has one."""
    assert prism.section is not None
    return prism.section


def _same_walls(one: Prism, other: Prism) -> bool:
    if not _are_straight(one, other):
        return False
    there = _carried(_throat(other), other.lattice, one.lattice)
    off = np.abs(_throat(one).signed_distance(there.border(_SAMPLES)))
    if _are_ends(one, other) and _drawing(one).at_rim != _drawing(other).at_rim:
        return _drawn_alike(off)
    return bool(off.max() < _SAME_CELLS)


def _drawn_alike(off: Array) -> bool:
    """Whether cells may have drawn a wall so far (N,) off along its border, of which views show the other end's rim."""
    return bool(off.mean() < _DRAWN_MEAN and off.max() < _DRAWN_CELLS)


def _are_ends(one: Prism, other: Prism) -> bool:
    """Whether two parallel concavities may be a hole's opposite mouths."""
    return bool(one.through and other.through and one.lattice.normal @ other.lattice.normal < 0)


def _are_straight(one: Prism, other: Prism) -> bool:
    """Whether two concavities may have walls in common: straight ones, in one direction."""
    if abs(one.lattice.normal @ other.lattice.normal) < _PARALLEL or any(one.tilt) or any(other.tilt):
        return False
    return not (one.tapered or other.tapered or one.domed or other.domed)


def _sink(prism: Prism) -> float:
    """By how many cells the throat is narrower than the opening."""
    return prism.rim / prism.lattice.pitch


def _throat(prism: Prism) -> Section:
    return _drawing(prism).grown(-_sink(prism))


def _carried(section: Section, start: Lattice, lattice: Lattice) -> Section:
    """A section on one lattice, carried along its normal to a parallel one."""
    scale = start.pitch / lattice.pitch
    axis = np.array([np.cos(section.angle), np.sin(section.angle)])
    places = np.array(section.center) + np.array([np.zeros(2), axis])
    xyz = start.origin + ((places + 0.5) * start.pitch) @ np.stack([start.first, start.second])
    (center, end), _ = lattice.coordinates(xyz)
    angle = float(np.arctan2(*(end - center)[::-1]))
    shape = section.shape.mapped(lambda length: scale * length)
    return replace(section, center=(float(center[0]), float(center[1])), angle=angle, shape=shape)


class Walls:
    """The walls and floors of concavities; which of them are of one hole is found once."""

    def __init__(self, prisms: Sequence[Prism], spacing: float, bends: Sequence[Bend] = ()) -> None:
        """Of concavities in a hull whose voxels have an edge `spacing`; those without a section have no walls."""
        self._prisms, self._spacing, self._holes, self._bends = prisms, spacing, _holes(prisms), bends
        self._islands = [island for prism in prisms for island in prism.islands]

    def under(self, centers: NDArray[np.floating], normals: NDArray[np.floating]) -> OnWalls:
        """Find the walls that surfels lie on; where walls compete, the nearest.

        Args:
            centers, normals: (N, 3) surfels.
        """
        prisms = self._prisms
        piece = np.full(len(centers), -1)
        places, facing = centers.astype(np.float64), normals.astype(np.float64)
        foot, wall = places.copy(), facing.copy()
        nearest = np.full(len(centers), _FAR_CELLS * self._spacing)
        for k, hole in self._holes.items():
            prism = prisms[k]
            section, lattice = _drawing(prism), prism.lattice
            cells, height = prism.upright(places)
            sunk = np.minimum(prism.draft * np.maximum(-height, 0), prism.sink)
            below_rim = sunk >= prism.rim  # the cone of a rim is .004 off, and may be none
            off = prism.lateral(cells) + sunk
            inward = -section.gradient(cells)  # (N, 2)
            lean = inward @ np.array(prism.tilt) + (prism.draft if prism.tapered else 0.0)
            inward = inward[:, :1] * lattice.first + inward[:, 1:] * lattice.second
            normal = inward + lean[:, None] * lattice.normal
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            alike = np.einsum("nc,nc->n", normal, facing) > _ALIKE
            mine = below_rim & (height < 0) & (height > -prism.depth) & (np.abs(off) < nearest) & alike
            of_hole = _drawing(prisms[hole]).pieces(prisms[hole].upright(places)[0])  # one frame for both ends
            piece[mine] = (hole * _NUMBERS + of_hole)[mine]
            foot[mine], wall[mine] = (places + off[:, None] * inward)[mine], normal[mine]
            nearest[mine] = np.abs(off[mine])
            floor, rise = _on_floor(prism, off, height, facing @ lattice.normal, nearest)
            piece[floor] = k * _NUMBERS + PIECES
            foot[floor], wall[floor] = places[floor] - rise[floor, None] * lattice.normal, lattice.normal
            nearest[floor] = np.abs(rise[floor])
        for k, island in enumerate(self._islands, len(prisms) + len(self._bends)):
            for mine, number, off, out in _on_island(island, places, facing, nearest):
                piece[mine] = (k * _NUMBERS + number)[mine]
                foot[mine], wall[mine] = (places - off[:, None] * out)[mine], out[mine]
                nearest[mine] = np.abs(off[mine])
        for k, bend in enumerate(self._bends, len(prisms)):
            off, out = bend.wall(places)
            alike = np.einsum("nc,nc->n", -out, facing) > _ALIKE
            mine = (bend.past_ends(places) <= off) & (np.abs(off) < nearest) & alike
            piece[mine] = k * _NUMBERS
            foot[mine], wall[mine] = (places - off[:, None] * out)[mine], -out[mine]
            nearest[mine] = np.abs(off[mine])
        return OnWalls(piece, foot, wall)


def _on_island(
    island: Prism, places: Array, facing: Array, nearest: Array
) -> Iterator[tuple[NDArray[np.bool_], NDArray[np.int64], Array, Array]]:
    """What lies on the walls of a boss, if it has a section, and on its top.

    Args:
        island: the boss.
        places, facing: (N, 3) surfels and their normals.
        nearest: (N,) distance to what they lie on otherwise; the top is asked with the walls' in it.

    Yields:
        (N,) which surfels, (N,) the piece's number, (N,) how far outside they lie, (N, 3) the outward normal.
    """
    lattice = island.lattice
    cells, height = lattice.coordinates(places)
    off = island.lateral(cells)
    if island.section is not None:
        out = island.section.gradient(cells)
        out = out[:, :1] * lattice.first + out[:, 1:] * lattice.second
        beside = (height < 0) & (height > -island.depth) & (np.abs(off) < nearest)
        yield beside & (np.einsum("nc,nc->n", out, facing) > _ALIKE), island.section.pieces(cells), off, out
    top = (off < 0) & (np.abs(height) < nearest) & (facing @ lattice.normal > _FLAT)
    yield top, np.full(len(places), PIECES), height, np.broadcast_to(lattice.normal, places.shape)


def _on_floor(
    prism: Prism, off: Array, height: Array, facing: Array, nearest: Array
) -> tuple[NDArray[np.bool_], Array]:
    """(N,) surfels on the flat floor of a blind concavity, (N,) how high they lie above it; none if it is not flat.

    Args:
        prism: the concavity.
        off: (N,) distance to its walls, negative inside; height: (N,) over its opening.
        facing: (N,) cosines of the surfels' normals and the opening's.
        nearest: (N,) distance to what they lie on otherwise.
    """
    rise = height + prism.depth
    if prism.through or prism.endless:
        return np.zeros(len(rise), bool), rise
    deep = (off < -prism.lattice.pitch) & (np.abs(rise) < prism.depth / 2)
    alike = deep & (facing > _FLAT)
    floor = alike & (np.abs(rise) < nearest)
    return floor if floor.sum() >= _MOSTLY * deep.sum() else np.zeros(len(rise), bool), rise
