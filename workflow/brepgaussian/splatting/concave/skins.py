"""Skins over planar faces that no region tells: 3D edges lie all around a face, on its plane.

A hull leaves a few voxels on walls and floors that no silhouette grazes, and where these are of one grey no ray tells
how deep it lies. But the edges around a face are told by triangulation, to a fifth of a voxel: along the normal of a
face many of them lie at one height. A skin over such a plane goes, if it has no edges of its own, if contours stay
filled, and if views agree much better without it: about what is behind it few of them differ.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.agreement import Rays, better, disagreements, rays_at_object
from brepgaussian.splatting.concave.contours import Chords, chords_in, lost_share
from brepgaussian.splatting.concave.floors import lattice_of
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.planes import Plane, axes_of
from brepgaussian.splatting.concave.prism import Lattice, Prism, over
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.sweep import MOST_LOST
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.mesh import vertex_normals

if TYPE_CHECKING:
    from brepgaussian.splatting.evidence.edges import EdgeCloud

Array = NDArray[np.float64]
Cells = NDArray[np.bool_]

_CELLS = 120  # along the longer side of a lattice: somewhat more than voxels
_SQUARE = 0.02  # cosine of two normals to which a third one is square
_ALONG = 0.1  # cosine of an edge with the normal of a face that it lies on, at most
_BAND = 0.0025  # unit frame, on either side, in which edges of one plane lie: they are good to .001
_LEAST_EDGES = 60  # on a plane, 1.5e-3 apart at least
_PROMINENT = 3.0  # times as many as if edges lay anywhere
_APART_VOXELS = 1.5  # of two planes
_SKIN_VOXELS = (0.7, 8.0)  # how high skins lie over a plane
_FACING = 0.5  # cosine of a skin's normal with that of its plane: towards its end a skin is steep
_OWN_VOXELS = 0.7  # so near to a plane of its own, and
_OWN_FACING = 0.97  # as parallel, what lies higher is no skin
_LEAST_AREA = 0.001  # of a skin
_LEAST_VOXELS = 60  # that it has in all: less is the roughness of a hull
_BORDER_CELLS = 3  # from an edge on the plane a face's border is told
_BORDERED = 0.4  # of it, at least
_OWN_EDGES = 0.25  # as many edges on a skin as around it, at most
_GAIN = 0.7  # of the disagreement is left at most, by true ones .2-.64, by cuts into a knuckle .67 and .75,
_MOST_LEFT = 0.6  # and so many tolerances: true ones up to .5, those cuts .87 and 1.0; or
_HALF = 0.5  # of the disagreement, whatever it was: in a deep nook no two views see the same
_DOUBTED = 0.15  # tolerances by which rays differ on a skin, at least: .31 to 2.2 measured, up to .12 on true faces
_LEAST_RAYS = 30  # that tell so
_REACH_VOXELS = 1.0  # rays on which less changes don't judge

logger = log.get_logger("stage1")


def without_skins(images: Images, hull: Volume, edges: "EdgeCloud", planes: Sequence[Plane]) -> Volume:
    """A hull without its skins over planes that 3D edges tell.

    Args:
        images: of all views.
        hull: opened.
        edges: of the images.
        planes: of the faces that views have confirmed.

    Returns:
        The hull; the same object if there are none.
    """
    if not len(edges.points):
        return hull
    found = [each for way in _ways(planes) for each in _planes(edges, way, hull)]
    told, surely = [plane for plane, _ in found], [plane for plane, sure in found if sure]
    every = [*planes, *surely, *(Plane(-p.normal, -p.offset) for p in surely)]
    seen = _Seen(images, rays_at_object(images), hull)
    for plane in told:
        for side in (1.0, -1.0):
            seen = _bared(seen, edges, Plane(side * plane.normal, side * plane.offset), every, (planes, every))
    return seen.hull


def _ways(planes: Sequence[Plane]) -> list[Array]:
    """Unit normals (3,) that faces may have, each with its opposite once: of known ones, square to two of these, and
    of known ones mirrored across faces that others stand square on: on a part that is alike on both sides.
    """
    normals = axes_of([plane.normal for plane in planes])
    pairs = [(a, b) for a, b in combinations(normals, 2) if abs(a @ b) < _SQUARE]
    square = [way / np.linalg.norm(way) for way in (np.cross(a, b) for a, b in pairs)]
    across = [a for a in normals if sum(abs(a @ b) < _SQUARE for b in normals) > 1]
    mirrored = [n - 2 * (n @ way) * way for n in normals for way in across]
    return axes_of([*normals, *square, *mirrored])


def _planes(edges: "EdgeCloud", way: Array, hull: Volume) -> Iterator[tuple[Plane, bool]]:
    """Planes across a way on which many edges of a hull lie, those with most first; and whether they stand out of all.

    Others stand out of those that lie on no plane before: few edges show in a nook, many at the rims of a whole part.
    """
    heights = np.sort((edges.points @ way)[np.abs(edges.directions @ way) < _ALONG])
    if not len(heights):
        return
    centers = np.arange(heights[0], heights[-1] + _BAND, _BAND)
    first, last = (np.searchsorted(heights, centers + side * _BAND) for side in (-1, 1))
    count = last - first
    least = _PROMINENT * 2 * _BAND / float(np.ptp(hull.box @ way))  # of so many edges that lie anywhere, on a plane
    free = np.ones(len(heights), bool)
    taken: list[float] = []
    for k in np.argsort(-count, kind="stable"):
        if count[k] < max(_LEAST_EDGES, least * free.sum()):
            break
        height = float(np.median(heights[first[k] : last[k]]))
        if all(abs(height - other) > _APART_VOXELS * hull.spacing for other in taken):
            taken.append(height)
            free &= np.abs(heights - height) > _BAND
            yield Plane(way, height), bool(count[k] >= least * len(heights))


def _bared(
    seen: "_Seen", edges: "EdgeCloud", plane: Plane, known: Sequence[Plane], partings: Sequence[Sequence[Plane]]
) -> "_Seen":
    """A hull without the skins over one side of a plane.

    Edges and some other planes part a face from what lies past it, such as a bore's wall below a slot's floor. The
    fewer planes do, the more of a skin goes, or stays, as one: those that only edges tell may lie elsewhere.

    Args:
        seen: the hull.
        edges: of the images.
        plane: that is bared.
        known: on which a hull's surface is no skin.
        partings: planes that end faces where they cross the plane; these are tried one after the other.
    """
    hull = seen.hull
    lattice = lattice_of(seen.images, hull, plane, _CELLS)
    low, high = (voxels * hull.spacing for voxels in _SKIN_VOXELS)
    covered, bare = _covered(seen, lattice, low, high, known)
    if covered.sum() * lattice.pitch**2 < _LEAST_AREA:
        return seen
    around, upon = _edge_cells(edges, lattice, -_BAND, _BAND), _edge_cells(edges, lattice, low, high)
    whole = ndimage.binary_closing(covered | bare) & ~ndimage.binary_closing(around)
    past = ~hull.inside((lattice.centers() + high * lattice.normal).reshape(-1, 3)).reshape(lattice.shape)
    lines = [_lines(lattice, planes) for planes in partings]
    for k, ends in enumerate(lines):
        if k and np.array_equal(ends, lines[k - 1]):
            continue  # the same pieces again
        now = seen
        labels, count = ndimage.label(whole & ~ends)
        for face in (labels == label for label in range(1, count + 1)):
            skin = face & covered
            area = float(skin.sum()) * lattice.pitch**2
            if area >= _LEAST_AREA and _is_bordered(face, skin, around, upon, ends):
                free = past & ~ends
                now = _cut(now, lattice, ndimage.binary_dilation(skin, mask=free) & free, high)
        if now is not seen:
            rest = partings[k + 1 :]
            return _bared(now, edges, plane, known, rest) if rest else now
    return seen


def _covered(seen: "_Seen", lattice: Lattice, low: float, high: float, known: Sequence[Plane]) -> tuple[Cells, Cells]:
    """(R, C) cells of a plane over which a hull's surface lies that no other plane tells, and where it is the plane."""
    height = seen.hull.mesh()[0] @ lattice.normal - float(lattice.origin @ lattice.normal)
    near = np.flatnonzero((height > -low) & (height < high))
    vertices, normals, height = seen.hull.mesh()[0][near], seen.normals[near], height[near]
    cells, facing = lattice.coordinates(vertices)[0], normals @ lattice.normal
    skin = (height > low) & (facing > _FACING)
    own = np.zeros(len(vertices), bool)
    for plane in known:
        if plane.normal @ lattice.normal > _OWN_FACING:
            on = np.abs(vertices @ plane.normal - plane.offset) < _OWN_VOXELS * seen.hull.spacing
            own |= skin & on & (normals @ plane.normal > _OWN_FACING)
    bare = (np.abs(height) <= low) & (facing > _FACING)
    step = ndimage.binary_dilation(_filled(lattice, cells[own]))  # with its rounded rim
    return ndimage.binary_opening(_filled(lattice, cells[skin & ~own]) & ~step), _filled(lattice, cells[bare])


