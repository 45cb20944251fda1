"""Stage 1's losses in torch: the readable truth of kernels/losses.cpp, and what the other backends train with."""

from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor

from brepgaussian.splatting.camera import Camera

WINDOW, SIGMA = 11, 1.5  # of SSIM (Wang et al. 2004)
C1, C2 = 0.01**2, 0.03**2


def dssim(x: Tensor, y: Tensor) -> Tensor:
    """Mean of 1 - SSIM between two (H, W) images in 0..1; zeros outside."""
    offsets = torch.arange(WINDOW, dtype=x.dtype, device=x.device) - WINDOW // 2
    taps = torch.exp(-(offsets**2) / (2 * SIGMA**2))
    taps = taps / taps.sum()
    images = torch.stack([x, y, x * x, y * y, x * y])[:, None]
    images = F.conv2d(images, taps.view(1, 1, 1, -1), padding=(0, WINDOW // 2))
    mx, my, xx, yy, xy = F.conv2d(images, taps.view(1, 1, -1, 1), padding=(WINDOW // 2, 0))[:, 0]
    top = (2 * mx * my + C1) * (2 * (xy - mx * my) + C2)
    bottom = (mx * mx + my * my + C1) * (xx - mx * mx + yy - my * my + C2)
    return (1 - top / bottom).mean()


def edge_loss(rendered: Tensor, edges: Tensor) -> Tensor:
    """Mean squared difference of the edge maps (paper, L_edge, as a mean so that it doesn't grow with the image)."""
    return ((rendered - edges) ** 2).mean()


def distortion(m: Tensor, m2: Tensor, alpha: Tensor) -> Tensor:
    """Mean of sum_ij w_i w_j (m_i - m_j)^2 = 2 (A M2 - M1^2) (2DGS, section 5)."""
    return (2 * (alpha * m2 - m * m)).mean()


def depth_normals(depth: Tensor, camera: Camera) -> Tensor:
    """(3, H - 2, W - 2) unit normals, towards the camera, of the surface that a depth map (H, W) shows."""
    like: dict[str, Any] = {"dtype": depth.dtype, "device": depth.device}
    y, x = torch.meshgrid(
        torch.arange(camera.height, **like) + 0.5,
        torch.arange(camera.width, **like) + 0.5,
        indexing="ij",
    )
    points = depth * torch.stack([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, torch.ones_like(x)])
    across = points[:, 1:-1, 2:] - points[:, 1:-1, :-2]
    down = points[:, 2:, 1:-1] - points[:, :-2, 1:-1]
    return F.normalize(torch.cross(down, across, dim=0), dim=0)


def normal_consistency(normal: Tensor, m: Tensor, alpha: Tensor, camera: Camera, covered: float) -> Tensor:
    """1 - n . N, summed over pixels whose neighbours are covered, as a mean over the image (2DGS, section 5)."""
    solid = alpha > covered
    inner = solid[1:-1, 1:-1] & solid[1:-1, 2:] & solid[1:-1, :-2] & solid[2:, 1:-1] & solid[:-2, 1:-1]
    safe = torch.where(solid, alpha, torch.ones_like(alpha))
    depth = camera.z_reference + torch.where(solid, m / safe, torch.zeros_like(m))
    agreement = (normal[:, 1:-1, 1:-1] * depth_normals(depth, camera)).sum(0)
    return torch.where(inner, 1 - agreement, torch.zeros_like(agreement)).sum() / alpha.numel()
