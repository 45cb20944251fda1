"""A sphere of diameter 1 in the unit frame, rendered analytically: two grey halves, seen from all sides."""

import numpy as np
from brepgaussian.artifacts.masks import Masks
from brepgaussian.artifacts.views import Views
from brepgaussian.geometry.cameras import Cameras
from poses import look_at

_SUB = 4  # rays per pixel and axis


def sphere_views(count: int, size: int) -> Views:
    """Views with antialiased borders; light above z = .5 is brighter."""
    i = np.arange(count) + 0.5
    z, angle = 1 - 2 * i / count, i * np.pi * (1 + 5**0.5)
    directions = np.column_stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z])
    poses = np.stack([look_at(0.5 + 3.5 * d) for d in directions])
    intrinsics = np.tile([3.0 * size, 3.0 * size, 0.5 * size + 1.3, 0.5 * size - 0.7], (count, 1))
    cameras = Cameras(intrinsics, poses, size, size)
    grid = (np.arange(size * _SUB) + 0.5) / _SUB
    pixels = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    rgb, alpha = np.zeros((count, size, size, 3), np.uint8), np.zeros((count, size, size), np.uint8)
    for view in range(count):
        origin, rays = cameras.rays(view, pixels)
        middle = -(rays * (origin - 0.5)).sum(axis=1)
        gap = ((origin - 0.5) ** 2).sum() - middle**2
        hit = gap < 0.25
        depth = middle - np.sqrt(np.maximum(0.25 - gap, 0))
        top = (origin + depth[:, None] * rays)[:, 2] > 0.5
        shape = (size, _SUB, size, _SUB)
        coverage = hit.reshape(shape).mean(axis=(1, 3))
        grey = (hit * np.where(top, 200.0, 120.0)).reshape(shape).mean(axis=(1, 3)) / np.maximum(coverage, 1e-9)
        alpha[view], rgb[view] = np.round(255 * coverage), np.round(grey)[..., None]
        rgb[view][alpha[view] == 0] = 0
    names = tuple(f"{view}.png" for view in range(count))
    return Views("sphere", names, rgb, alpha, cameras, np.eye(4))


def sphere_masks(views: Views) -> Masks:
    """Perfect masks: an edge along the step in grey and the outline, two patches."""
    grey, solid = views.rgb[..., 0], views.alpha > 127
    patches = (np.where(grey > 160, 1, 2) * solid).astype(np.int16)
    edges = np.zeros(grey.shape, bool)
    edges[:, 1:] |= patches[:, 1:] != patches[:, :-1]
    edges[:, :, 1:] |= patches[:, :, 1:] != patches[:, :, :-1]
    return Masks((255 * edges).astype(np.uint8), patches, np.zeros(len(grey), np.float32))