def _lines(lattice: Lattice, planes: Sequence[Plane]) -> Cells:
    """(R, C) cells in which planes that are square to a lattice's cross it."""
    centers, found = lattice.centers(), np.zeros(lattice.shape, bool)
    for plane in planes:
        if abs(plane.normal @ lattice.normal) < _SQUARE:
            found |= np.abs(centers @ plane.normal - plane.offset) < lattice.pitch / 2
    return found


def _filled(lattice: Lattice, cells: Array) -> Cells:
    """(R, C) where fractional cells (N, 2) lie, gaps between them closed."""
    return np.asarray(ndimage.binary_closing(_marked(lattice, cells)))


def _marked(lattice: Lattice, cells: Array) -> Cells:
    """(R, C) where fractional cells (N, 2) lie."""
    found = np.zeros(lattice.shape, bool)
    index = np.round(cells).astype(int)
    index = index[((index >= 0) & (index < lattice.shape)).all(axis=1)]
    found[tuple(index.T)] = True
    return found


def _edge_cells(edges: "EdgeCloud", lattice: Lattice, low: float, high: float) -> Cells:
    """(R, C) cells with edges at some heights over them."""
    cells, height = lattice.coordinates(edges.points.astype(float))
    return _marked(lattice, cells[(height > low) & (height < high)])


