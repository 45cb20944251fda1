"""The readable renderer: plain torch, any device and dtype, autograd throughout. Slow; the truth for the others."""

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from brepgaussian.splatting.camera import Camera, RenderOptions
from brepgaussian.splatting.library import EXTRA_PLANES
from brepgaussian.splatting.render import SurfelTensors

_BLOCK = 32  # pixels along a block's side: surfels x pixels of one block are held at a time


@dataclass(frozen=True)
class Screen:
    """The surfels that a view can show, in the camera frame, near to far.

    Attributes:
        p: (N, 3) centres; `u`, `v` (N, 3) the disk's axes, a standard deviation long; `n` (N, 3) normals towards the
            camera.
        center: (N, 2) projected centre, px.
        opacity: (N,).
        rho_max: (N,) squared radius at which alpha falls to the cut-off.
        reach: (N,) half a box around `center` that holds all of the surfel, px.
        channels: (N, C).
    """

    p: Tensor
    u: Tensor
    v: Tensor
    n: Tensor
    center: Tensor
    opacity: Tensor
    rho_max: Tensor
    reach: Tensor
    channels: Tensor


def rotation_matrices(quaternions: Tensor) -> Tensor:
    """(N, 3, 3) rotations of (N, 4) quaternions wxyz of any length; columns are t_u, t_v, normal."""
    w, x, y, z = torch.nn.functional.normalize(quaternions, dim=1).unbind(1)
    rows = [
        torch.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], dim=-1),
        torch.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], dim=-1),
        torch.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], dim=-1),
    ]
    return torch.stack(rows, dim=1)


def planes(surfels: SurfelTensors, camera: Camera, options: RenderOptions) -> Tensor:
    """Raw planes of a view; see `render.PlaneFunction`."""
    screen = project(surfels, camera, options)
    rows = []
    for y in range(0, camera.height, _BLOCK):
        blocks = []
        for x in range(0, camera.width, _BLOCK):
            box = (x, y, min(x + _BLOCK, camera.width), min(y + _BLOCK, camera.height))
            blocks.append(_block(screen, camera, options, box))
        rows.append(torch.cat(blocks, dim=2))
    return torch.cat(rows, dim=1)


def project(surfels: SurfelTensors, camera: Camera, options: RenderOptions) -> Screen:
    """Leave out what a view cannot show, project the rest and sort it by depth."""
    like: dict[str, Any] = {"dtype": surfels.centers.dtype, "device": surfels.centers.device}
    pose = torch.as_tensor(camera.cam_from_unit, **like)
    p = surfels.centers @ pose[:3, :3].T + pose[:3, 3]
    axes = pose[:3, :3] @ rotation_matrices(surfels.quaternions)  # (N, 3, 3)
    tu, tv, n = axes.unbind(2)
    facing = (n * p).sum(1)
    n = torch.where(facing[:, None] > 0, -n, n)
    rho_max = 2 * torch.log(surfels.opacities.detach() / options.cutoff)
    su, sv = surfels.scales.unbind(1)
    # A disk that reaches the camera's plane has no bounded picture.
    bounded = rho_max * ((su * tu[:, 2]) ** 2 + (sv * tv[:, 2]) ** 2) < p[:, 2] ** 2
    visible = (p[:, 2] > options.near) & (surfels.opacities > options.cutoff) & bounded
    visible &= facing.abs() > options.grazing * p.norm(dim=1)
    if options.cull:
        visible &= facing < 0
    order = torch.argsort(p[:, 2].detach(), stable=True)
    order = order[visible[order]]
    p, tu, tv, n = p[order], tu[order], tv[order], n[order]
    focal = torch.tensor([camera.fx, camera.fy], **like)
    center = focal * p[:, :2] / p[:, 2:] + torch.tensor([camera.cx, camera.cy], **like)
    radius = surfels.scales[order].amax(1).detach() * rho_max[order].sqrt()  # of a ball around the disk
    low_pass = options.low_pass_px * rho_max[order].sqrt()
    nearest = (p[:, 2].detach() - radius).clamp_min(1e-9)
    # Half a ball's picture: its radius seen at its nearest depth, plus the shift of an off-axis centre.
    off_axis = 1 + (p[:, :2].abs() / p[:, 2:]).amax(1).detach()
    reach = torch.maximum(focal.max() * radius * off_axis / nearest, low_pass) + 1
    return Screen(
        p=p,
        u=tu * surfels.scales[order, :1],
        v=tv * surfels.scales[order, 1:],
        n=n,
        center=center,
        opacity=surfels.opacities[order],
        rho_max=rho_max[order],
        reach=reach,
        channels=surfels.channels()[order],
    )


