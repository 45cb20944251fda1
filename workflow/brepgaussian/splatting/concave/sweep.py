"""Channels and slots that are open at their ends, made straight.

Silhouettes along a channel show its section; with perspective they show it at the ends only, and towards the
middle a hull closes it. So a column along the direction of a face's normal that the hull leaves empty anywhere
between two faces is taken to be empty all along, if the silhouettes stay filled and the views agree better.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.agreement import disagreements
from brepgaussian.splatting.concave.contours import chords_in, contour_rays, lost_share
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.planes import PlanarRegion, planar_regions
from brepgaussian.splatting.concave.prism import Lattice, Prism, plane_axes
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume

Array = NDArray[np.float64]

_PARALLEL = 0.998  # cosine of 3.6 degrees
_LEAST_AREA = 0.01  # of a face that ends a channel
_END_VOXELS = 3.0  # at a channel's ends the hull is rounded
_LEAST_CELLS = 12  # of a section's region that changes
_FINER = 2  # cells of a section for each voxel
_LEAST_VOLUME_VOXELS = 300  # less is left to the surfels
_MOST_LOST = 0.01  # share of the rays through a cut that it may leave with nothing
_GAIN = 0.8  # a cut leaves at most this share of the disagreement
_LEAST_RAYS = 200
_MOST_CUTS = 4  # channels of one part
_MOST_TRIED = 6  # hypotheses for the next one, largest first

logger = log.get_logger("stage1")


@dataclass(frozen=True)
class _Cut:
    """Columns to empty: a prism whose lateral outline is `prism.outline`, without margins; `volume` in voxels."""

    prism: Prism
    volume: float


def straighten(images: Images, hull: Volume) -> tuple[Volume, list[Prism]]:
    """Empty the columns that are empty at their ends.

    Args:
        images: of all views.
        hull: what silhouettes leave.

    Returns:
        The hull and what was cut.
    """
    rays = contour_rays(images.views)
    done: list[Prism] = []
    for _ in range(_MOST_CUTS):
        mesh = hull.mesh()
        scene = Scene(*mesh)
        chords = chords_in(scene, *rays)
        samples = chords.samples()
        regions = [r for r in planar_regions(*mesh, 2 * hull.spacing) if r.area(*mesh) >= _LEAST_AREA]
        cuts = [c for normal in _directions(regions) for c in _cuts(hull, normal, regions)]
        # the right direction explains all of a channel at once, others parts of it
        for cut in sorted(cuts, key=lambda c: -c.volume)[:_MOST_TRIED]:
            if lost_share(chords, cut.prism.signed_distance(samples, 0.0) < 0) > _MOST_LOST:
                continue
            opened = hull.without(cut.prism, 0.0)
            old, new, count = disagreements(images, scene, opened.scene(), 2 * hull.spacing)
            good = count >= _LEAST_RAYS and new <= _GAIN * old
            logger.info(
                "channel along %s, %.0f voxels: views disagree by %.2f for %.2f of the hull, %d rays%s",
                np.round(cut.prism.lattice.normal, 2).tolist(), cut.volume, new, old, count,
                "" if good else ": not believed",
            )  # fmt: skip
            if good:
                hull = opened
                done.append(cut.prism)
                break
        else:
            break
    return hull, done


def _directions(regions: Sequence[PlanarRegion]) -> list[Array]:
    """Normals of faces with another face at their back, each direction once.

    Faces that look at each other, as those of a bore that silhouettes leave angular, end no channel.
    """
    found: list[Array] = []
    for region in regions:
        behind = any(region.normal @ o.normal < -_PARALLEL and region.offset > -o.offset for o in regions)
        if behind and not any(abs(region.normal @ other) > _PARALLEL for other in found):
            found.append(region.normal)
    return found


def _cuts(hull: Volume, normal: Array, regions: Sequence[PlanarRegion]) -> list[_Cut]:
    """Columns that are empty somewhere between two neighbouring faces across a direction, and full elsewhere."""
    field, origin, spacing = hull.field, hull.origin, hull.spacing
    first, second = plane_axes(normal)
    corners = origin + spacing * (np.array(np.meshgrid(*[[0, n - 1] for n in field.shape])).reshape(3, -1).T)
    corners = corners @ np.stack([first, second, normal]).T
    low, high = corners.min(axis=0), corners.max(axis=0)
    u, v, w = (np.arange(low[k], high[k], spacing) for k in range(3))
    base = u[:, None, None] * first + v[None, :, None] * second
    columns = np.empty((len(w), len(u), len(v)), np.float32)
    for k, height in enumerate(w):
        index = ((base + height * normal - origin) / spacing).reshape(-1, 3).T
        columns[k] = ndimage.map_coordinates(field, index, order=1, cval=-spacing).reshape(len(u), len(v))
    found = []
    steps = _steps(normal, regions, spacing)
    for bottom, top in pairwise(steps):
        inner = (w > bottom + _END_VOXELS * spacing) & (w < top - _END_VOXELS * spacing)
        if not inner.any():
            continue
        least, most = columns[inner].min(axis=0), columns[inner].max(axis=0)
        volume = (columns[inner] > 0).sum(axis=0)
        labels, count = ndimage.label((least < 0) & (most > 0))
        empty = most <= 0
        for k in range(1, count + 1):
            member = labels == k
            if member.sum() < _LEAST_CELLS or volume[member].sum() < _LEAST_VOLUME_VOXELS:
                continue
            section = member | (ndimage.binary_dilation(member, iterations=2) & empty)
            fine = ndimage.zoom(np.where(section | (least >= 0), least, spacing), _FINER, order=1, grid_mode=True,
                                mode="nearest")  # fmt: skip
            start = (u[0] - spacing / 2) * first + (v[0] - spacing / 2) * second + top * normal
            lattice = Lattice(start, first, second, normal, spacing / _FINER, fine.shape)
            near = ndimage.binary_dilation(np.kron(section, np.ones((_FINER, _FINER), bool)), iterations=_FINER)
            prism = Prism(lattice, (fine < 0) & near, top - bottom, False, 0.0)
            found.append(_Cut(prism, float(volume[member].sum())))
    return found


def _steps(normal: Array, regions: Sequence[PlanarRegion], spacing: float) -> list[float]:
    """Heights of the faces across a direction, ascending."""
    heights = sorted(
        float(np.sign(r.normal @ normal) * r.offset) for r in regions if abs(r.normal @ normal) > _PARALLEL
    )
    kept: list[float] = []
    for height in heights:
        if not kept or height - kept[-1] > 2 * _END_VOXELS * spacing:
            kept.append(height)
    return kept