def _is_bordered(face: Cells, skin: Cells, around: Cells, upon: Cells, ends: Cells) -> bool:
    """Whether edges on a plane run around the face that a skin is a part of, and hardly any on the skin.

    Where another plane ends the face, all may be of one grey.
    """
    near, wide = (ndimage.binary_dilation(cells, iterations=_BORDER_CELLS) for cells in (around, face))
    whole = ndimage.binary_fill_holes(face)  # a bore's mouth may be of one grey with it, too
    border = ndimage.binary_dilation(whole) & ~whole & (near | ~ends)
    own = (upon & ndimage.binary_erosion(skin)).sum()
    return bool((border & near).sum() >= _BORDERED * border.sum() and own <= _OWN_EDGES * (around & wide).sum())


def _cut(seen: "_Seen", lattice: Lattice, skin: Cells, high: float) -> "_Seen":
    """A hull without a skin, if contours stay filled and views agree much better.

    Edges crowd where a circle touches a plane, too, in which no face lies.
    """
    if not seen.doubted(lattice, skin, high):
        return seen
    prism = Prism(lattice, skin, 0.0, False, 0.0)
    bare = replace(seen, hull=seen.hull.without(prism, high))
    if seen.hull.lost_in(bare.hull) < _LEAST_VOXELS:
        return seen
    lost = lost_share(seen.chords, seen.chords.within(prism, high))
    good, told = lost <= MOST_LOST, ""
    if good:  # else views need not be asked
        reach = _REACH_VOXELS * seen.hull.spacing
        old, new, count = said = disagreements(seen.images, seen.scene, bare.scene, reach, seen.rays)
        good = _is_better(said)
        told = f", views disagree by {new:.2f} for {old:.2f} of the hull, {count} rays"
    logger.info(
        "skin of area %.4f over a plane with normal %s at %.4f: %.1f %% of the contours lost%s%s",
        skin.sum() * lattice.pitch**2, np.round(lattice.normal, 2).tolist(), float(lattice.origin @ lattice.normal),
        100 * lost, told, "" if good else ": not believed",
    )  # fmt: skip
    return bare if good else seen


def _is_better(said: tuple[float, float, int]) -> bool:
    """Whether views agree much better without a skin; see `agreement.disagreements`."""
    old, new, _ = said
    return better(said, _GAIN, _LEAST_RAYS, untold=False) and (new <= _MOST_LEFT or new <= _HALF * old)


@dataclass(frozen=True)
class _Seen:
    """A hull, the images that tell of it, and rays of theirs."""

    images: Images
    rays: Rays
    hull: Volume

    @cached_property
    def scene(self) -> Scene:
        """Its surface."""
        return self.hull.scene()

    @cached_property
    def told(self) -> tuple[Array, Array]:
        """(M, 3) where rays hit it that tell anything, and (M,) tolerances by which they differ there."""
        return self.rays.told(self.scene)

    def doubted(self, lattice: Lattice, skin: Cells, high: float) -> bool:
        """Whether views may disagree about a skin (R, C) over a lattice, up to a height."""
        within, height = over(lattice, skin, self.told[0])
        costs = self.told[1][within & (height > 0) & (height < high)]
        return len(costs) < _LEAST_RAYS or float(costs.mean()) >= _DOUBTED

    @cached_property
    def normals(self) -> Array:
        """(K, 3) unit normals at the vertices of its mesh."""
        return vertex_normals(*self.hull.mesh())

    @cached_property
    def chords(self) -> Chords:
        """What rays along the contours have in it."""
        return chords_in(self.scene, *self.images.contour_rays)
