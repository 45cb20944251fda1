"""The C++ kernels as an autograd function."""

from typing import Any

import numpy as np
import torch
from torch import Tensor

from brepgaussian.splatting.camera import Camera, RenderOptions
from brepgaussian.splatting.library import Cloud, Raster, view_params
from brepgaussian.splatting.render import SurfelTensors


def planes(surfels: SurfelTensors, camera: Camera, options: RenderOptions) -> Tensor:
    """Raw planes of a view; see `render.PlaneFunction`. Computes in float32, returns the surfels' dtype."""
    arrays = (surfels.centers, surfels.quaternions, surfels.scales, surfels.opacities, surfels.channels())
    result: Tensor = _Rasterise.apply(camera, options, *arrays)
    return result


class _Rasterise(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, camera: Camera, options: RenderOptions, *arrays: Tensor) -> Tensor:
        ctx.cloud = Cloud(*(np.ascontiguousarray(a.detach().numpy(), np.float32) for a in arrays))
        ctx.raster, ctx.size = Raster(), (camera.height, camera.width)
        view = view_params(camera, ctx.cloud.channels.shape[1], options)
        ctx.planes, ctx.dtype = ctx.raster.forward(ctx.cloud, view), arrays[0].dtype
        cropped = ctx.planes[:, : camera.height, : camera.width]
        return torch.from_numpy(np.ascontiguousarray(cropped)).to(ctx.dtype)

    @staticmethod
    def backward(ctx: Any, *upstream: Tensor) -> tuple[Tensor | None, ...]:
        gradients = np.zeros_like(ctx.planes)
        gradients[:, : ctx.size[0], : ctx.size[1]] = upstream[0].numpy()
        cloud, _, _ = ctx.raster.backward(ctx.cloud, ctx.planes, gradients)
        return (None, None, *(torch.from_numpy(a).to(ctx.dtype) for a in cloud.arrays()))
