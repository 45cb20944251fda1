"""The camera of one rendering (a pinhole view cropped to the object's box, at any resolution) and its cut-offs."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.cameras import Cameras

NEAR = 1e-3  # unit frame
CUTOFF = 1 / 255  # alpha below it does not count (3DGS)
TRANSMITTANCE = 1e-4  # a pixel is done below it (3DGS)
ALPHA_MAX = 0.99  # 3DGS
GRAZING = 1e-3  # |cos| between ray and plane below which a surfel is edge-on: its disk is thinner than any pixel


@dataclass(frozen=True)
class RenderOptions:
    """Cut-offs of the rasteriser; the defaults are those of 3DGS and 2DGS, but for the filter.

    Attributes:
        low_pass_px: standard deviation of the screen-space filter in px; 0 = none (2DGS: 0.71).
        cull: leave out surfels whose normal points away from the camera; else their normals are turned round.
        near: surfels whose centre is nearer (unit frame) are left out.
        cutoff: alpha below which a surfel does not count in a pixel.
        transmittance: a pixel takes no more surfels below it.
        alpha_max: upper limit of alpha.
        grazing: |cos| between ray and plane below which a surfel is left out.
        threads: CPU threads; the result does not depend on it.
    """

    low_pass_px: float = 0.0
    cull: bool = True
    near: float = NEAR
    cutoff: float = CUTOFF
    transmittance: float = TRANSMITTANCE
    alpha_max: float = ALPHA_MAX
    grazing: float = GRAZING
    threads: int = 1


@dataclass(frozen=True)
class Camera:
    """A pinhole camera and its image window.

    Attributes:
        cam_from_unit: (4, 4) float64 rigid pose, OpenCV axes.
        fx, fy, cx, cy: intrinsics in px of this window; pixel centres at integer + 0.5.
        width, height: size of the window in px.
    """

    cam_from_unit: NDArray[np.float64]
    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int

    @property
    def z_reference(self) -> float:
        """Depth of the object's centre, from which depths are counted to keep their squares small."""
        return float(self.cam_from_unit[2, :3] @ np.full(3, 0.5) + self.cam_from_unit[2, 3])

    def crop(self, x: int, y: int, width: int, height: int) -> "Camera":
        """The same camera seen through a smaller (or shifted) window."""
        return replace(self, cx=self.cx - x, cy=self.cy - y, width=width, height=height)

    def scaled(self, factor: float) -> "Camera":
        """The same camera at another resolution (sizes rounded up)."""
        return replace(
            self,
            fx=self.fx * factor,
            fy=self.fy * factor,
            cx=self.cx * factor,
            cy=self.cy * factor,
            width=int(np.ceil(self.width * factor)),
            height=int(np.ceil(self.height * factor)),
        )


def camera_of(cameras: Cameras, view: int) -> Camera:
    """One view of a batch, uncropped."""
    fx, fy, cx, cy = (float(v) for v in cameras.intrinsics[view])
    return Camera(cameras.cam_from_unit[view], fx, fy, cx, cy, cameras.width, cameras.height)
