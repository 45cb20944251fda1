"""Pinhole cameras of one object: OpenCV axes (x right, y down, z forward), pixel centres at integer + 0.5."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Cameras:
    """A batch of V calibrated views with a common image size.

    Attributes:
        intrinsics: (V, 4) float64 fx, fy, cx, cy in pixels; pixel (row 0, column 0) has its centre at (0.5, 0.5).
        cam_from_unit: (V, 4, 4) float64 rigid poses (rotation of determinant 1), lengths in the unit frame.
        width, height: image size in pixels.
    """

    intrinsics: NDArray[np.float64]
    cam_from_unit: NDArray[np.float64]
    width: int
    height: int

    def __len__(self) -> int:
        return len(self.intrinsics)

    @property
    def centers(self) -> NDArray[np.float64]:
        """(V, 3) camera centres in the unit frame."""
        rotation, translation = self.cam_from_unit[:, :3, :3], self.cam_from_unit[:, :3, 3]
        return -np.einsum("vji,vj->vi", rotation, translation)

    def matrices(self) -> NDArray[np.float64]:
        """(V, 3, 3) calibration matrices."""
        k = np.zeros((len(self), 3, 3))
        k[:, 0, 0], k[:, 1, 1] = self.intrinsics[:, 0], self.intrinsics[:, 1]
        k[:, 0, 2], k[:, 1, 2], k[:, 2, 2] = self.intrinsics[:, 2], self.intrinsics[:, 3], 1
        return k

    def project(self, view: int, points: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Project (N, 3) points into one view: (N, 2) pixel positions (x, y) and (N,) depths z."""
        pose = self.cam_from_unit[view]
        camera = points @ pose[:3, :3].T + pose[:3, 3]  # (N, 3)
        fx, fy, cx, cy = self.intrinsics[view]
        z = camera[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels = np.column_stack([fx * camera[:, 0] / z + cx, fy * camera[:, 1] / z + cy])
        return pixels, z

    def rays(self, view: int, pixels: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Rays through (N, 2) pixel positions: the camera centre (3,) and (N, 3) unit directions."""
        fx, fy, cx, cy = self.intrinsics[view]
        directions = np.column_stack([(pixels[:, 0] - cx) / fx, (pixels[:, 1] - cy) / fy, np.ones(len(pixels))])
        directions = directions @ self.cam_from_unit[view, :3, :3]  # rotate by the inverse
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return self.centers[view], directions

    def footprint(self) -> float:
        """Size of one pixel at the object's centre, unit frame (median over views)."""
        depth = np.linalg.norm(self.centers - 0.5, axis=1)
        return float(np.median(depth / self.intrinsics[:, :2].mean(axis=1)))
