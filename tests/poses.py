"""Camera poses that tests share."""

import numpy as np


def look_at(eye: np.ndarray, target: np.ndarray | float = 0.5) -> np.ndarray:
    """(4, 4) pose of a camera at `eye` that looks at a target, (.5, .5, .5) unless told."""
    forward = target - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, -rotation @ eye
    return pose
