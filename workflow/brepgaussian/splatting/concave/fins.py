"""Thin leftovers: what cuts from several sides have left of a hull's lid between them, as a sheet or a splinter."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.agreement import better, disagreements, rays_at_object
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.volume import Volume

_THIN_VOXELS = 4  # a leftover is no thicker; ribs may be, too, but views agree about these
_CORNER = 1.9  # times half of that, from what is thicker: the corner of a block is 1.73
_LEAST_VOXELS = 30  # of a leftover
_MOST = 6  # that are tried, those about which rays differ most first
_COST = 0.6  # tolerances, capped, by which rays differ on one, at least: 1.1 measured, .1 on ribs
_LEAST_HITS = 20  # that say so
_GAIN = 0.6  # of the disagreement is left at most without it
_LEAST_RAYS = 60
_REACH_VOXELS = 1.0  # rays on which it changes less than this don't judge it

logger = log.get_logger("stage1")


def without_fins(images: Images, hull: Volume) -> Volume:
    """A hull without thin leftovers, as far as views agree better without them.

    Args:
        images: of all views.
        hull: after concavities were opened.
    """
    inside = hull.field > 0
    core = ndimage.distance_transform_edt(inside) > _THIN_VOXELS / 2
    if not core.any():
        return hull
    thin = inside & (ndimage.distance_transform_edt(~core) > _CORNER * _THIN_VOXELS / 2)
    # a sheet thinner than a voxel has holes
    labels, count = ndimage.label(ndimage.binary_dilation(thin, _ALL))
    labels[~thin] = 0
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    large = np.flatnonzero(sizes >= _LEAST_VOXELS)[1:]  # the first one is what is thick
    if not len(large):
        return hull
    rays, scene = rays_at_object(images), hull.scene()
    at, costs = rays.told(scene)
    near = ndimage.grey_dilation(labels, size=3)  # rays hit a surface between two nodes
    nodes = np.round((at - hull.origin) / hull.spacing).astype(int)
    hit = near[tuple(np.clip(nodes, 0, np.array(labels.shape) - 1).T)]
    hits, sums = np.bincount(hit, minlength=count + 1), np.bincount(hit, costs, count + 1)
    mean = sums / np.maximum(hits, 1)
    doubtful = [k for k in large if mean[k] >= _COST and hits[k] >= _LEAST_HITS]
    for k in sorted(doubtful, key=lambda k: -mean[k])[:_MOST]:
        cut = _without(hull, labels == k)
        after = cut.scene()
        said = disagreements(images, scene, after, _REACH_VOXELS * hull.spacing, rays)
        good = better(said, _GAIN, _LEAST_RAYS, untold=False)
        logger.info(
            "thin leftover of %d voxels: views disagree by %.2f for %.2f of the hull, %d rays%s",
            sizes[k], said[1], said[0], said[2], "" if good else ": stays",
        )  # fmt: skip
        if good:
            hull, scene = cut, after
    return hull


_ALL = ndimage.generate_binary_structure(3, 3)


def _without(hull: Volume, part: NDArray[np.bool_]) -> Volume:
    """A hull without some of its nodes (n, n, n), half a voxel beyond them."""
    return hull.with_field(np.where(part, np.minimum(hull.field, -hull.spacing / 2), hull.field).astype(np.float32))
