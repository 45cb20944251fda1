"""Patch masks that mean the same face in every view: labelled surface samples projected back, borders from the image.

A raw projection of labels is never exact: samples are noisy and sparse, and one wrong pixel moves a border. So each
label's projection is eroded to a marker that is surely inside the face, and the markers grow over the luminance steps
of the image until they meet (marker-based watershed). Where the image shows no step, the border stays where the
samples put it.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree
from skimage.segmentation import watershed

from brepgaussian.artifacts.views import Views
from brepgaussian.errors import StageError
from brepgaussian.masks.edges import classical_edges
from brepgaussian.masks.keep import components, kept_regions
from brepgaussian.masks.steps import Crop, crop, step_strength, without_shading
from brepgaussian.views.noise import for_steps

_SMOOTHING = 8  # neighbours that a normal is averaged with
_SAME_SIDE = 0.7  # cosine: neighbours on the other wall of a thin plate point elsewhere
_FACING = 0.05  # cosine under which a sample is seen too obliquely to say which face a pixel shows
_SPLAT = 1.5  # a sample hides what lies behind it within so many sample spacings
_OCCLUDERS = 24  # samples looked at, nearest first: several layers of the object, front and hidden
_MAX_SLANT = 3.0  # tangent beyond which the depth's tolerance grows no more
_CELL_STEP = 4.0  # grey levels: only clear edges bound a cell
_CELL_LINE_PX = 3  # lines that wide leave no diagonal leaks
_CELL_GAP = 1e5  # px, more than any image is wide
_VOTERS = 5  # samples that decide a pixel's label, the nearest ones
_MARGIN_SPACINGS = 1.0  # projected borders are off by up to so many sample spacings ...
_MARGIN_PX = 2.0  # ... and so many pixels
_WIDTH_SHARE = 0.5  # a marker keeps at least the inner part of a thin region's half width
_RADIUS_PX = 2  # of the half-disks: small, borders are wanted sharp
_PRIOR_STEP = 3.0  # grey levels: image steps below do not move a projected border
_PRIOR_NOISE = 1.0  # the same per standard deviation of the image noise
_MINIMUM_SAMPLES = 3  # a label seen by fewer samples is not in the view


@dataclass(frozen=True)
class Samples:
    """Labelled samples of the surface.

    Attributes:
        xyz: (N, 3) positions, unit frame.
        normals: (N, 3) outward unit normals.
        label: (N,) integer face labels, negative = unlabelled.
        spacing: typical distance between neighbours, unit frame.
    """

    xyz: NDArray[np.float64]
    normals: NDArray[np.float64]
    label: NDArray[np.int64]
    spacing: float


def repair(
    views: Views,
    xyz: NDArray[np.floating],
    normals: NDArray[np.floating],
    label: NDArray[np.integer],
    threads: int = 1,
    detected: NDArray[np.int16] | None = None,
) -> NDArray[np.int16]:
    """Project labelled surface samples into all views and let the image place the borders.

    A detected region that lies clearly bounded within one label's projection is a face that the samples do not know:
    it keeps an id of its own, which occurs in its view only.

    Args:
        views: images, silhouettes and cameras.
        xyz: (N, 3) sample positions, unit frame.
        normals: (N, 3) outward unit normals.
        label: (N,) label per sample, negative = unlabelled (hides what lies behind, but marks nothing).
        threads: views worked on at the same time.
        detected: (V, H, W) region ids as detected in each view, 0 = none.

    Returns:
        (V, H, W) int16 patch ids: label + 1, 0 off the object; the same face has the same id in every view. Larger
        ids are regions of single views.

    Raises:
        StageError: no sample has a label.
    """
    if not (np.asarray(label) >= 0).any():
        raise StageError("no surface sample has a label", fix="check the points stage's result for this object")
    samples = prepare(np.asarray(xyz, np.float64), np.asarray(normals, np.float64), np.asarray(label, np.int64))
    views = for_steps(views)
    cv2.setNumThreads(threads)
    patches = np.zeros(views.alpha.shape, np.int16)
    first = following = int(samples.label.max()) + 2

    def work(view: int) -> None:
        cut = crop(views.grey(view), views.alpha[view])
        if cut is not None:
            known = None if detected is None else detected[view][cut.box]
            found = _repair_view(views, view, cut, samples, known, first)
            patches[view] = cut.paste(found.astype(np.int16), views.alpha.shape[1:])

    with ThreadPoolExecutor(max(threads, 1)) as pool:
        list(pool.map(work, range(len(patches))))
    for view in patches:  # ids of single views must not meet
        own = view >= first
        if own.any():
            view[own] += following - first
            following = int(view.max()) + 1
    return patches


def prepare(xyz: NDArray[np.float64], normals: NDArray[np.float64], label: NDArray[np.int64]) -> Samples:
    """Measure the samples' spacing and average their normals with those of neighbours of the same label.

    Whether a sample faces a view decides at grazing angles, where the normals' noise would let back sides through.
    """
    count = min(_SMOOTHING + 1, len(xyz))
    distance, index = cKDTree(xyz).query(xyz, k=count)
    distance, index = distance.reshape(len(xyz), count), index.reshape(len(xyz), count)
    same = (label[index] == label[:, None]) & (np.einsum("ij,ikj->ik", normals, normals[index]) > _SAME_SIDE)
    mean = (normals[index] * same[:, :, None]).sum(1)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12)
    spacing = float(np.median(distance[:, -1])) * float(np.sqrt(np.pi / max(count - 1, 1)))  # n = pi (d / spacing)^2
    return Samples(xyz, mean, label, spacing)


def _repair_view(
    views: Views, view: int, cut: Crop, samples: Samples, detected: NDArray[np.int16] | None, first: int
) -> NDArray[np.integer]:
    cells = edge_cells(cut)
    pixel, seen, spacing_px = visible_samples(views, view, cut, samples, cells)
    raw = projected_labels(pixel, samples.label[seen], cut.inside, cells)
    if not raw.any():
        return raw
    margin = _MARGIN_PX + _MARGIN_SPACINGS * spacing_px
    markers, depth = eroded_markers(without_specks(raw, pixel, samples.label[seen]), margin)
    ridge = without_shading(step_strength(cut.grey, cut.inside, _RADIUS_PX)[0], _RADIUS_PX)
    prior = max(_PRIOR_STEP, _PRIOR_NOISE * cut.noise)
    surface = ridge + prior * np.clip(1 - depth / margin, 0, 1)
    patches = np.asarray(watershed(surface, markers, mask=cut.inside), np.int16)
    return patches if detected is None else kept_regions(patches, detected, ridge, cut.noise, first)


def edge_cells(cut: Crop) -> NDArray[np.int32]:
    """Parts of the object that closed image edges bound: (h, w) int32 from 1, 0 on the edges and off the object.

    A cell may hold several faces (gaps in the edges join them) but hardly parts of a face and of what it hides.
    """
    lines = classical_edges(cut, _RADIUS_PX, _CELL_STEP, _CELL_LINE_PX) >= 128
    cells, _ = ndimage.label(cut.inside & ~lines)
    return np.asarray(cells, np.int32)


def visible_samples(
    views: Views, view: int, cut: Crop, samples: Samples, cells: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int64], float]:
    """Samples that face a view and are not hidden behind others of the same edge-bounded cell.

    The rim of a small hole lies within the samples' spacing of everything in the hole and would hide it; the
    image's edges say where the rim ends.

    Returns:
        (M, 2) pixel positions (x, y) in the crop, (M,) indices of these samples, and their spacing in pixels.
    """
    pixel, depth = views.cameras.project(view, samples.xyz)
    pixel = pixel - [cut.box[1].start, cut.box[0].start]
    height, width = cut.inside.shape
    ray = samples.xyz - views.cameras.centers[view]
    facing = -np.einsum("ij,ij->i", samples.normals, ray) / np.linalg.norm(ray, axis=1)
    column, row = np.floor(pixel).astype(np.int64).T
    framed = (depth > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height) & (facing > _FACING)
    index = np.flatnonzero(framed)
    if not len(index):
        return np.zeros((0, 2)), index, 0.0
    focal = float(views.cameras.intrinsics[view, :2].mean())
    spacing_px = samples.spacing * focal / float(np.median(depth[index]))
    pixel, depth = pixel[index], depth[index]
    place = _in_cells(pixel, cells[row[index], column[index]])
    count = min(_OCCLUDERS, len(index))
    _, near = cKDTree(place).query(place, k=count, distance_upper_bound=_SPLAT * spacing_px)
    near = near.reshape(len(index), count)
    # a slanted face is deeper at the far end of the neighbourhood than at its near end; both samples must be slanted
    cosine = np.clip(facing[index], _FACING, 1)
    slant = np.minimum(np.sqrt(1 - cosine**2) / cosine, _MAX_SLANT)
    common = np.minimum(np.append(slant, 0)[near], slant[:, None])
    seen = depth <= (np.append(depth, np.inf)[near] + samples.spacing * (1 + _SPLAT * common)).min(1)
    return pixel[seen], index[seen], spacing_px


def _in_cells(pixel: NDArray[np.float64], cell: NDArray[np.integer]) -> NDArray[np.float64]:
    """(M, 3) positions in which different cells lie farther apart than any two pixels."""
    return np.column_stack([pixel, cell * _CELL_GAP])


def projected_labels(
    pixel: NDArray[np.float64], label: NDArray[np.int64], inside: NDArray[np.bool_], cells: NDArray[np.int32]
) -> NDArray[np.int32]:
    """Label + 1 of every object pixel by the vote of the nearest labelled samples in its cell, closer ones count more.

    Pixels on edges, and in cells without a sample, are decided by the nearest samples of any cell.

    Args:
        pixel: (M, 2) positions (x, y) of the visible samples.
        label: (M,) their labels, negative = unlabelled.
        inside: (h, w) silhouette.
        cells: (h, w) edge-bounded cells.

    Returns:
        (h, w) int32, 0 off the object.
    """
    raw = np.zeros(inside.shape, np.int32)
    names, counts = np.unique(label[label >= 0], return_counts=True)
    used = np.isin(label, names[counts >= _MINIMUM_SAMPLES])
    if not used.any():
        return raw
    pixel, label = pixel[used], label[used]
    cell = cells[pixel[:, 1].astype(int), pixel[:, 0].astype(int)]
    certain = np.isin(cells, cell[cell > 0]) & (cells > 0)
    for where, of_cells in ((certain, True), (inside & ~certain, False)):
        rows, columns = np.nonzero(where)
        if len(rows):
            centre = np.column_stack([columns + 0.5, rows + 0.5])
            target = _in_cells(centre, cells[rows, columns]) if of_cells else centre
            raw[rows, columns] = _vote(_in_cells(pixel, cell) if of_cells else pixel, label, target) + 1
    return raw


def _vote(place: NDArray[np.float64], label: NDArray[np.int64], target: NDArray[np.float64]) -> NDArray[np.int64]:
    """Label that most of the nearest samples have, weighted by closeness."""
    k = min(_VOTERS, len(place))
    distance, nearest = cKDTree(place).query(target, k=k)
    distance, nearest = distance.reshape(len(target), k), nearest.reshape(len(target), k)
    weight = 1 / (distance + np.median(distance[:, -1]) + 1e-9)
    voted = label[nearest]
    votes = ((voted[:, :, None] == voted[:, None, :]) * weight[:, None, :]).sum(2)
    return np.asarray(voted[np.arange(len(target)), votes.argmax(1)])


def without_specks(raw: NDArray[np.int32], pixel: NDArray[np.float64], label: NDArray[np.int64]) -> NDArray[np.int32]:
    """Open (-1) the regions that fewer than `_MINIMUM_SAMPLES` samples of their own label lie in.

    Args:
        raw: (h, w) int32 label + 1, 0 = off the object.
        pixel: (M, 2) positions of the visible samples; `label`: (M,) their labels.
    """
    part, count = components(raw)
    row, column = pixel[:, 1].astype(int), pixel[:, 0].astype(int)
    own = raw[row, column] == label + 1
    support = np.bincount(part[row[own], column[own]], minlength=count + 1)
    support[0] = _MINIMUM_SAMPLES
    return np.where(support[part] >= _MINIMUM_SAMPLES, raw, -1).astype(np.int32)


def eroded_markers(raw: NDArray[np.int32], margin: float) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Shrink every region from its borders with other regions, thin regions less than wide ones.

    Args:
        raw: (h, w) int32 labels, -1 = open, 0 = off the object (the silhouette is certain: no erosion from there).
        margin: px.

    Returns:
        (h, w) int32 markers, 0 = open, and (h, w) float32 distance to the nearest border between regions.
    """
    border = np.zeros(raw.shape, bool)
    for axis in (0, 1):
        first, second = (raw[:-1], raw[1:]) if axis == 0 else (raw[:, :-1], raw[:, 1:])
        differ = (first != second) & (first > 0) & (second > 0)
        if axis == 0:
            border[:-1] |= differ
            border[1:] |= differ
        else:
            border[:, :-1] |= differ
            border[:, 1:] |= differ
    if not border.any():
        return np.maximum(raw, 0), np.full(raw.shape, margin, np.float32)
    depth = np.asarray(cv2.distanceTransform((~border).astype(np.uint8), cv2.DIST_L2, 5), np.float32)
    part, count = components(raw)
    deepest = np.zeros(count + 1, np.float32)
    deepest[1:] = ndimage.maximum(depth, part, np.arange(1, count + 1))
    needed = np.minimum(margin, _WIDTH_SHARE * deepest)[part]
    return np.where((raw > 0) & (depth >= needed), raw, 0).astype(np.int32), depth
