"""The compiled kernels as Python functions on contiguous float32 arrays (ctypes; no torch headers)."""

import ctypes
import functools
import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.splatting.build import build_kernel
from brepgaussian.splatting.camera import Camera, RenderOptions

Floats = NDArray[np.float32]

TILE = 8
EXTRA_PLANES = 7  # normal (3), m, m^2, alpha, median depth follow the caller's channels


class ViewParams(ctypes.Structure):
    """Mirror of `ViewParams` in kernels/raster.h."""

    _fields_ = [
        ("rotation", ctypes.c_float * 9),
        ("translation", ctypes.c_float * 3),
        *((n, ctypes.c_float) for n in ("fx", "fy", "cx", "cy", "z_reference", "near", "cutoff", "transmittance")),
        *((n, ctypes.c_float) for n in ("low_pass", "alpha_max", "grazing")),
        *((n, ctypes.c_int32) for n in ("width", "height", "stride", "channels", "cull", "threads")),
    ]


def view_params(camera: Camera, channels: int, options: RenderOptions) -> ViewParams:
    """The kernels' description of a view."""
    pose = camera.cam_from_unit
    return ViewParams(
        rotation=(ctypes.c_float * 9)(*pose[:3, :3].ravel()),
        translation=(ctypes.c_float * 3)(*pose[:3, 3]),
        fx=camera.fx,
        fy=camera.fy,
        cx=camera.cx,
        cy=camera.cy,
        z_reference=camera.z_reference,
        near=options.near,
        cutoff=options.cutoff,
        transmittance=options.transmittance,
        low_pass=1 / options.low_pass_px**2 if options.low_pass_px > 0 else -1,
        alpha_max=options.alpha_max,
        grazing=options.grazing,
        width=camera.width,
        height=camera.height,
        stride=-(-camera.width // TILE) * TILE,
        channels=channels,
        cull=int(options.cull),
        threads=options.threads,
    )


def planes_shape(view: ViewParams) -> tuple[int, int, int]:
    """Shape of a view's planes: whole tiles."""
    return view.channels + EXTRA_PLANES, -(-view.height // TILE) * TILE, view.stride


@functools.cache
def load() -> ctypes.CDLL:
    """Load the kernels, compiling them first when needed."""
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")  # waiting threads give way to other jobs on the machine
    library = ctypes.CDLL(str(build_kernel()))
    library.bg_create.restype = ctypes.c_void_p
    for name in ("bg_pairs", "bg_meet"):
        getattr(library, name).restype = ctypes.c_int64
    for name in ("bg_dssim", "bg_difference", "bg_distortion", "bg_normal_consistency"):
        getattr(library, name).restype = ctypes.c_double
    return library


def pointer(array: NDArray[np.generic]) -> ctypes.c_void_p:
    """Address of a contiguous array."""
    if not array.flags.c_contiguous:
        raise ValueError("the kernels need contiguous arrays")
    return ctypes.c_void_p(array.ctypes.data)


@dataclass
class Cloud:
    """Surfels in natural values: contiguous float32 (N, 3), (N, 4), (N, 2), (N,), (N, C)."""

    centers: Floats
    quaternions: Floats
    scales: Floats
    opacities: Floats
    channels: Floats

    def __len__(self) -> int:
        return len(self.centers)

    def arrays(self) -> tuple[Floats, ...]:
        """All arrays in the kernels' order."""
        return self.centers, self.quaternions, self.scales, self.opacities, self.channels

    def pointers(self) -> tuple[ctypes.c_void_p, ...]:
        """Their addresses."""
        return tuple(pointer(a) for a in self.arrays())


class Raster:
    """One view's rasterisation state: `forward`, then `backward` or `weights` on the same cloud."""

    def __init__(self) -> None:
        self._library = load()
        self._handle = ctypes.c_void_p(self._library.bg_create())
        self._view = ViewParams()
        self._scratch: dict[str, Floats] = {}

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self._library.bg_destroy(self._handle)
            self._handle = ctypes.c_void_p()

    @property
    def pairs(self) -> int:
        """Number of surfel-tile pairs of the last forward pass."""
        return int(self._library.bg_pairs(self._handle))

    def scratch(self, name: str, shape: tuple[int, ...]) -> Floats:
        """An array with any content, whose memory the next call of the same name takes again.

        For what every step makes anew: fresh pages can cost more than the arithmetic on them.
        """
        size = int(np.prod(shape))
        if name not in self._scratch or self._scratch[name].size < size:
            self._scratch[name] = np.empty(size, np.float32)
        return self._scratch[name][:size].reshape(shape)

    def forward(self, cloud: Cloud, view: ViewParams, planes: Floats | None = None) -> Floats:
        """Render (C + 7, padded rows, stride) planes: channels, normal, m, m^2, alpha, median depth."""
        self._view = view
        if planes is None:
            planes = np.empty(planes_shape(view), np.float32)
        self._library.bg_forward(
            self._handle, ctypes.byref(view), ctypes.c_int64(len(cloud)), *cloud.pointers(), pointer(planes)
        )
        return planes

    def project(self, cloud: Cloud, view: ViewParams) -> None:
        """Project and bin without rendering: enough for `weights`."""
        self._view = view
        self._library.bg_project(self._handle, ctypes.byref(view), ctypes.c_int64(len(cloud)), *cloud.pointers())

    def backward(self, cloud: Cloud, planes: Floats, gradients: Floats) -> tuple[Cloud, Floats, Floats]:
        """Gradients of the cloud, of the projected centres (N, 2) in px, and the summed weights (N,)."""
        result = Cloud(*(np.empty_like(a) for a in cloud.arrays()))
        screen, weights = np.empty((len(cloud), 2), np.float32), np.empty(len(cloud), np.float32)
        self._library.bg_backward(
            self._handle,
            *cloud.pointers(),
            pointer(planes),
            pointer(gradients),
            *result.pointers(),
            pointer(screen),
            pointer(weights),
        )
        return result, screen, weights

    def weights(self, pixels: NDArray[np.int32], limit: int) -> tuple[NDArray[np.int32], Floats, NDArray[np.int32]]:
        """Compositing weights at (P, 2) pixels (x, y): surfels (P, limit), weights (P, limit), counts (P,)."""
        pixels = np.ascontiguousarray(pixels, np.int32)
        surfels = np.zeros((len(pixels), limit), np.int32)
        weights = np.zeros((len(pixels), limit), np.float32)
        counts = np.zeros(len(pixels), np.int32)
        self._library.bg_weights(
            self._handle,
            ctypes.c_int64(len(pixels)),
            pointer(pixels),
            ctypes.c_int32(limit),
            pointer(surfels),
            pointer(weights),
            pointer(counts),
        )
        return surfels, weights, counts
