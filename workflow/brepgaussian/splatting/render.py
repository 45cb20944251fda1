"""The differentiable 2DGS renderer: one interface, interchangeable backends.

Every backend maps surfels and a camera to the same raw planes; what users see is made from them here, once.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

import torch
from torch import Tensor

from brepgaussian.errors import SettingsError
from brepgaussian.splatting.camera import Camera, RenderOptions
from brepgaussian.splatting.library import EXTRA_PLANES

BACKENDS = {"reference": "reference", "cpu": "cpu", "cuda": "cuda"}


@dataclass(frozen=True)
class SurfelTensors:
    """Surfels as differentiable tensors, in natural values.

    Attributes:
        centers: (N, 3) unit frame; `quaternions` (N, 4) wxyz, of any length; `scales` (N, 2) unit frame;
            `opacities` (N,) in 0..1.
        colors: (N, C); `edges` (N,) edge value e; `features` (N, D) or None.
    """

    centers: Tensor
    quaternions: Tensor
    scales: Tensor
    opacities: Tensor
    colors: Tensor
    edges: Tensor
    features: Tensor | None = None

    def channels(self) -> Tensor:
        """(N, C + 1 + D): everything that is composited like a colour."""
        parts = [self.colors, self.edges[:, None]]
        return torch.cat(parts if self.features is None else [*parts, self.features], dim=1)


@dataclass(frozen=True)
class Rendering:
    """What a view looks like; (H, W) unless said otherwise.

    Attributes:
        colors: (H, W, C) composited over black.
        alpha: coverage.
        depth: expected depth along the camera's z axis, unit frame; 0 where nothing is seen.
        median_depth: depth where transmittance crosses one half; 0 where it does not.
        normals: (H, W, 3) composited normals in the unit frame, towards the camera, as long as alpha at most.
        distortion: sum_ij w_i w_j (z_i - z_j)^2, unit-frame lengths squared (2DGS, section 5).
        edges: composited edge value E(u) (paper, section 3.2).
        features: (H, W, D) composited features.
    """

    colors: Tensor
    alpha: Tensor
    depth: Tensor
    median_depth: Tensor
    normals: Tensor
    distortion: Tensor
    edges: Tensor
    features: Tensor


PlaneFunction = Callable[[SurfelTensors, Camera, RenderOptions], Tensor]
"""(C + 1 + D + 7, H, W): channels, normal in the camera frame (3), m, m^2, alpha, median depth.

m = z - z_reference is composited as sum of w_i m_i, without division by alpha.
"""


def choose_backend(device: str) -> str:
    """The backend of a `device` setting; a device that was asked for is never replaced by another.

    Raises:
        ToolError: gsplat or the CUDA device that was asked for is missing.
        SettingsError: there is no such device.
    """
    from brepgaussian.splatting import cuda

    if device == "cuda":
        cuda.load()
    if device == "auto":
        return "cuda" if cuda.is_available() else "cpu"
    if device not in BACKENDS:
        raise SettingsError(f"device is {device!r}", fix="use one of: auto, cpu, cuda")
    return device


def render(
    surfels: SurfelTensors, camera: Camera, options: RenderOptions | None = None, backend: str = "cpu"
) -> Rendering:
    """Render one view, differentiably in every surfel parameter.

    Args:
        surfels: what to render.
        camera: view and window.
        options: cut-offs.
        backend: `reference` (plain torch, slow, any device and dtype), `cpu` (C++ kernels) or `cuda` (gsplat).

    Raises:
        ToolError: the backend's compiler, package or device is missing.
    """
    module = import_module(f"brepgaussian.splatting.{BACKENDS[backend]}")
    planes: Tensor = module.planes(surfels, camera, options or RenderOptions())
    return finish(planes, surfels, camera)


def finish(planes: Tensor, surfels: SurfelTensors, camera: Camera) -> Rendering:
    """Make the rendering from a backend's raw planes."""
    colors = surfels.colors.shape[1]
    channels = len(planes) - EXTRA_PLANES
    normal, (m, m2, alpha, median) = planes[channels : channels + 3], planes[channels + 3 :]
    rotation = torch.as_tensor(camera.cam_from_unit[:3, :3], dtype=planes.dtype, device=planes.device)
    covered = alpha > 0
    safe = torch.where(covered, alpha, torch.ones_like(alpha))
    return Rendering(
        colors=planes[:colors].movedim(0, -1),
        alpha=alpha,
        depth=torch.where(covered, m / safe + camera.z_reference, torch.zeros_like(m)),
        median_depth=median,
        normals=torch.einsum("chw,cd->hwd", normal, rotation),
        distortion=2 * (alpha * m2 - m * m),
        edges=planes[colors],
        features=planes[colors + 1 : channels].movedim(0, -1),
    )
