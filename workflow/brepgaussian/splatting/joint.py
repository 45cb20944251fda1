"""The ablation without two stages: patch features trained together with the geometry, which they pull at."""

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.masks import Masks
from brepgaussian.settings.stage2 import Stage2Settings
from brepgaussian.splatting.camera import RenderOptions
from brepgaussian.splatting.contrastive import LOSSES, normalised, through_normalisation
from brepgaussian.splatting.library import Cloud, Floats, Raster, view_params
from brepgaussian.splatting.parameters import BETA1, BETA2, EPSILON
from brepgaussian.splatting.samples import sample_pixels
from brepgaussian.splatting.targets import Target


class JointFeatures:
    """Features of all surfels, and what one step of their training does to the geometry.

    Args:
        masks: patch ids of all views at full resolution.
        scale: training pixels per full-resolution pixel.
        centers: (N, 3) surfel centres, by which features follow densification.
        seed: of the random start and the samples.
        weight: of L_tri beside stage 1's loss.
    """

    def __init__(self, masks: Masks, scale: float, centers: Floats, seed: int, weight: float) -> None:
        self._settings, self._masks, self._scale, self._weight = Stage2Settings(seed=seed), masks, scale, weight
        self._rng = np.random.default_rng(seed)
        self._raster, self._step, self._centers = Raster(), 0, centers.copy()
        start = self._rng.standard_normal((len(centers), self._settings.dimensions)).astype(np.float32)
        self.features = normalised(start)[0]
        self._first, self._second = np.zeros_like(start), np.zeros_like(start)

    def step(
        self, cloud: Cloud, view: int, target: Target, origin: tuple[int, int], options: RenderOptions
    ) -> Cloud | None:
        """Train the features on one view; returns the gradients of the geometry, or None without samples.

        Args:
            cloud: the surfels.
            view: index of the view.
            target: its target, for the camera.
            origin: (x, y) of the target's crop in the training image.
            options: cut-offs.
        """
        pixels = self._pixels(view, target, origin)
        if len(pixels) == 0:
            return None
        joint = Cloud(cloud.centers, cloud.quaternions, cloud.scales, cloud.opacities, self.features)
        size = self.features.shape[1]
        planes = self._raster.forward(joint, view_params(target.camera, size, options))
        rows, columns, ids = pixels[:, 1], pixels[:, 0], pixels[:, 2].astype(np.int16)
        unit, length = normalised(np.ascontiguousarray(planes[:size, rows, columns].T))
        _, gradient = LOSSES[self._settings.loss](unit, ids, self._settings.margin, self._rng)
        gradient = self._weight * through_normalisation(gradient, unit, length)
        into = np.zeros_like(planes)
        into[:size, rows, columns] = gradient.T
        result, _, _ = self._raster.backward(joint, planes, into)
        self._update(result.channels)
        return result

    def follow(self, centers: Floats) -> None:
        """After densification every surfel takes the features of the nearest surfel before it."""
        from scipy.spatial import cKDTree

        near = cKDTree(self._centers).query(centers)[1]
        self._centers = centers.copy()
        self.features, self._first, self._second = (a[near] for a in (self.features, self._first, self._second))

    def _pixels(self, view: int, target: Target, origin: tuple[int, int]) -> NDArray[np.int32]:
        """(P, 3) x, y in the crop, and patch id; one sample a training pixel at most."""
        ids = self._masks.patches[view]
        full = sample_pixels(ids, self._settings, self._rng)
        if len(full) == 0:
            return np.zeros((0, 3), np.int32)
        x = (full[:, 0] * self._scale).astype(np.int32) - origin[0]
        y = (full[:, 1] * self._scale).astype(np.int32) - origin[1]
        inside = (x >= 0) & (y >= 0) & (x < target.camera.width) & (y < target.camera.height)
        found = np.column_stack([x, y, ids[full[:, 1], full[:, 0]]])[inside]
        return found[np.unique(found[:, :2], axis=0, return_index=True)[1]]

    def _update(self, gradient: Floats) -> None:
        self._step += 1
        self._first += (1 - BETA1) * (gradient - self._first)
        self._second += (1 - BETA2) * (gradient * gradient - self._second)
        rate = self._settings.rate * np.sqrt(1 - BETA2**self._step) / (1 - BETA1**self._step)
        self.features -= np.float32(rate) * self._first / (np.sqrt(self._second) + np.float32(EPSILON))
