"""Corners between ribs: what ribs on both sides hide from silhouettes lies over two floors that meet, not over one.

A hull spans the ribs' edges with a flat lid. Under it there is room down to two planes, from rib to rib. Beside one
rib, in the corner of a bracket, the lid spans the rib's edge and the far ends of wall and base: there are three floors.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.broken import broken_rims
from brepgaussian.splatting.concave.cleared import PARALLEL, cleared, on_known
from brepgaussian.splatting.concave.depth import measured
from brepgaussian.splatting.concave.openings import Images, Stack, rectify
from brepgaussian.splatting.concave.planes import PlanarRegion, Plane, lattice_over, planar_regions, region_on
from brepgaussian.splatting.concave.prism import Lattice, over
from brepgaussian.splatting.concave.rays import gather
from brepgaussian.splatting.concave.rooms import Corner, Sought
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.shapes import SURE, advantage, summary, units_of
from brepgaussian.splatting.concave.volume import Volume

Array = NDArray[np.float64]

_LEAST_WIDTH_PIXELS = 14.0  # of an opening; the corner under a narrower one is left to what has one floor
_OPENING_CELLS = 3  # a narrower part of a refuted region is blur
_RAYS, _FEW_RAYS = 60_000, 10_000
_FACING = (0.15, 0.985)  # cosines between a lid and a floor under it,
_FACING_SEEN = (0.1, 0.996)  # and two floors both of which are seen elsewhere: what other cuts leave of room is flat
_LEAST_ANGLE = 0.5  # sine of the angle between the floors
_ALONG = 0.2  # sine of the angle between a lid and the edge in which the floors meet
_LARGE_FACE = 0.5  # of a lid's area has a face that a third floor may be parallel to: no strip along a hull's edge
_BETWEEN = 0.1  # least share of each floor's normal in the lid's
_DEPTHS = np.array([0.1, 0.2, 0.35, 0.5, 0.7, 0.9])  # under a lid, in the opening's widths, where no face is known
_DEEPEST = 1.5  # opening's widths that a floor lies under it; a face that lies deeper is another one
_LEAST_FLOOR = 0.15  # of a lid's area is seen of a floor elsewhere
_MOST_REFUTED = 0.3  # of a face that is a floor; of a hull's skin between faces views refute most
_MOST_TURN = np.radians(6)  # of its triangles, rms: faces had up to 4.6 degrees, strips of a hull's skin 6.9 and more
_MOST_TRIED = 6  # openings, largest first
_MOST_REFINED = 4  # sets of floors under one of them, those that explain most rays as they are
_TOLD_ONCE = 0.5  # of an opening lies over a corner that is known
_IN_POCKET = 0.5  # of an opening lies in a pocket that notches have opened
_GAIN = 0.33  # of the disagreement on the lid is left at most; true corners had .15-.32, false ones .37 and more
_SAME_VOXELS = 3.0  # within which a floor is a face that is known
_ROUNDS = 3  # of looking again
_MOST_AGAINST = 0.2  # share of rays that contradict it

logger = log.get_logger("stage1")


@dataclass(frozen=True)
class _Floor:
    """A plane that may go on under a lid: its outward normal (3,), and where it is seen (3,), None if nowhere."""

    normal: Array
    seen: Array | None


_Opening = tuple[PlanarRegion, list[tuple[_Floor, ...]], Stack, NDArray[np.bool_]]  # a lid, floors, and its opening


def open_corners(images: Images, hull: Volume, planes: Sequence[Plane]) -> Volume:
    """Carve the corners between ribs; what one that is cut out leaves of the room may be one, too.

    Arguments and result are those of `_open_corners`.
    """
    for _ in range(_ROUNDS):
        before, hull = hull, _open_corners(images, hull, planes)
        if hull is before:
            break
    return hull


def _open_corners(images: Images, hull: Volume, planes: Sequence[Plane]) -> Volume:
    """Carve the corners under lids that a hull has.

    Args:
        images: of all views.
        hull: what silhouettes leave, faces flattened.
        planes: of its outer faces; a floor looks into the solid from one or is seen elsewhere.

    Returns:
        The opened hull.
    """
    mesh = hull.mesh()
    scene = Scene(*mesh)
    backs = [-plane.normal for plane in planes]
    footprint = images.views.cameras.footprint()
    regions = [(region, region.area(*mesh)) for region in planar_regions(*mesh, 2 * hull.spacing)]
    large = [(region, area) for region, area in regions if area >= (_LEAST_WIDTH_PIXELS * footprint) ** 2]
    # along an edge, what marching cubes cut off it is as large as a lid and one cell wide
    lattices = [lattice_over(region, mesh, footprint) for region, _ in large]
    wide = [(*found, lattice) for found, lattice in zip(large, lattices, strict=True) if min(lattice.shape) > 1]
    stacks = [rectify(images, scene, lattice) for _, _, lattice in wide]
    seen = [
        (_seen(region, backs, mesh), area)
        for (region, area, _), stack in zip(wide, stacks, strict=True)
        if stack.refuted.sum() <= _MOST_REFUTED * stack.domain.sum() and region.turn(*mesh) < _MOST_TURN
    ]
    sought: list[_Opening] = []
    for (lid, area, _), stack in zip(wide, stacks, strict=True):
        enough = [floor for floor, size in seen if size >= _LEAST_FLOOR * area]
        pairs = _pairs(lid, [*(_Floor(normal, None) for normal in backs), *enough])
        large_ones = [floor.normal for floor, size in seen if size >= _LARGE_FACE * area]
        directions = _distinct([*backs, *(sign * normal for normal in large_ones for sign in (1, -1))])
        floors = [*pairs, *_triples(lid, [*(_Floor(normal, None) for normal in directions), *enough])]
        if floors:
            sought += [(lid, floors, stack, outline) for outline in _wide_openings(stack, footprint)]
    found: list[Corner] = []
    now = scene
    sought = list(_outside_pockets(images, scene, sought, planes, 2 * hull.spacing))
    largest = sorted(sought, key=lambda s: -s[3].sum() * s[2].lattice.pitch ** 2)[:_MOST_TRIED]
    for lid, floors, stack, outline in largest:
        cells = stack.lattice.centers()[outline]
        if any(c.contains(cells).mean() > _TOLD_ONCE for c in found):
            continue
        corner = _measured(images, stack, scene, outline, [list(_starts(lid, some, cells)) for some in floors])
        if corner is not None:
            result = cleared(images, hull, now, on_known(corner, planes, _SAME_VOXELS * hull.spacing), _GAIN)
            if result is not None:
                corner, hull, now = result
                found.append(corner)
    return hull


def _seen(face: PlanarRegion, backs: Sequence[Array], mesh: tuple[Array, NDArray[np.int64]]) -> _Floor:
    """The floor that a face is a part of, parallel to an outer face if it is about so."""
    alike = [normal for normal in backs if normal @ face.normal > PARALLEL]
    return _Floor(alike[0] if alike else face.normal, mesh[0][mesh[1][face.triangles]].mean(axis=(0, 1)))


def _distinct(directions: Sequence[Array]) -> list[Array]:
    """Directions (3,) without those that are parallel to an earlier one."""
    found: list[Array] = []
    for direction in directions:
        if not any(direction @ other > PARALLEL for other in found):
            found.append(direction)
    return found


def _facing(lid: PlanarRegion, planes: Sequence[_Floor], within: tuple[float, float] = _FACING) -> list[_Floor]:
    """Planes that look the way a lid does, but not quite."""
    return [plane for plane in planes if within[0] < plane.normal @ lid.normal < within[1]]


def _pairs(lid: PlanarRegion, planes: Sequence[_Floor]) -> list[tuple[_Floor, ...]]:
    """Pairs of planes that may be the floors under a lid."""
    pairs: list[tuple[_Floor, ...]] = []
    for first, second in combinations(_facing(lid, planes, _FACING_SEEN), 2):
        both = first.seen is not None and second.seen is not None
        if not both and len(_facing(lid, (first, second))) < 2:
            continue
        edge = np.cross(first.normal, second.normal)
        length = float(np.linalg.norm(edge))
        if length < _LEAST_ANGLE or abs(edge @ lid.normal) > _ALONG * length:
            continue
        share = np.linalg.lstsq(np.column_stack([first.normal, second.normal]), lid.normal, rcond=None)[0]
        if share.min() > _BETWEEN:
            pairs.append((first, second))
    return pairs


def _triples(lid: PlanarRegion, planes: Sequence[_Floor]) -> list[tuple[_Floor, ...]]:
    """Three planes that may be the floors under a lid."""
    found: list[tuple[_Floor, ...]] = []
    for three in combinations(_facing(lid, planes), 3):
        normals = np.column_stack([plane.normal for plane in three])
        if abs(np.linalg.det(normals)) > _LEAST_ANGLE and np.linalg.solve(normals, lid.normal).min() > _BETWEEN:
            found.append(three)
    return found


def _wide_openings(stack: Stack, footprint: float) -> Iterator[NDArray[np.bool_]]:
    """(R, C) parts of a lid that views refute."""
    labels, count = ndimage.label(ndimage.binary_opening(stack.refuted, iterations=_OPENING_CELLS))
    for k in range(1, count + 1):
        outline = ndimage.binary_fill_holes(labels == k) & stack.domain
        if outline.sum() * stack.lattice.pitch**2 >= (_LEAST_WIDTH_PIXELS * footprint) ** 2:
            yield outline


def _outside_pockets(
    images: Images, scene: Scene, sought: Sequence[_Opening], planes: Sequence[Plane], tolerance: float
) -> Iterator[_Opening]:
    """Openings but for those in what notches have left of a pocket's lid: its floor and a wall are a corner, too.

    Such a corner would be cut out through the wall on the other side, on which the rest of the lid leans.
    """
    mesh, footprint = (scene.vertices, scene.triangles), images.views.cameras.footprint()
    pockets: list[tuple[Lattice, NDArray[np.bool_]]] = []
    for plane in planes:
        facing = any(_FACING[0] < plane.normal @ lid.normal < _FACING[1] for lid, *_ in sought)
        rim = region_on(plane, *mesh, tolerance) if facing else None
        if rim is not None:
            stack = rectify(images, scene, lattice_over(rim, mesh, footprint))
            _, whole, outlines = broken_rims(images, scene, stack, (_LEAST_WIDTH_PIXELS * footprint) ** 2)
            pockets += [(whole.lattice, outline) for outline in outlines]
    for lid, floors, stack, outline in sought:
        cells = stack.lattice.centers()[outline]
        if not any(_lie_in(cells, *pocket) for pocket in pockets):
            yield lid, floors, stack, outline


def _lie_in(cells: Array, lattice: Lattice, outline: NDArray[np.bool_]) -> bool:
    """Whether cells (N, 3) lie in a pocket with an outline (R, C), most of them."""
    inside, height = over(lattice, outline, cells)
    return bool((inside & (height < lattice.pitch)).mean() > _IN_POCKET)


def _starts(lid: PlanarRegion, floors: Sequence[_Floor], cells: Array) -> Iterator[Corner]:
    """Corners over floors under cells (N, 3) of a lid: where the floors are seen, or at some depths."""
    normals = np.stack([floor.normal for floor in floors])
    if len(floors) == 2:
        edge = np.cross(*normals)
        edge /= np.linalg.norm(edge)
        across = cells @ np.cross(edge, lid.normal)
        width = float(across.max() - across.min())
        normals = np.concatenate([normals, [edge, -edge]])
    else:
        width = float(np.ptp(cells, axis=0).max())
    ends = (cells @ normals[len(floors) :].T).min(axis=0)
    offsets = []
    unseen = sum(plane.seen is None for plane in floors)
    depths = _DEPTHS if len(floors) == 2 or unseen == 1 else _DEPTHS[1::2]
    for plane in floors:
        top = float((cells @ plane.normal).max())
        heights = top - depths * width if plane.seen is None else np.array([plane.normal @ plane.seen])
        offsets.append(heights[(heights < top) & (heights > top - _DEEPEST * width)])
    for chosen in product(*offsets):
        yield Corner((lid.normal, lid.offset), normals, np.array([*chosen, *ends]))


def _measured(
    images: Images, stack: Stack, scene: Scene, outline: NDArray[np.bool_], starts: Sequence[Sequence[Corner]]
) -> Corner | None:
    """The best corner under an opening, or None if the rays don't tell one; `starts` for each set of floors."""
    if not any(starts):
        return None
    every = gather(stack, outline, images.views.cameras.centers, scene)
    few = Sought(stack, every.sample(_FEW_RAYS), len(every), images.tolerance)
    full = Sought(stack, every.sample(_RAYS), len(every), images.tolerance)

    def cost(corner: Corner) -> float:
        return summary(*few.costs(corner))[0]

    likely = sorted((min(some, key=cost) for some in starts if some), key=cost)[:_MOST_REFINED]
    refined = [few.refined(start) for start in likely]
    chosen = min(range(len(refined)), key=lambda k: cost(refined[k]))
    best = full.shortened(full.refined(refined[chosen]), likely[chosen])
    closed, costs = full.closed(), full.costs(best)
    old, (new, error) = summary(*closed)[0], summary(*costs)
    told = advantage(units_of(full.rays), closed, costs) > SURE and new <= _GAIN * old and error <= _MOST_AGAINST
    good = told and new / old <= _left_by_one_floor(images, stack, scene, outline, old)
    logger.info(
        "corner under a lid of area %.4f, normal %s, floors %s: views disagree by %.2f for %.2f, "
        "%.0f %% of rays against it%s",
        outline.sum() * stack.lattice.pitch**2,
        np.round(best.lid[0], 2).tolist(), np.round(best.normals[: best.floors], 2).tolist(),
        new, old, 100 * error, "" if good else ": not believed",
    )  # fmt: skip
    return best if good else None


def _left_by_one_floor(images: Images, stack: Stack, scene: Scene, outline: NDArray[np.bool_], closed: float) -> float:
    """Share of the disagreement on a lid that the best concavity with one floor leaves."""
    prism = measured(images, scene, stack, outline)
    return 1.0 if prism is None else 1 - prism[1] / (closed * float(prism[0].outline.sum()))
