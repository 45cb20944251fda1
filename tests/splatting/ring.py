"""Cameras all around a part."""

import numpy as np
from brepgaussian.geometry.cameras import Cameras
from poses import look_at

SIZE, FOCAL = 400, 520.0


def ring_of_cameras(count=12):
    poses = []
    for k in range(count):
        angle, height = 2 * np.pi * k / count, 0.9 + 0.5 * (k % 3)
        center = np.array([0.5 + 1.3 * np.cos(angle), 0.5 + 1.3 * np.sin(angle), 0.5 + height])
        poses.append(look_at(center))
    return Cameras(np.tile([FOCAL, FOCAL, SIZE / 2, SIZE / 2], (count, 1)), np.array(poses), SIZE, SIZE)
