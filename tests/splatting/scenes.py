"""Scenes for renderer tests."""

import numpy as np
import torch
from brepgaussian.splatting.camera import Camera, RenderOptions
from brepgaussian.splatting.render import SurfelTensors

# alpha > 1/255, the end at full opacity and the clamp are steps, which finite differences must not meet
SMOOTH = RenderOptions(cutoff=1e-6, transmittance=0.0, alpha_max=0.999)


def camera(width: int = 21, height: int = 18, cx: float | None = None, cy: float | None = None) -> Camera:
    """Looks at (.5, .5, .5) from 3 away, turned about the vertical."""
    angle = 0.4
    rotation = np.array([[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]])
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = np.array([0, 0, 3.0]) - rotation @ np.full(3, 0.5)
    focal = 2.2 * width
    return Camera(
        pose, focal, 1.1 * focal, width / 2 if cx is None else cx, height / 2 if cy is None else cy, width, height
    )


def surfels(count: int, seed: int, *, colors: int = 2, features: int = 3, size: float = 0.06) -> SurfelTensors:
    """Random disks in the unit cube, float64, requiring gradients."""
    rng = np.random.default_rng(seed)

    def leaf(array: np.ndarray) -> torch.Tensor:
        return torch.tensor(array, dtype=torch.float64, requires_grad=True)

    return SurfelTensors(
        centers=leaf(rng.uniform(0.2, 0.8, (count, 3))),
        quaternions=leaf(rng.standard_normal((count, 4))),
        scales=leaf(rng.uniform(0.5, 1.5, (count, 2)) * size),
        opacities=leaf(rng.uniform(0.2, 0.95, count)),
        colors=leaf(rng.random((count, colors))),
        edges=leaf(rng.random(count)),
        features=leaf(rng.standard_normal((count, features))),
    )


def leaves(scene: SurfelTensors) -> list[torch.Tensor]:
    """All tensors of a scene."""
    assert scene.features is not None
    return [
        scene.centers,
        scene.quaternions,
        scene.scales,
        scene.opacities,
        scene.colors,
        scene.edges,
        scene.features,
    ]
