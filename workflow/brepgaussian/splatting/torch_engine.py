"""One training step of stage 1 through autograd, for the `cuda` and `reference` backends; same losses, slower."""

from importlib import import_module

import numpy as np
import torch
from torch import Tensor

from brepgaussian.splatting import cuda
from brepgaussian.splatting.camera import Camera, RenderOptions
from brepgaussian.splatting.engine import COVERED, LossWeights, Step
from brepgaussian.splatting.library import Cloud, Floats
from brepgaussian.splatting.losses import distortion, dssim, edge_loss, normal_consistency
from brepgaussian.splatting.render import BACKENDS, SurfelTensors
from brepgaussian.splatting.targets import Target


def plane_losses(planes: Tensor, target: Target, weights: LossWeights) -> tuple[Tensor, dict[str, float]]:
    """The weighted sum of the losses of rendered planes (C + 8, H, W), and its terms."""
    camera = target.camera

    def image(array: Floats) -> Tensor:
        cropped = np.ascontiguousarray(array[..., : camera.height, : camera.width])
        return torch.as_tensor(cropped, dtype=planes.dtype, device=planes.device)

    colors = len(target.colors)
    truth = image(target.colors)
    normal, (m, m2, alpha) = planes[colors + 1 : colors + 4], planes[colors + 4 : colors + 7]
    terms = {
        "l1": ((1 - weights.dssim), (planes[:colors] - truth).abs().mean()),
        "dssim": (weights.dssim, torch.stack([dssim(planes[c], truth[c]) for c in range(colors)]).mean()),
        "alpha": (weights.alpha, (alpha - image(target.alpha)).abs().mean()),
        "edge": (weights.edge, edge_loss(planes[colors], image(target.edges))),
        "distortion": (weights.distortion, distortion(m, m2, alpha)),
        "normal": (weights.normal, normal_consistency(normal, m, alpha, camera, COVERED)),
    }
    total = torch.stack([weight * value for weight, value in terms.values() if weight > 0]).sum()
    losses = {name: float(value.detach()) for name, (weight, value) in terms.items() if weight > 0 or name == "l1"}
    return total, {**losses, "total": float(total.detach())}


def training_step_torch(
    backend: str, cloud: Cloud, target: Target, weights: LossWeights, options: RenderOptions
) -> Step:
    """Render a view with a backend, compare it with its target, and differentiate.

    Every surfel counts as seen, with a weight of 1, whose opacity has a gradient.
    """
    device = cuda.load()[1] if backend == "cuda" else "cpu"
    leaves = [torch.tensor(a, device=device, requires_grad=True) for a in cloud.arrays()]
    surfels = SurfelTensors(leaves[0], leaves[1], leaves[2], leaves[3], leaves[4][:, :-1], leaves[4][:, -1])
    planes = import_module(f"brepgaussian.splatting.{BACKENDS[backend]}").planes(surfels, target.camera, options)
    total, losses = plane_losses(planes, target, weights)
    grads = torch.autograd.grad(total, leaves, materialize_grads=True)
    gradients = Cloud(*(np.ascontiguousarray(g.cpu().numpy()) for g in grads))
    screen = screen_gradients(cloud.centers, gradients.centers, target.camera)
    return Step(gradients, screen, (gradients.opacities != 0).astype(np.float32), losses)


def screen_gradients(centers: Floats, gradients: Floats, camera: Camera) -> Floats:
    """(N, 2) gradients of the projected centres in px: of a shift across the view that moves them by a pixel."""
    pose = camera.cam_from_unit
    depth = centers @ pose[2, :3] + pose[2, 3]
    across = gradients @ pose[:2, :3].T
    return np.ascontiguousarray(across * (depth[:, None] / [camera.fx, camera.fy]), np.float32)
