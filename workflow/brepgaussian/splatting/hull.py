"""Visual hull from silhouettes, at sub-voxel accuracy, opened where images show it to be open."""

import ctypes
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.errors import StageError
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.splatting.concave import Bend, Images, Prism
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.concave.walls import Walls
from brepgaussian.splatting.faces import Face, Fillet
from brepgaussian.splatting.library import load, pointer
from brepgaussian.splatting.mesh import vertex_normals
from brepgaussian.splatting.opened import Opened, Shown, opened
from brepgaussian.splatting.spreading import spread

_UNITS = 32.0  # silhouette distances are stored as int16 in 1/32 px: +-1023 px
_MARGIN = 0.04  # of the unit frame, around the object's box
_BAND_VOXELS = 3.0  # the field is exact this far from the surface
_REGION_SAMPLES = 6000  # of a hull: a face of a thousandth of its area still gets a few


@dataclass(frozen=True)
class Hull:
    """A closed mesh of the visual hull.

    Attributes:
        vertices: (K, 3) float64, unit frame.
        triangles: (T, 3) int64, counter-clockwise seen from outside.
        normals: (K, 3) float64 outward unit normals at the vertices.
        spacing: edge of a voxel, unit frame.
        prisms: concavities that were opened although no silhouette shows them.
        fillets: inner edges between planar faces that were rounded.
        bends: what joins concavities that are the ends of a bent bore.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int64]
    normals: NDArray[np.float64]
    spacing: float
    prisms: tuple[Prism, ...] = ()
    fillets: tuple[Fillet, ...] = ()
    bends: tuple[Bend, ...] = ()

    @cached_property
    def walls(self) -> Walls:
        """Of the concavities that were opened."""
        return Walls(self.prisms, self.spacing, self.bends)


def silhouette_distance(alpha: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Signed distance (px, inside positive) of each pixel centre to the contour where coverage is one half.

    The antialiased border pixels say where in them the contour passes, which a thresholded mask does not.
    """
    import cv2

    full, empty = alpha == 255, alpha == 0
    border = ~(full | empty)
    beside_empty = cv2.dilate(empty.astype(np.uint8), np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)) > 0
    border |= full & beside_empty
    if not border.any():
        return np.full(alpha.shape, 1e3 if full.all() else -1e3, np.float32)
    distance, labels = cv2.distanceTransformWithLabels(
        (~border).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    coverage = np.zeros(labels.max() + 1, np.float32)
    coverage[labels[border]] = alpha[border].astype(np.float32) / 255 - 0.5
    return np.where(empty, -distance, distance) + coverage[labels]


def carve(
    views: Views,
    resolution: int,
    threads: int = 1,
    concavities: bool = False,
    noise: float = 0.0,
    patches: NDArray[np.integer] | None = None,
    relief: bool = False,
) -> tuple[Hull, list[Face]]:
    """Carve the visual hull on a grid of `resolution`^3 and mesh it.

    Args:
        views: images and cameras.
        resolution: voxels along each side of the grid.
        threads: CPU threads; the result does not depend on it.
        concavities: also open what the images show to be open although no silhouette does.
        noise: standard deviation of the images' noise, grey levels.
        patches: (V, H, W) region ids of the masks: also cut what stands above planar faces; None = don't.
        relief: also move the surface to where parallax shows it; needs `patches`.

    Returns:
        The hull and the planar faces that were confirmed.

    Raises:
        StageError: no voxel lies inside every silhouette.
    """
    silhouettes = np.empty(views.alpha.shape, np.int16)
    for view, alpha in enumerate(views.alpha):
        silhouettes[view] = np.clip(silhouette_distance(alpha) * _UNITS, -32000, 32000).astype(np.int16)
    volume = Volume(*hull_field(silhouettes, views.cameras, resolution, threads))
    if volume.field.max() <= 0:
        raise StageError(
            "the silhouettes have no common inside",
            fix="check the cameras (cam_from_unit, intrinsics) and the alpha channel of the images",
        )

    found = Opened(volume)
    if patches is not None or concavities:
        found = opened(Shown(Images.of(views, noise), patches, _sample, noise), volume, concavities, relief)
    return _hull(found), list(found.faces)


def _hull(found: Opened) -> Hull:
    """The mesh of an opened field, with what was opened."""
    vertices, triangles = found.volume.mesh()
    normals = vertex_normals(vertices, triangles)
    cuts = tuple(found.prisms), tuple(found.fillets), tuple(found.bends)
    return Hull(vertices, triangles, normals, found.volume.spacing, *cuts)


def _sample(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (N, 3) and normals (N, 3) spread evenly over a mesh, enough for the regions of the masks."""
    hull = Hull(vertices, triangles, vertex_normals(vertices, triangles), 0.0)
    return spread(hull, _REGION_SAMPLES, 0)[:2]


def hull_field(
    images: NDArray[np.int16], cameras: Cameras, resolution: int, threads: int
) -> tuple[NDArray[np.float32], NDArray[np.float64], float]:
    """Signed distance to the hull (n, n, n), inside positive; the grid's origin (3,) and spacing."""
    spacing = (1 + 2 * _MARGIN) / (resolution - 1)
    origin = np.full(3, -_MARGIN)
    field = np.empty((resolution,) * 3, np.float32)
    poses = np.ascontiguousarray(cameras.cam_from_unit[:, :3].reshape(-1, 12), np.float64)
    intrinsics = np.ascontiguousarray(cameras.intrinsics, np.float64)
    images = np.ascontiguousarray(images)
    load().bg_hull(
        pointer(images),
        pointer(poses),
        pointer(intrinsics),
        *images.shape,
        ctypes.c_float(_UNITS),
        pointer(origin),
        ctypes.c_double(spacing),
        resolution,
        ctypes.c_float(_BAND_VOXELS * spacing),
        pointer(field),
        threads,
    )
    # Close the surface at the grid's border, in case that silhouettes reach the images' frames.
    for axis in range(3):
        for side in (0, -1):
            np.moveaxis(field, axis, 0)[side] = -spacing
    return field, origin, spacing
