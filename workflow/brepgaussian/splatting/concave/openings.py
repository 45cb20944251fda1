"""Where views disagree with a lid: openings in a plane or a smooth face of the hull."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.artifacts.views import CLEAR, OPAQUE, Views
from brepgaussian.geometry.pixels import inner_distance
from brepgaussian.splatting.concave.contours import contour_rays
from brepgaussian.splatting.concave.prism import Lattice, Prism
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.sample import sample
from brepgaussian.views.noise import noise_of

if TYPE_CHECKING:
    from brepgaussian.splatting.concave.agreement import Rays

Array = NDArray[np.float64]

LID, WALL, BACKGROUND, UNSEEN = 0, 1, 2, 3  # what a view shows at a cell of the lattice
_NOISE_FREE_TOLERANCE = 1.5  # grey levels by which views of one place differ: rounding and interpolation
_SIGMAS = 3.0
_OFF_CELLS = 3.0  # over a face, its views are asked: off the hull's own roughness
LEAST_COSINE = 0.2  # a plane seen flatter than this blurs its cells into each other
_LEAST_VIEWS = 6  # of a cell, before its disagreement counts
REFUTED_SHARE = 0.12  # of a cell's views; walls show in a part of the views only
SURELY_SHARE = 0.3  # of them; beside walls that are a cell off, strips of a floor have .1-.2
_LESS = 0.7  # of a region's cells are left by that, for it to be tried, too
BORDER_CELLS = 2.0  # disagreement this close to the plane's own border is blur
SURFACE_SHARE = 0.8  # of a cell's views agree, if the cell is on a face
_BELT_CELLS = 4.0  # inside the border, past the blur of a shifted opening
_FRAME_CELLS = 3  # width of the frame of face around an opening
_FRAME_SHARE = 0.7  # of the frame is face; the rest may be cut off by a neighbouring opening or a border
_RIM_CELLS = 2.0  # inside a pocket's rim, past its blur
_OFF_RIM_CELLS = 4.0  # outside of it, for a ray straight down: the hull's rim is rounded, and off by a voxel or two
OPENING_CELLS = 3  # an opening narrower than twice this is not told from blur


@dataclass(frozen=True)
class Images:
    """What the cameras saw: `views`, their grey levels (V, H, W), and by how many of these one place may differ.

    `known_rays` keeps those at the object (`agreement.rays_at_object`), by their stride.
    """

    views: Views
    luminance: NDArray[np.float32]
    tolerance: float
    known_rays: "dict[int, Rays]" = field(default_factory=dict, repr=False, compare=False)

    @staticmethod
    def of(views: Views, noise: float = 0.0) -> "Images":
        """Of views whose noise has a standard deviation of `noise` grey levels."""
        return Images(views, views.luminance, max(_NOISE_FREE_TOLERANCE, _SIGMAS * noise))

    @cached_property
    def as_taken(self) -> "Images":
        """Before they were smoothed: that flattens what floors show, and with it their depths."""
        taken = self.views.as_taken
        return self if taken is self.views else Images.of(taken, noise_of(taken))

    @cached_property
    def contour_rays(self) -> tuple[Array, Array]:
        """(R, 3) origins and (R, 3) directions of rays just inside of every contour."""
        return contour_rays(self.views)


@dataclass(frozen=True)
class Stack:
    """What every view shows on a lattice.

    Attributes:
        lattice: on the plane, or on a plane that touches a curved face.
        domain: (R, C) bool cells inside the face's outer border and not inside the solid.
        shown: (V, R, C) uint8 one of LID, WALL, BACKGROUND, UNSEEN.
        grey: (V, R, C) float32 grey level, -1 on background, NaN unseen.
        relief: (R, C) how far the face lies below the lattice.
    """

    lattice: Lattice
    domain: NDArray[np.bool_]
    shown: NDArray[np.uint8]
    grey: NDArray[np.float32]
    relief: Array

    @cached_property
    def against(self) -> Array:
        """(R, C) share of the views that show something else than the others; none where few see a cell."""
        return _against(self.shown)

    @cached_property
    def agreement(self) -> Array:
        """(R, C) share of the views that show what the others do; none where few see a cell."""
        seen = (self.shown != UNSEEN).sum(axis=0)
        return np.asarray(np.where(seen >= _LEAST_VIEWS, (self.shown == LID).sum(axis=0) / np.maximum(seen, 1), 0))

    @cached_property
    def refuted(self) -> NDArray[np.bool_]:
        """(R, C) cells about which views differ, but for the blur at the face's border."""
        return self.refuted_by(REFUTED_SHARE)

    def refuted_by(self, share: float) -> NDArray[np.bool_]:
        """(R, C) the same of cells about which a larger share of the views differs."""
        return np.asarray(ndimage.binary_closing((self.against > share) & self._inner, iterations=2))

    @cached_property
    def _inner(self) -> NDArray[np.bool_]:
        return np.asarray(inner_distance(self.domain) > BORDER_CELLS)

    @cached_property
    def slope(self) -> Array:
        """(R, C) how fast the views' common grey changes from cell to cell, blurred by one."""
        common = _consensus(self.grey.reshape(len(self.grey), -1)).reshape(self.lattice.shape)
        seen = np.isfinite(self.grey).any(axis=0)
        blurred = ndimage.gaussian_filter(np.where(seen, common, 0), 1.0)
        weight = ndimage.gaussian_filter(seen.astype(float), 1.0)
        return np.hypot(*np.gradient(blurred / np.maximum(weight, 1e-3)))

    def surface(self) -> Array:
        """(R, C, 3) places on the face below the lattice's cells."""
        return self.lattice.centers() - self.relief[..., None] * self.lattice.normal


