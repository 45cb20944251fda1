"""What the named recipes of stage 1 stand for."""

from dataclasses import replace

import numpy as np

from brepgaussian.artifacts.views import Views
from brepgaussian.settings.stage1 import Stage1Settings
from brepgaussian.splatting.camera import RenderOptions
from brepgaussian.splatting.library import Cloud, Floats, Raster, view_params
from brepgaussian.splatting.parameters import Parameters
from brepgaussian.splatting.targets import Target, is_grey

_START_OPACITY = 0.1  # 3DGS
PAPER = {
    "image_size": 1600,  # never reduced
    "alpha_weight": 0.0,
    "dssim_weight": 0.2,
    "edge_weight": 0.1,
    "normal_weight": 0.05,  # 2DGS
    "distortion_weight": 0.0,  # 2DGS' default
    "low_pass_px": 0.71,
    "settle_sweeps": 0,
    "settle_every": 0,
    "concavities": False,
    "relief": False,
    "stop_gain": 0.0,
    "densify_every": 100,
    "opacity_reset_every": 3000,
    "position_rate": 1.6e-4,
    "rotation_rate": 1e-3,
    "scale_rate": 5e-3,
    "opacity_rate": 5e-2,
    "color_rate": 2.5e-3,
    "final_rate": 0.01,
    "shared_moment": False,
}
"""The paper's stage 1: the losses of its section 3.3 with the schedule of 3DGS and 2DGS, from random points."""


def effective(settings: Stage1Settings) -> Stage1Settings:
    """The settings that a recipe trains with."""
    if settings.recipe == "fast":
        return settings
    return replace(settings, iterations=settings.paper_iterations, **PAPER)  # type: ignore[arg-type]


def random_start(views: Views, settings: Stage1Settings) -> Parameters:
    """Surfels at random in the unit cube, turned at random (3DGS without a point cloud)."""
    rng = np.random.default_rng(settings.seed)
    count, channels = settings.surfels, (1 if is_grey(views) else 3) + 1
    quaternions = rng.standard_normal((count, 4))
    spacing = 0.55 * count ** (-1 / 3)  # mean distance to the nearest of `count` random points in a unit cube
    return Parameters(
        Cloud(
            rng.random((count, 3)).astype(np.float32),
            (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).astype(np.float32),
            np.full((count, 2), spacing, np.float32),
            np.full(count, _START_OPACITY, np.float32),
            np.full((count, channels), 0.5, np.float32),
        )
    )


def towards_cameras(parameters: Parameters, targets: list[Target], options: RenderOptions) -> Floats:
    """(N, 4) quaternions of the surfels with normals on the side from which the images see them.

    2DGS renders either side of a surfel, so that training from random points leaves the sign of normals to chance;
    everything after stage 1 takes them to point outwards. Views vote with the compositing weight of the surfel.
    """
    cloud, normals, raster = parameters.cloud, parameters.surfels().normals, Raster()
    away = np.zeros(len(cloud))
    for target in targets:
        pose = target.camera.cam_from_unit
        eye = -pose[:3, :3].T @ pose[:3, 3]
        planes = raster.forward(cloud, view_params(target.camera, cloud.channels.shape[1], options))
        _, _, weights = raster.backward(cloud, planes, np.ones_like(planes))  # where nothing comes in, none are summed
        away += weights * np.sign(np.einsum("nc,nc->n", normals, cloud.centers - eye))
    w, x, y, z = cloud.quaternions.T
    over = np.column_stack([-x, w, z, -y])  # half a turn about the disk's first axis
    return np.ascontiguousarray(np.where(away[:, None] > 0, over, cloud.quaternions), np.float32)
