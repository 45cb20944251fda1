"""Surfels to points: the centre and four samples on the ellipse (paper, section 3.2)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.stage1 import Surfels
from brepgaussian.settings.points import PointsSettings

Array = NDArray[np.float64]
_GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))  # rad; successive samples of a disk never line up


@dataclass(frozen=True)
class Samples:
    """Points sampled from surfels.

    Attributes:
        xyz: (N, 3) float64; normals: (N, 3) float64 outward unit; edge: (N,) float64 edge value in 0..1.
        surfel: (N,) int64 the surfel that each point comes from; the centres come first, in their order.
    """

    xyz: Array
    normals: Array
    edge: Array
    surfel: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.xyz)


def densify(surfels: Surfels, settings: PointsSettings) -> Samples:
    """Sample every surfel; the centres come first.

    Surfels that are not slivers give four more samples on their ellipse. If there are still fewer than
    `minimum_points`, their disks are sampled further, in proportion to their areas.
    """
    centers = surfels.centers.astype(np.float64)
    frames, scales = surfels.axes.astype(np.float64), surfels.scales.astype(np.float64)
    owners, points = [np.arange(len(centers))], [centers]
    if settings.densify and len(centers):
        major, minor = scales.max(1), scales.min(1)
        round_ones = np.flatnonzero(major <= settings.sliver_ratio * np.maximum(minor, 1e-12))
        for column, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):
            step = sign * settings.ellipse_radius * scales[round_ones, column]
            points.append(centers[round_ones] + step[:, None] * frames[round_ones, :, column])
            owners.append(round_ones)
        missing = settings.minimum_points - sum(map(len, points))
        if missing > 0:
            more, who = _fill(centers, frames, scales, settings.ellipse_radius, missing)
            points.append(more)
            owners.append(who)
    surfel = np.concatenate(owners)
    normals = frames[surfel, :, 2]
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return Samples(np.concatenate(points), normals, surfels.edges[surfel].astype(np.float64), surfel)


def _fill(centers: Array, frames: Array, scales: Array, radius: float, missing: int) -> tuple[Array, NDArray[np.int64]]:
    """`missing` more points inside the ellipses, as many on each as its share of the total area."""
    area = scales[:, 0] * scales[:, 1]
    edges = np.cumsum(area / area.sum()) * missing
    ticks = np.arange(missing) + 0.5
    owner = np.minimum(np.searchsorted(edges, ticks), len(centers) - 1)
    first = np.searchsorted(owner, owner)  # index of the owner's first sample
    rank = np.arange(missing) - first
    count = np.bincount(owner, minlength=len(centers))[owner]
    reach = radius * np.sqrt((rank + 0.5) / count)
    angle = _GOLDEN_ANGLE * rank + owner  # a different start on each surfel
    offset = (reach * np.cos(angle) * scales[owner, 0])[:, None] * frames[owner, :, 0]
    offset += (reach * np.sin(angle) * scales[owner, 1])[:, None] * frames[owner, :, 1]
    return centers[owner] + offset, owner
