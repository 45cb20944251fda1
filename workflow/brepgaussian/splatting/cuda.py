"""gsplat's 2DGS kernels behind the project's interface (optional: `pip install .[cuda]`, an NVIDIA GPU).

gsplat sorts, composites and differentiates; surfels are projected here, by the reference's own code, and what gsplat's
`rasterization_2dgs` does otherwise is mended on the way:

* It gives a surfel its centre's depth in all its pixels. Here depth is carried as an affine function of the pixel, and
  its square as the square of that: exact but for the second order of perspective within one surfel.
* Its screen-space filter cannot be turned off. It is a distance to a point that the caller gives: a far one is idle.
* It fills up channels with whatever is in memory, which can make gradients NaN: channels come filled up with zeros.
* It takes a median for the last surfel of a pixel that never becomes half opaque: there the median depth is 0.

Its own remain the cut-offs of alpha (1/255) and transmittance (1e-4, the surfel that falls below it is left out), the
filter's width (0.71 px) and the median depth, which is that of a surfel's centre. Sums are atomic: gradients differ by
rounding from run to run.
"""

import importlib.util
from types import ModuleType
from typing import Any

import torch
from torch import Tensor

from brepgaussian.errors import SettingsError, ToolError
from brepgaussian.splatting.camera import Camera, RenderOptions
from brepgaussian.splatting.library import EXTRA_PLANES
from brepgaussian.splatting.reference import Screen, project
from brepgaussian.splatting.render import SurfelTensors

_TILE = 16  # px; gsplat tests no other
_WIDTHS = (1, 2, 3, 4, 8, 16, 32, 64, 128, 256, 512)  # numbers of channels that gsplat has kernels for
_FILTER_PX = 0.5**0.5  # standard deviation of gsplat's filter
_FILTER_ROUNDING_PX = 0.01  # 2DGS' filter is written 0.71
_FAR_PX = 1e6  # a filter centred so far away is never the nearer one
_LARGEST_PX = 2.0**30  # of a box around a surfel: larger ones do not fit into 32 bits
_DEPTH_CHANNELS = 9  # m as 1, x, y; m^2 as 1, x, y, xx, xy, yy
_STEEPEST = 10.0  # tangent between a disk and the image (84 degrees): beyond it float32 loses m^2 to cancellation
_TINY = 1e-12  # keeps 0 / 0 out of slopes


def is_available() -> bool:
    """Whether there is a CUDA device and gsplat is installed."""
    return importlib.util.find_spec("gsplat") is not None and torch.cuda.is_available()


def planes(surfels: SurfelTensors, camera: Camera, options: RenderOptions) -> Tensor:
    """Raw planes of a view; see `render.PlaneFunction`. Computes in float32, returns the surfels' dtype and device.

    Raises:
        ToolError: gsplat or a CUDA device is missing.
        SettingsError: a filter that gsplat does not have.
    """
    gsplat, device = load()
    if options.low_pass_px > 0 and abs(options.low_pass_px - _FILTER_PX) > _FILTER_ROUNDING_PX:
        raise SettingsError(
            f"low_pass_px is {options.low_pass_px}, device: cuda has no such filter", fix="use 0, 0.71 or device: cpu"
        )
    screen = project(_moved(surfels, device), camera, options)
    channels = screen.channels.shape[1]
    if len(screen.p):
        result = _composite(gsplat, screen, camera, options)
    else:  # gsplat has no answer to nothing
        shape = (channels + EXTRA_PLANES, camera.height, camera.width)
        result = torch.zeros(shape, device=device) + 0 * screen.p.sum()
    return result.to(surfels.centers.device, surfels.centers.dtype)


def load() -> tuple[ModuleType, str]:
    """gsplat, and the device that its kernels run on.

    Raises:
        ToolError: gsplat or a CUDA device is missing.
    """
    if importlib.util.find_spec("gsplat") is None:
        raise ToolError("the package gsplat is missing, which device: cuda needs", fix="pip install .[cuda]")
    if not torch.cuda.is_available():
        raise ToolError("torch finds no CUDA device, which device: cuda needs", fix="use device: cpu")
    return importlib.import_module("gsplat"), "cuda"


def _moved(surfels: SurfelTensors, device: str) -> SurfelTensors:
    like: dict[str, Any] = {"device": device, "dtype": torch.float32}
    features = surfels.features
    return SurfelTensors(
        surfels.centers.to(**like),
        surfels.quaternions.to(**like),
        surfels.scales.to(**like),
        surfels.opacities.to(**like),
        surfels.colors.to(**like),
        surfels.edges.to(**like),
        None if features is None else features.to(**like),
    )