def rectify(images: Images, scene: Scene, lattice: Lattice, relief: Array | None = None) -> Stack:
    """Look at a face through all views.

    Args:
        images: of all views.
        scene: the hull.
        lattice: cells on the plane.
        relief: (R, C) how far a curved face lies below the lattice; None = a plane.
    """
    if relief is None:
        relief = np.zeros(lattice.shape)
    cells = (lattice.centers() - relief[..., None] * lattice.normal).reshape(-1, 3)
    slopes = np.gradient(relief, lattice.pitch)  # of the face, downwards
    normals = lattice.normal + slopes[0][..., None] * lattice.first + slopes[1][..., None] * lattice.second
    normals = (normals / np.linalg.norm(normals, axis=-1, keepdims=True)).reshape(-1, 3)
    slack = 2.5 * lattice.pitch
    distance = scene.near(cells, slack)
    on_hull = (np.abs(distance) < slack).reshape(lattice.shape)
    domain = ndimage.binary_fill_holes(on_hull) & (distance > -slack).reshape(lattice.shape)
    return _stack(images, scene, lattice, domain, relief, normals)


def across(images: Images, scene: Scene, lattice: Lattice, domain: NDArray[np.bool_], off: float = _OFF_CELLS) -> Stack:
    """Look at cells (R, C) of a plane through all views, whether or not it is a face of the hull there.

    What stands in the way less than `off` cells above it is taken for the hull's roughness.
    """
    normals = np.broadcast_to(lattice.normal, (lattice.shape[0] * lattice.shape[1], 3))
    return _stack(images, scene, lattice, domain, np.zeros(lattice.shape), normals, off)


def _stack(
    images: Images,
    scene: Scene,
    lattice: Lattice,
    domain: NDArray[np.bool_],
    relief: Array,
    normals: Array,
    off: float = _OFF_CELLS,
) -> Stack:
    cells = (lattice.centers() - relief[..., None] * lattice.normal).reshape(-1, 3)
    within = domain.ravel()
    shape = (len(images.views.cameras), *lattice.shape)
    grey, shown = np.full(shape, np.nan, np.float32), np.full(shape, UNSEEN, np.uint8)
    grey[:, domain], shown[:, domain] = _look(images, scene, cells[within], normals[within], off * lattice.pitch)
    for rim in scene.rims:
        for view, unsure in enumerate(_past_rim(cells[within], images.views.cameras.centers, rim, lattice.pitch)):
            hidden = np.flatnonzero(within)[unsure]
            grey[view].reshape(-1)[hidden], shown[view].reshape(-1)[hidden] = np.nan, UNSEEN
    return Stack(lattice, domain, shown, grey, relief)


