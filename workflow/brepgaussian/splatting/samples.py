"""Pixels with a patch id, and the frozen compositing weights of the surfels behind them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.stage1 import Surfels
from brepgaussian.artifacts.views import Views
from brepgaussian.settings.stage2 import Stage2Settings
from brepgaussian.splatting.camera import RenderOptions, camera_of
from brepgaussian.splatting.library import Cloud, Raster, view_params

_LIMIT = 48  # surfels a pixel: opaque surfaces need far fewer


@dataclass(frozen=True)
class Samples:
    """The samples of one view.

    Attributes:
        weights: (P, N) sparse CSR float32 compositing weights w_i (paper, section 3.2).
        patches: (P,) int16 region of each sample.
    """

    weights: "scipy.sparse.csr_array"  # type: ignore[name-defined]  # noqa: F821
    patches: NDArray[np.int16]


def cloud_of(surfels: Surfels) -> Cloud:
    """Surfels as the kernels take them, with their edge value as the only channel."""
    arrays = (surfels.centers, surfels.rotations, surfels.scales, surfels.opacities, surfels.edges[:, None])
    return Cloud(*(np.ascontiguousarray(a, np.float32) for a in arrays))


def sample_views(
    views: Views, patches: NDArray[np.int16], surfels: Surfels, settings: Stage2Settings, threads: int
) -> list[Samples]:
    """Sample every view once; geometry is frozen, so that the weights never have to be rendered again."""
    from scipy.sparse import csr_array

    rng = np.random.default_rng(settings.seed)
    raster, cloud, result = Raster(), cloud_of(surfels), []
    for view, ids in enumerate(patches):
        pixels = sample_pixels(ids, settings, rng)
        if len(pixels) == 0:
            continue
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        x0, y0 = int(low[0]), int(low[1])
        camera = camera_of(views.cameras, view).crop(x0, y0, int(high[0]) - x0 + 1, int(high[1]) - y0 + 1)
        raster.project(cloud, view_params(camera, 1, RenderOptions(threads=threads)))
        found, weights, counts = raster.weights(pixels - (x0, y0), _LIMIT)
        used = np.arange(_LIMIT) < counts[:, None]
        starts = np.concatenate([[0], np.cumsum(counts)])
        matrix = csr_array((weights[used], found[used], starts), shape=(len(pixels), len(cloud)))
        hit = counts > 0
        result.append(Samples(matrix[hit], ids[pixels[hit, 1], pixels[hit, 0]]))
    return result


def sample_pixels(ids: NDArray[np.int16], settings: Stage2Settings, rng: np.random.Generator) -> NDArray[np.int32]:
    """(P, 2) pixels (x, y): an equal share for each region that is large enough, at least two."""
    import cv2

    regions, sizes = np.unique(ids[ids > 0], return_counts=True)
    regions = regions[sizes >= settings.min_patch_px]
    if len(regions) < 2:
        return np.zeros((0, 2), np.int32)
    same = np.ones(ids.shape, np.uint8)  # 0 where a neighbour belongs to another region
    same[:, 1:] &= ids[:, 1:] == ids[:, :-1]
    same[:, :-1] &= ids[:, 1:] == ids[:, :-1]
    same[1:] &= ids[1:] == ids[:-1]
    same[:-1] &= ids[1:] == ids[:-1]
    inner = cv2.distanceTransform(same, cv2.DIST_L2, 3) >= settings.border_px
    share = max(2, settings.samples_per_view // len(regions))
    chosen = []
    for region in regions:
        rows, columns = np.nonzero((ids == region) & inner)
        if len(rows) < 2:
            rows, columns = np.nonzero(ids == region)
        pick = rng.choice(len(rows), min(share, len(rows)), replace=False)
        chosen.append(np.column_stack([columns[pick], rows[pick]]))
    return np.concatenate(chosen).astype(np.int32)
