"""All prismatic concavities under the planes of a hull."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.broken import broken_rims
from brepgaussian.splatting.concave.curved import Spot, leaning_ways, spot_around, spots
from brepgaussian.splatting.concave.deeper import is_whole, surely_deeper
from brepgaussian.splatting.concave.depth import measured
from brepgaussian.splatting.concave.drilled import drilled, ringed
from brepgaussian.splatting.concave.enclosed import beside_islands, enclosed, to_rims
from brepgaussian.splatting.concave.join import in_line, opposite
from brepgaussian.splatting.concave.mouths import completed
from brepgaussian.splatting.concave.openings import (
    Images,
    Stack,
    is_framed,
    openings,
    rectify,
)
from brepgaussian.splatting.concave.planes import (
    PARALLEL,
    PITCH_PIXELS,
    PlanarRegion,
    Plane,
    lattice_over,
    planar_regions,
    region_on,
)
from brepgaussian.splatting.concave.prism import Lattice, Prism, carried
from brepgaussian.splatting.concave.rimmed import rimmed, settled
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.standing import around_hubs, standing_free

_LEAST_WIDTH_PIXELS = 7.0  # narrower openings are not told from blur
_LEAST_DEPTH_CELLS = 3.0
_OVERLAP = 0.2  # share of an opening that may belong to a better one
_AS_MUCH = 0.8  # of what the best outline explains
_WITHIN = 0.8  # of a recess around a hub lies in one that goes under it
_LID_SHARE = 0.2  # of an opening in a curved face is closed by the hull
_LEAST_CURVED_CELLS = 5.0  # deep; a hull also spans inner edges with a curved skin, which is no opening's lid
_LEANING_ERROR = 0.6  # of the rays that contradict a hole square to its face contradict one that leans, at most
_NEARLY = np.radians(6.0)  # from square, or from along: meant to be that
_STRAIGHT, _TAPERED = np.radians((1.0, 15.0))  # between a face's normal and a plane: hubs taper by less
_MAXIMUM_ERROR = 0.3  # share of rays that contradict the concavity

Array = NDArray[np.float64]

logger = log.get_logger("stage1")


def find_prisms(
    images: Images, scene: Scene, cell: float, floors: Sequence[Prism] = (), planes: Sequence[Plane] = ()
) -> list[Prism]:
    """Find pockets, blind holes and holes under the planar faces of a hull.

    Args:
        images: of all views.
        scene: the hull.
        cell: its resolution.
        floors: concavities that are already carved into the hull. If there are any, only their floors are
            looked at: their walls are no lids.
        planes: that views have confirmed: a region of the hull that bulges beside a pocket is turned against its own,
            and views then disagree about the frame of every small hole in it.
    """
    mesh = scene.vertices, scene.triangles
    footprint = images.views.cameras.footprint()
    found: list[tuple[Prism, float]] = []
    regions = [region.on(planes, *mesh, 2 * cell) for region in planar_regions(*mesh, 2 * cell, planes)]
    for region in regions:
        floor = _floor_of(region, floors, 2 * cell)
        if floors and floor is None:
            continue
        lattice = lattice_over(region, mesh, footprint)
        if min(lattice.shape) >= _LEAST_WIDTH_PIXELS:
            stack, thin = rectify(images, scene, lattice), False
            if floor is None and not any(region.normal is plane.normal for plane in planes):
                stack, thin = settled(images, scene, stack, planes, (_LEAST_WIDTH_PIXELS * footprint) ** 2)
            found += _concavities(images, scene, stack, floor=floor, thin=thin)
    # of a lid that silhouettes have opened here and there, what is left leans
    rims = [] if floors else [plane for plane in planes if not any(plane.is_of(r, 2 * cell) for r in regions)]
    for rim in filter(None, (region_on(plane, *mesh, 2 * cell) for plane in rims)):
        found += _concavities(images, scene, rectify(images, scene, lattice_over(rim, mesh, footprint)), if_broken=True)

    def again(lattice: Lattice, outline: NDArray[np.bool_]) -> tuple[Prism, float] | None:
        return measured(images, scene, rectify(images, scene, lattice), outline)

    return [prism for prism, _ in completed(found, again)]


def find_curved(
    images: Images, scene: Scene, cell: float, known: Sequence[Prism] = (), planes: Sequence[Plane] = ()
) -> list[Prism]:
    """Find holes and pockets in the curved faces of a hull, clear of those that are `known`; see `find_prisms`."""
    footprint = images.views.cameras.footprint()
    pitch, width = PITCH_PIXELS * footprint, _LEAST_WIDTH_PIXELS * footprint
    free = np.ones(len(scene.vertices), bool)
    # what is left of a lid may be flat by chance
    for region in _flats(scene, cell, planes):
        free[scene.triangles[region.triangles].ravel()] = False
    for prism in known:
        free &= np.abs(prism.signed_distance(scene.vertices, 2 * cell)) > 2 * cell

    def around(places: Array, facing: Array | None = None) -> Spot | None:
        return spot_around(places, scene, cell, pitch, facing)

    def below(spot: Spot | None) -> list[tuple[Prism, Array]]:
        if spot is None:
            return []
        stack = rectify(images, scene, spot.lattice, spot.relief)
        deep = spot.relief + _LEAST_CURVED_CELLS * pitch
        prisms = [prism for prism, _ in _concavities(images, scene, stack, centered=True)]
        return [(p, stack.surface()[p.outline]) for p in prisms if p.depth > deep[p.outline].max()]

    def under(places: Array, facing: Array | None = None) -> list[tuple[Prism, Array]]:
        return below(around(places, facing))

    found: list[tuple[Prism, Array]] = []  # with the places of its lid
    ends: list[Prism] = []  # what lies under the far mouths of holes that were found to go through
    for spot in spots(images, scene, free, cell, pitch, width):
        stack = rectify(images, scene, spot.lattice, spot.relief)
        for outline in openings(stack, width**2):
            places = stack.surface()[outline]
            facing = [p for p in _prisms(found) if p.lattice.normal @ spot.lattice.normal > 0]
            if not is_framed(stack, outline) or _is_open(places, scene, [*known, *facing], cell, pitch):
                continue
            # looked at again from over its own middle: there the face's normal is the direction of a hole
            ways = [_snapped(way, planes) for way in leaning_ways(places, spot.lattice.normal)]
            own = around(places)
            across = _across((own or spot).lattice.normal, planes)
            square = [below(own), *(under(places, way) for way in across)]
            told = _told_best(_least_against(square), [under(places, way) for way in ways])
            if _is_over(places, _prisms(found), cell):  # a hole that leans may come out there, too
                ends += _prisms(told)
            found += told
    for prism, lid in tuple(found):
        far = opposite(prism, lid, scene)
        if far is not None and not _is_open(far, scene, [*known, *_prisms(found)], cell, pitch):
            found += under(far)
    return [prism for prism in in_line(found, under) if not any(prism is end for end in ends)]


def _flats(scene: Scene, cell: float, planes: Sequence[Plane]) -> list[PlanarRegion]:
    """Flat regions of a hull, those of faces that views have confirmed, where any are known.

    Not all that lies on such a face: of a small one, it may be a hole's lid.
    """
    found = planar_regions(scene.vertices, scene.triangles, 2 * cell)
    return [region for region in found if not planes or any(plane.is_of(region, 2 * cell) for plane in planes)]


def _across(normal: Array, planes: Sequence[Plane]) -> list[Array]:
    """Directions (3,) along planes that a face's normal nearly is along: a hub tapers, the hole in it does not lean."""
    ways: list[Array] = []
    for plane in planes:
        leaning = float(plane.normal @ normal)
        if not np.sin(_STRAIGHT) < abs(leaning) < np.sin(_TAPERED):
            continue
        way = _along(normal, plane)
        if all(way @ other < PARALLEL for other in ways):
            ways.append(way)
    return ways