def _past_rim(cells: Array, centers: Array, rim: Prism, pitch: float) -> Iterator[NDArray[np.int64]]:
    """For each view, which of the cells (N, 3) in a pocket it sees past the rim: it may show the face around that."""
    places, height = rim.upright(cells)
    inside = np.flatnonzero((rim.lateral(places) < 0) & (height < -_RIM_CELLS * pitch))
    for center in centers:
        up = (center - cells[inside]) @ rim.lattice.normal
        below, up = inside[up > -height[inside]], up[up > -height[inside]]
        ray = (center - cells[below]) / up[:, None]  # for one unit of height
        passed, _ = rim.lattice.coordinates(cells[below] - height[below, None] * ray)
        beyond = rim.lateral(passed) / pitch
        slant = np.linalg.norm(ray, axis=1)
        yield below[(beyond > -_RIM_CELLS) & (beyond < _OFF_RIM_CELLS * slant)]


def refuted_share(images: Images, scene: Scene, places: Array, normals: Array, pitch: float) -> Array:
    """(N,) share of the views of places (N, 3) on a hull that don't show what the others show there."""
    return _against(_look(images, scene, places, normals, _OFF_CELLS * pitch)[1])


def _look(
    images: Images, scene: Scene, cells: Array, normals: Array, off: float
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Grey levels (V, N) of cells (N, 3), seen from `off` above them, and what they show (V, N); see `Stack`."""
    cameras = images.views.cameras
    grey = np.full((len(cameras), len(cells)), np.nan, np.float32)  # -1 = background
    for view, center in enumerate(cameras.centers):
        seen = visible(scene, cells, normals, center, off)
        if len(seen):
            grey[view, seen] = grey_at(images, view, cells[seen])
    shown = np.where(np.abs(grey - _consensus(grey)) <= images.tolerance, LID, WALL).astype(np.uint8)
    shown[grey < 0] = BACKGROUND
    shown[np.isnan(grey)] = UNSEEN
    return grey, shown


def _against(shown: NDArray[np.uint8]) -> Array:
    """(...) share of views (V, ...) that show something else than the others; none where few see a place."""
    seen = (shown != UNSEEN).sum(axis=0)
    against = ((shown == WALL) | (shown == BACKGROUND)).sum(axis=0)
    return np.asarray(np.where(seen >= _LEAST_VIEWS, against / np.maximum(seen, 1), 0))


def opened(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(R, C) without what is too narrow to be told from blur; it rounds corners, too."""
    return np.asarray(ndimage.binary_opening(cells, iterations=OPENING_CELLS))


def openings(stack: Stack, least_area: float) -> list[NDArray[np.bool_]]:
    """(R, C) outlines of the regions where the lid is refuted."""
    share, region = stack.against, stack.refuted
    filled = ndimage.binary_fill_holes(region) & stack.domain
    # what the views agree on within an opening may be its floor, or an island as high as the lid: both are tried
    holes, _ = ndimage.label(filled & ~region)
    island = np.bincount(holes.ravel())[holes] * stack.lattice.pitch**2 >= least_area
    thin = np.asarray(ndimage.binary_opening(island & (holes > 0)))  # the end of a tube
    island = opened(thin)
    outlines: list[NDArray[np.bool_]] = []
    for left in [np.zeros_like(island), *(some for some in (island, thin) if some.any())]:
        candidate = filled & ~left
        labels, count = ndimage.label(opened(candidate))
        found = [_sharpen(labels == k, share, left) for k in range(1, count + 1)]
        outlines += [o for o in found if not any(np.array_equal(o, other) for other in outlines)]
    outlines += _surer(stack, outlines)
    return [o for o in outlines if o.sum() * stack.lattice.pitch**2 >= least_area]


def _surer(stack: Stack, outlines: Sequence[NDArray[np.bool_]]) -> list[NDArray[np.bool_]]:
    """(R, C) what more views refute of outlines that are much larger: a hole in a floor with strips along its walls."""
    if not outlines:
        return []
    sure = ndimage.binary_fill_holes(stack.refuted_by(SURELY_SHARE)) & stack.domain
    labels, count = ndimage.label(opened(sure))
    found = (labels == k for k in range(1, count + 1))
    whole = [o.sum() for o in outlines]
    return [
        region
        for region in found
        if any((region & o).any() and region.sum() < _LESS * n for o, n in zip(outlines, whole, strict=True))
        and not any((region & o).sum() > _LESS * max(region.sum(), n) for o, n in zip(outlines, whole, strict=True))
    ]


def agreed(stack: Stack, region: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(F,) about which cells of a region (R, C) nearly all views agree."""
    shown = stack.shown[:, region]  # (V, F)
    lid, seen = (shown == LID).sum(axis=0), (shown != UNSEEN).sum(axis=0)
    return np.asarray((seen > 0) & (lid >= SURFACE_SHARE * seen))


def _sharpen(outline: NDArray[np.bool_], share: Array, island: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """An opening's border where half as many views disagree as further in.

    A hull's lid lies above the true one, so oblique views show the opening shifted on it: the region that any
    view refutes is too wide. Cells of an `island` stay out.
    """
    depth = ndimage.distance_transform_edt(outline)
    belt = (depth > _BELT_CELLS) & (depth <= 2 * _BELT_CELLS)
    if not belt.any():
        return outline
    sharp = outline & ((share > np.median(share[belt]) / 2) | (depth > 2 * _BELT_CELLS))
    sharp = ndimage.binary_opening(ndimage.binary_fill_holes(sharp) & ~island, iterations=2)
    labels, count = ndimage.label(sharp)
    if not count:
        return outline
    return labels == 1 + int(np.argmax(np.bincount(labels[labels > 0])[1:]))


def is_framed(stack: Stack, outline: NDArray[np.bool_]) -> bool:
    """Whether a true face surrounds an opening: cells all around it that look the same in all views.

    A hull also has planar regions where no surface is; there every view shows something else, and what
    seems to be an opening has no frame.
    """
    gap = int(BORDER_CELLS)
    frame = ndimage.binary_dilation(outline, iterations=gap + _FRAME_CELLS)
    frame &= ~ndimage.binary_dilation(outline, iterations=gap)
    same = stack.domain[frame] & agreed(stack, frame)
    return bool(frame.any()) and float(same.mean()) >= _FRAME_SHARE


def visible(scene: Scene, cells: Array, normals: Array, center: Array, off: float) -> NDArray[np.int64]:
    """(M,) which of the cells (N, 3) the camera sees from above, past the rest of the hull."""
    to_camera = center - cells
    length = np.sqrt(np.einsum("nc,nc->n", to_camera, to_camera))
    above = np.einsum("nc,nc->n", to_camera, normals)
    index = np.flatnonzero(above > LEAST_COSINE * length)
    # along the ray itself: one that starts straight above its cell looks past what stands in the way
    start = cells[index] + (off / above[index])[:, None] * to_camera[index]
    return index[~scene.occluded(start, to_camera[index] / length[index, None])]


def grey_at(images: Images, view: int, points: Array) -> NDArray[np.float32]:
    """(N,) grey level, -1 on background, NaN on the silhouette's border."""
    pixels, _ = images.views.cameras.project(view, points)
    at = pixels[:, ::-1] - 0.5
    alpha, grey = sample(images.views.alpha[view], at), sample(images.luminance[view], at)
    return np.where(alpha > OPAQUE, grey, np.where(alpha < CLEAR, -1, np.nan)).astype(np.float32)


def _consensus(grey: NDArray[np.float32]) -> NDArray[np.float32]:
    """(N,) the grey that half of the views of a cell show: its own where it is on a face, whatever light falls
    there; in an opening, that of one of the surfaces behind, which the other views then refute.

    Args:
        grey: (V, N) what the views show, -1 on background, NaN unseen.
    """
    ordered = np.sort(np.where(grey >= 0, grey, np.nan), axis=0)  # NaN last
    count = np.isfinite(ordered).sum(axis=0)
    middle = np.take_along_axis(ordered, np.maximum(count - 1, 0)[None] // 2, axis=0)[0]
    return np.where(count > 0, middle, 0).astype(np.float32)
