"""gsplat's `rasterization_2dgs` behind the project's interface (optional: `pip install gsplat`, CUDA).

Two things differ from the other backends, both gsplat's: a surfel's depth is its centre's in every pixel that it
covers, and the screen-space filter always has 2DGS' width (0.71 px), so that `low_pass_px` is not obeyed.
"""

import importlib.util
from typing import Any

import torch
from torch import Tensor

from brepgaussian.errors import ToolError
from brepgaussian.splatting.camera import Camera, RenderOptions
from brepgaussian.splatting.render import SurfelTensors

_FAR = 1e4  # unit frame: never reached


def is_available() -> bool:
    """Whether there is a CUDA device and gsplat is installed."""
    return importlib.util.find_spec("gsplat") is not None and torch.cuda.is_available()


def planes(surfels: SurfelTensors, camera: Camera, options: RenderOptions) -> Tensor:
    """Raw planes of a view; see `render.PlaneFunction`.

    Raises:
        ToolError: gsplat or a CUDA device is missing.
    """
    if importlib.util.find_spec("gsplat") is None:
        raise ToolError("the package gsplat is missing, which device: cuda needs", fix="pip install gsplat")
    if not torch.cuda.is_available():
        raise ToolError("torch finds no CUDA device, which device: cuda needs", fix="use device: cpu")
    from gsplat.rendering import rasterization_2dgs

    device = surfels.centers.device
    like: dict[str, Any] = {"dtype": torch.float32, "device": device}
    pose = torch.as_tensor(camera.cam_from_unit, **like)
    calibration = torch.tensor([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]], **like)
    depth = surfels.centers @ pose[2, :3] + pose[2, 3] - camera.z_reference  # (N,) m at the centre
    values = torch.cat([surfels.channels(), depth[:, None], depth[:, None] ** 2], dim=1)
    opacities = surfels.opacities
    if options.cull:
        from brepgaussian.splatting.reference import rotation_matrices

        normals = rotation_matrices(surfels.quaternions)[:, :, 2] @ pose[:3, :3].T
        front = (normals * (surfels.centers @ pose[:3, :3].T + pose[:3, 3])).sum(1) < 0
        opacities = opacities * front
    flat = torch.cat([surfels.scales, torch.full_like(surfels.scales[:, :1], 1e-6)], dim=1)
    color, alpha, normal, _, _, median, _ = rasterization_2dgs(
        means=surfels.centers,
        quats=surfels.quaternions,
        scales=flat,
        opacities=opacities,
        colors=values,
        viewmats=pose[None],
        Ks=calibration[None],
        width=camera.width,
        height=camera.height,
        near_plane=options.near,
        far_plane=_FAR,
        render_mode="RGB",
    )
    color, alpha, median = color[0].movedim(-1, 0), alpha[0, ..., 0], median[0, ..., 0]
    normal = torch.einsum("hwc,dc->dhw", normal[0], pose[:3, :3])  # gsplat gives world normals
    return torch.cat([color[:-2], normal, color[-2:], alpha[None], median[None]])
