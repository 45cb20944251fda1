"""Camera conventions: OpenGL and OpenCV axes, camera-to-world to camera-from-unit."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def opencv_from_opengl(camera_to_world: Array) -> Array:
    """(4, 4) camera-to-world with OpenGL axes (y up, z backward) to OpenCV axes (y down, z forward)."""
    pose = np.eye(4)
    pose[:3] = np.asarray(camera_to_world, float)[:3]
    pose[:3, 1:3] *= -1
    return pose


def cam_from_world(camera_to_world: Array) -> Array:
    """(4, 4) rigid inverse of a camera-to-world pose; its rotation is made exactly orthonormal."""
    u, _, vt = np.linalg.svd(camera_to_world[:3, :3])
    rotation = (u @ vt).T
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = -rotation @ camera_to_world[:3, 3]
    return pose


def cam_from_unit(from_world: Array, world_from_unit: Array) -> Array:
    """(4, 4) rigid pose in the unit frame: the similarity's scale is divided out of the camera's lengths."""
    scale = float(np.cbrt(np.linalg.det(world_from_unit[:3, :3])))
    pose = from_world @ world_from_unit
    pose[:3] /= scale
    return pose
