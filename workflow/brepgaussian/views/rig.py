"""Cameras around a rendered object, laid out as in ABC-NEF: on a sphere about the world's origin."""

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.cameras import Cameras
from brepgaussian.settings.views import ViewsSettings

CENTER = np.full(3, 0.5)  # of the object in the unit frame; the cameras look at it
REFERENCE_SIZE = 800  # px; the focal length in the settings belongs to this image size
_GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


def rig(settings: ViewsSettings) -> Cameras:
    """Cameras spread evenly over the whole sphere, below the object too (Fibonacci lattice), z up."""
    count, size = settings.rendered_views, settings.image_size
    index = np.arange(count) + 0.5
    z = 1 - 2 * index / count
    around = _GOLDEN_ANGLE * index
    ring = np.sqrt(1 - z**2)
    centers = settings.camera_distance * np.column_stack([ring * np.cos(around), ring * np.sin(around), z])
    focal = settings.focal * size / REFERENCE_SIZE
    return Cameras(
        intrinsics=np.tile([focal, focal, size / 2, size / 2], (count, 1)),
        cam_from_unit=np.stack([look_at(center, CENTER) for center in centers]),
        width=size,
        height=size,
    )


def look_at(center: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """(4, 4) OpenCV pose of a camera at `center` that looks at `target`, the world's z axis up in the image."""
    forward = (target - center) / np.linalg.norm(target - center)
    up = np.array([0.0, 0.0, 1.0]) if abs(forward[2]) < 1 - 1e-9 else np.array([0.0, 1.0, 0.0])
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    pose[:3, 3] = -pose[:3, :3] @ center
    return pose