def _composite(gsplat: ModuleType, screen: Screen, camera: Camera, options: RenderOptions) -> Tensor:
    """(planes, H, W) of at least one surfel; the leading 1 of gsplat's arrays counts views."""
    rows, columns = -(-camera.height // _TILE), -(-camera.width // _TILE)
    radii = screen.reach.detach().ceil().clamp_max(_LARGEST_PX).to(torch.int32)
    _, ids, order = gsplat.isect_tiles(
        screen.center.detach()[None],
        torch.stack([radii, radii], dim=1)[None],
        screen.p[:, 2].detach()[None],
        _TILE,
        columns,
        rows,
    )
    offsets = gsplat.isect_offset_encode(ids, 1, columns, rows).reshape(1, rows, columns)
    filtered = screen.center if options.low_pass_px > 0 else torch.full_like(screen.center, _FAR_PX)
    values = _values(screen, camera, options)
    color, alpha, normal, _, median = gsplat.rasterize_to_pixels_2dgs(
        filtered[None],
        _ray_transforms(screen, camera)[None],
        values[None],
        screen.opacity.clamp_max(options.alpha_max)[None],
        screen.n[None],
        torch.zeros_like(screen.center)[None],
        camera.width,
        camera.height,
        _TILE,
        offsets,
        order,
    )
    color, normal = color[0].movedim(-1, 0), normal[0].movedim(-1, 0)
    alpha, median = alpha[0, ..., 0], median[0, ..., 0]
    channels = screen.channels.shape[1]
    x, y = _rays(camera, color)
    one, mx, my, mm, mmx, mmy, mmxx, mmxy, mmyy = color[channels : channels + _DEPTH_CHANNELS]
    m = one + mx * x + my * y
    m2 = mm + mmx * x + mmy * y + mmxx * x * x + mmxy * x * y + mmyy * y * y
    half = torch.where(alpha >= 0.5, median + camera.z_reference, torch.zeros_like(median))
    return torch.cat([color[:channels], normal, torch.stack([m, m2, alpha, half])])


def _rays(camera: Camera, like: Tensor) -> tuple[Tensor, Tensor]:
    """(W,) and (H, 1) coordinates of pixels on the plane z = 1."""
    x = (torch.arange(camera.width, device=like.device) + 0.5 - camera.cx) / camera.fx
    y = (torch.arange(camera.height, device=like.device) + 0.5 - camera.cy) / camera.fy
    return x.to(like.dtype), y.to(like.dtype)[:, None]


def _ray_transforms(screen: Screen, camera: Camera) -> Tensor:
    """(N, 3, 3) from (u, v, 1) on a disk to homogeneous pixels."""
    disk = torch.stack([screen.u, screen.v, screen.p], dim=2)  # columns
    calibration = torch.tensor([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    return calibration.to(disk) @ disk


def _values(screen: Screen, camera: Camera, options: RenderOptions) -> Tensor:
    """(N, one of `_WIDTHS`): channels, depth and its square as polynomials, zeros, m at the centre (for the median)."""
    depth = screen.p[:, 2:]
    center = depth - camera.z_reference
    slope = _slopes(screen, camera, options)
    one = center - (slope * screen.p[:, :2] / depth).sum(1, keepdim=True)
    (a, b), c = slope.split(1, dim=1), one
    m, m2 = [c, a, b], [c * c, 2 * c * a, 2 * c * b, a * a, 2 * a * b, b * b]
    used = screen.channels.shape[1] + _DEPTH_CHANNELS + 1
    width = next((w for w in _WIDTHS if w >= used), None)
    if width is None:
        raise SettingsError(f"{used} channels are more than device: cuda has", fix="use fewer features")
    empty = torch.zeros((len(depth), width - used), dtype=depth.dtype, device=depth.device)
    return torch.cat([screen.channels, *m, *m2, empty, center], dim=1)


def _slopes(screen: Screen, camera: Camera, options: RenderOptions) -> Tensor:
    """(N, 2) change of depth along the x and y of rays.

    A plane n.p = k has z = k / n.d, whose derivative at the centre is -z^2 n / k. It is limited for disks seen nearly
    edge on; with the filter also to the disk's own depth a filter's width, because pixels off the disk are filled.
    """
    depth = screen.p[:, 2:]
    slope = -(depth**2) * screen.n[:, :2] / (screen.n * screen.p).sum(1, keepdim=True)
    with torch.no_grad():
        limit = _STEEPEST * depth
        if options.low_pass_px > 0:
            own = torch.hypot(screen.u[:, 2:], screen.v[:, 2:])
            limit = torch.minimum(limit, own / _FILTER_PX * min(camera.fx, camera.fy))
        share = (limit / slope.norm(dim=1, keepdim=True).clamp_min(_TINY)).clamp_max(1.0)
    return slope * share