def _least_against(found: list[list[tuple[Prism, Array]]]) -> list[tuple[Prism, Array]]:
    """What the fewest rays contradict; where they are as few, the last."""
    return min(reversed([some for some in found if some]), key=lambda some: some[0][0].error, default=[])


def _told_best(
    straight: list[tuple[Prism, Array]], leaning: list[list[tuple[Prism, Array]]]
) -> list[tuple[Prism, Array]]:
    """What lies under a lid square to its face or, if far fewer rays contradict it, along a way that it leans.

    A face's normal is not the direction of a hole that was drilled across, off the middle of a shaft.
    """
    best = min(filter(None, leaning), key=lambda some: some[0][0].error, default=[])
    if best and (not straight or best[0][0].error < _LEANING_ERROR * straight[0][0].error):
        return best
    return straight


def _snapped(way: Array, planes: Sequence[Plane]) -> Array:
    """A direction (3,) that an oblong mouth tells to a few degrees, square to faces or along them if it nearly is."""
    for plane in planes:
        if abs(plane.normal @ way) > np.cos(_NEARLY):
            return np.asarray(np.copysign(1.0, plane.normal @ way) * plane.normal)
    for plane in planes:
        if abs(plane.normal @ way) < np.sin(_NEARLY):
            way = _along(way, plane)
    return way