def _block(screen: Screen, camera: Camera, options: RenderOptions, box: tuple[int, int, int, int]) -> Tensor:
    """Composite one block of pixels: (planes, rows, columns)."""
    x0, y0, x1, y1 = box
    low, high = screen.center.detach() - screen.reach[:, None], screen.center.detach() + screen.reach[:, None]
    near = (low[:, 0] < x1) & (low[:, 1] < y1) & (high[:, 0] > x0) & (high[:, 1] > y0)
    like: dict[str, Any] = {"dtype": screen.p.dtype, "device": screen.p.device}
    ys, xs = torch.meshgrid(torch.arange(y0, y1, **like), torch.arange(x0, x1, **like), indexing="ij")
    pixels = torch.stack([xs.reshape(-1), ys.reshape(-1)], dim=1) + 0.5  # (P, 2)
    shape = (screen.channels.shape[1] + EXTRA_PLANES, y1 - y0, x1 - x0)
    if not near.any():
        return torch.zeros(shape, **like) + 0 * screen.p.sum()  # stays differentiable
    rays = torch.stack(
        [(pixels[:, 0] - camera.cx) / camera.fx, (pixels[:, 1] - camera.cy) / camera.fy, torch.ones_like(pixels[:, 0])],
        dim=1,
    )  # (P, 3), z = 1
    p, u_axis, v_axis, n = screen.p[near], screen.u[near], screen.v[near], screen.n[near]
    a, b = u_axis / (u_axis**2).sum(1, keepdim=True), v_axis / (v_axis**2).sum(1, keepdim=True)
    # Ray meets plane: z = n.p / n.d; u and v are the hit's coordinates on the disk, in standard deviations.
    slope = n @ rays.T  # (S, P)
    meets = slope < 0
    z = (n * p).sum(1, keepdim=True) / torch.where(meets, slope, -torch.ones_like(slope))
    u = z * (a @ rays.T) - (a * p).sum(1, keepdim=True)
    v = z * (b @ rays.T) - (b * p).sum(1, keepdim=True)
    rho_max = screen.rho_max[near, None]
    rho = u**2 + v**2
    inside = meets & (rho <= rho_max)
    if options.low_pass_px > 0:
        filtered = ((pixels[None] - screen.center[near, None]) ** 2).sum(2) / options.low_pass_px**2
        flat = ~(inside & (rho <= filtered)) & (filtered <= rho_max)
        rho, z = torch.where(flat, filtered, rho), torch.where(flat, p[:, 2:], z)
        inside = inside | flat
    zero = torch.zeros_like(rho)
    alpha = screen.opacity[near, None] * torch.exp(-0.5 * torch.where(inside, rho, zero))
    alpha = torch.where(inside, alpha.clamp_max(options.alpha_max), zero)
    passed = torch.cumprod(1 - alpha, dim=0)
    before = torch.cat([torch.ones_like(passed[:1]), passed[:-1]])
    open_ = before.detach() >= options.transmittance
    alpha = torch.where(open_, alpha, zero)
    weights = alpha * before  # (S, P)
    after = 1 - torch.cumsum(weights, dim=0)
    m = torch.where(inside, z - camera.z_reference, zero)
    crossing = (weights > 0) & (after + weights > 0.5) & (after <= 0.5)
    values = torch.cat([screen.channels[near], n], dim=1)  # (S, C + 3)
    parts = [
        values.T @ weights,
        (weights * m).sum(0)[None],
        (weights * m * m).sum(0)[None],
        weights.sum(0)[None],
        torch.where(crossing, z, zero).sum(0)[None],
    ]
    return torch.cat(parts).reshape(shape)
