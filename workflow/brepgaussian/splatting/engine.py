"""One training step of stage 1 on the CPU kernels: render, losses, gradients; no torch."""

import ctypes
from dataclasses import dataclass, field

import numpy as np

from brepgaussian.splatting.camera import RenderOptions
from brepgaussian.splatting.library import Cloud, Floats, Raster, load, planes_shape, pointer, view_params
from brepgaussian.splatting.targets import Target

COVERED = 0.5  # alpha from which a pixel has a depth


@dataclass(frozen=True)
class LossWeights:
    """Weights of the terms of stage 1's loss; see `Stage1Settings`."""

    dssim: float
    alpha: float
    edge: float
    normal: float
    distortion: float


@dataclass
class Step:
    """What one step gives beside the gradients of the cloud."""

    gradients: Cloud
    screen: Floats
    weights: Floats
    losses: dict[str, float] = field(default_factory=dict)

    @property
    def loss(self) -> float:
        """The weighted sum."""
        return self.losses["total"]


def plane_gradients(
    planes: Floats, target: Target, weights: LossWeights, threads: int, into: Floats | None = None
) -> tuple[Floats, dict[str, float]]:
    """Losses of rendered planes against a target, and the planes' gradients, which may go `into` a given array."""
    library, camera = load(), target.camera
    gradients = np.empty_like(planes) if into is None else into
    gradients.fill(0)
    colors = len(target.colors)
    normal, m1, m2, alpha = colors + 1, colors + 4, colors + 5, colors + 6
    size = (camera.width, camera.height, target.stride)
    losses: dict[str, float] = {}

    def difference(plane: int, truth: Floats, weight: float, power: int) -> float:
        weight_c = ctypes.c_float(weight)
        args = (pointer(planes[plane]), pointer(truth), pointer(gradients[plane]), *size, weight_c, power, threads)
        return float(library.bg_difference(*args))

    share = 1 / colors
    losses["l1"] = sum(difference(c, target.colors[c], share * (1 - weights.dssim), 1) for c in range(colors)) * share
    total = (1 - weights.dssim) * losses["l1"]
    if weights.dssim > 0:
        losses["dssim"] = share * sum(
            float(
                library.bg_dssim(
                    pointer(planes[c]),
                    pointer(target.colors[c]),
                    pointer(gradients[c]),
                    *size,
                    ctypes.c_float(weights.dssim * share),
                    threads,
                )
            )
            for c in range(colors)
        )
        total += weights.dssim * losses["dssim"]
    if weights.alpha > 0:
        losses["alpha"] = difference(alpha, target.alpha, weights.alpha, 1)
        total += weights.alpha * losses["alpha"]
    if weights.edge > 0:
        losses["edge"] = difference(colors, target.edges, weights.edge, 2)
        total += weights.edge * losses["edge"]
    if weights.distortion > 0:
        images = (pointer(planes[k]) for k in (m1, m2, alpha))
        towards = (pointer(gradients[k]) for k in (m1, m2, alpha))
        losses["distortion"] = library.bg_distortion(
            *images, *towards, *size, ctypes.c_float(weights.distortion), threads
        )
        total += weights.distortion * losses["distortion"]
    if weights.normal > 0:
        losses["normal"] = library.bg_normal_consistency(
            *(pointer(planes[k]) for k in (normal, m1, alpha)),
            *(pointer(gradients[k]) for k in (normal, m1, alpha)),
            ctypes.c_int64(planes[0].size),
            *size,
            *(ctypes.c_float(v) for v in (camera.fx, camera.fy, camera.cx, camera.cy, camera.z_reference)),
            ctypes.c_float(COVERED),
            ctypes.c_float(weights.normal),
            threads,
        )
        total += weights.normal * losses["normal"]
    losses["total"] = total
    return gradients, losses


def training_step(raster: Raster, cloud: Cloud, target: Target, weights: LossWeights, options: RenderOptions) -> Step:
    """Render a view, compare it with its target, and differentiate."""
    view = view_params(target.camera, cloud.channels.shape[1], options)
    planes = raster.forward(cloud, view, raster.scratch("planes", planes_shape(view)))
    into, losses = plane_gradients(planes, target, weights, options.threads, raster.scratch("into", planes.shape))
    gradients, screen, summed = raster.backward(cloud, planes, into)
    return Step(gradients, screen, summed, losses)


def average_targets(cloud: Cloud, targets: list[Target], options: RenderOptions) -> tuple[Floats, Floats]:
    """Mean of what each surfel covers in all views, by compositing weight: (N, C) channels; and the weights (N,).

    The gradient of sum(w_i c_i t) with respect to c_i is the sum of w_i t: the backward pass does the gathering.
    """
    raster = Raster()
    total, seen = np.zeros(cloud.channels.shape), np.zeros(len(cloud))
    for target in targets:
        planes = raster.forward(cloud, view_params(target.camera, cloud.channels.shape[1], options))
        into = np.zeros_like(planes)
        into[: len(target.colors)] = target.colors
        into[len(target.colors)] = target.edges
        gradients, _, summed = raster.backward(cloud, planes, into)
        total += gradients.channels
        seen += summed
    mean = total / np.maximum(seen, 1e-6)[:, None]
    return mean.astype(np.float32), seen.astype(np.float32)