def _along(way: Array, plane: Plane) -> Array:
    """The unit direction (3,) along a plane that another one is nearest to."""
    along = way - (way @ plane.normal) * plane.normal
    return np.asarray(along / np.linalg.norm(along))


def _prisms(found: Sequence[tuple[Prism, Array]]) -> list[Prism]:
    return [prism for prism, _ in found]


def _is_open(places: Array, scene: Scene, known: Sequence[Prism], cell: float, pitch: float) -> bool:
    """Whether the lid (N, 3) of an opening is gone: over a concavity that is known, or where silhouettes show none."""
    return _is_over(places, known, cell) or _is_gone(places, scene, pitch)


def _is_over(places: Array, known: Sequence[Prism], cell: float) -> bool:
    """Whether the middle of a lid (N, 3) lies over one of some concavities."""
    middle = places.mean(axis=0)[None]
    return any(prism.signed_distance(middle, 2 * cell)[0] < 0 for prism in known)


def _is_gone(lid: Array, scene: Scene, pitch: float) -> bool:
    """Whether the hull has next to nothing of a lid (N, 3): between the tops of bosses a pocket is open already."""
    return bool(np.isfinite(scene.near(lid, 2 * pitch)).mean() < _LID_SHARE)


def _concavities(
    images: Images,
    scene: Scene,
    stack: Stack,
    centered: bool = False,
    floor: Prism | None = None,
    if_broken: bool = False,
    thin: bool = False,
) -> list[tuple[Prism, float]]:
    """What lies under the openings of one face (or under its middle), with what each explains.

    Best told first, none over another. The face may be the floor of a concavity that is known, or one of which only
    the rim is left (`if_broken`): then nothing, if that tells no opening. Of a `thin` rim no frame is asked.
    """
    cameras = images.views.cameras
    least = (_LEAST_WIDTH_PIXELS * cameras.footprint()) ** 2
    whole, broken = stack, list[NDArray[np.bool_]]()
    if not centered and floor is None:
        stack, whole, broken = broken_rims(images, scene, stack, least)
    if if_broken and not broken:
        return []
    regions = enclosed(stack, least, images.tolerance)
    outlines = openings(stack, least) + regions
    if centered:
        middle = tuple(n // 2 for n in stack.lattice.shape)
        outlines = [outline for outline in outlines if ndimage.binary_fill_holes(outline)[middle]]
    outlines = [outline for outline in outlines if is_framed(stack, outline) or (thin and rimmed(outline, stack))]
    outlines += [outline for outline in to_rims(stack, regions, outlines) if is_framed(stack, outline)]
    if floor is not None:
        below = carried(floor.lattice, floor.outline, stack.lattice)
        outlines += beside_islands(stack, below, regions)
        outlines = [o for o in outlines if not _is_gone(stack.surface()[o], scene, stack.lattice.pitch)]
    hubs = [] if centered else around_hubs(stack, scene, images, least)
    if not centered:
        outlines = standing_free(outlines, stack, scene, images)
    tried = [(stack, outline, 0.0) for outline in outlines] + [(stack, outline, top) for outline, top in hubs]
    tried += [(whole, outline, 0.0) for outline in broken]
    told = [
        (measured(images, scene, seen, outline) or drilled(images, scene, seen, outline), above)
        for seen, outline, above in tried
        if outline.any()
    ]
    told += [(drilled(images, scene, stack, outline), 0.0) for outline in ringed(stack, least, images.tolerance)]
    fits = []
    for fit, above in told:
        # around a hub silhouettes would show what goes through
        if fit is None or not _believable(fit[0]) or (above and fit[0].through):
            continue
        if floor is None or not is_whole(floor, fit[0]) or surely_deeper(images, scene, floor, fit[0]):
            fits.append((replace(fit[0], above=above), fit[1]))
    around = [prism for prism, _ in fits if prism.above]
    fits = [fit for fit in fits if fit[0].above or not any(_hangs(fit[0], hub) for hub in around)]
    if centered:
        fits = _hardly_contradicted(fits)
    taken = np.zeros(stack.lattice.shape, bool)
    chosen = []
    for prism, gain in sorted(fits, key=lambda fit: -fit[1]):
        if (prism.outline & taken).sum() <= _OVERLAP * prism.outline.sum():
            chosen.append((prism, gain))
            taken |= prism.outline
    return chosen


def _hardly_contradicted(fits: list[tuple[Prism, float]]) -> list[tuple[Prism, float]]:
    """Of outlines of one hole that explain about as much, the one that the fewest rays contradict."""
    most = max((gain for _, gain in fits), default=0.0)
    return sorted((fit for fit in fits if fit[1] >= _AS_MUCH * most), key=lambda fit: fit[0].error)[:1]


def _hangs(whole: Prism, around: Prism) -> bool:
    """Whether a concavity goes under the hub that another one goes around, which explains its rays better."""
    within = np.count_nonzero(whole.outline & around.outline) >= _WITHIN * np.count_nonzero(around.outline)
    return bool(within and whole.error > around.error)


def _floor_of(region: PlanarRegion, known: Sequence[Prism], tolerance: float) -> Prism | None:
    """The known concavity whose floor a planar region is, or the boss in one whose top it is."""
    center = region.offset * region.normal  # the plane's point nearest to the frame's origin
    for prism in known:
        along = float(region.normal @ prism.lattice.normal)
        height = float((prism.lattice.origin - center) @ prism.lattice.normal)
        if along > PARALLEL and abs(height - prism.depth) < tolerance and not (prism.through or prism.domed):
            return prism
        for island in prism.islands:
            if along > PARALLEL and abs(height + island.depth - prism.depth) < tolerance:
                return island
    return None


def _believable(prism: Prism) -> bool:
    good = prism.error <= _MAXIMUM_ERROR and prism.depth >= _LEAST_DEPTH_CELLS * prism.lattice.pitch
    logger.info(
        "opening of area %.4f, normal %s: depth %.4f, %s, tilt %s, draft %.2f to %.4f, %.0f %% of rays against it%s",
        prism.area,
        np.round(prism.lattice.normal, 2).tolist(),
        prism.depth,
        "through" if prism.through else "endless" if prism.endless else "domed" if prism.domed else "blind",
        np.round(prism.tilt, 2).tolist(),
        prism.draft,
        prism.sink,
        100 * prism.error,
        "" if good else ": not believed",
    )
    return good
