"""Small objects without a CAD kernel: boxes and cylinders sampled by formula."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from brepgaussian.artifacts.base import Provenance
from brepgaussian.artifacts.masks import Masks
from brepgaussian.artifacts.stage1 import Evidence, Surfels
from brepgaussian.artifacts.stage2 import Stage2
from brepgaussian.artifacts.views import Views
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.points import simulate


@pytest.fixture(scope="session")
def look_at():
    return _look_at


@pytest.fixture(scope="session")
def box_hit():
    return _box_hit


def _look_at(count: int, size: int) -> Cameras:
    """Cameras spread over a sphere of radius 3.6 around the object."""
    i = np.arange(count) + 0.5
    z, phi = 1 - 2 * i / count, i * np.pi * (3 - np.sqrt(5))
    directions = np.column_stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z])
    poses = []
    for d in directions:
        helper = np.array([0.0, 0, 1]) if abs(d[2]) < 0.95 else np.array([0.0, 1, 0])
        x = np.cross(-d, helper)
        x /= np.linalg.norm(x)
        rotation = np.array([x, np.cross(-d, x), -d])
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, -rotation @ (0.5 + 3.6 * d)
        poses.append(pose)
    focal = 1111.1 * size / 800
    return Cameras(np.tile([focal, focal, size / 2, size / 2], (count, 1)), np.array(poses), size, size)


def _box_hit(cameras: Cameras, view: int, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(H, W) face 0..5 (-x +x -y +y -z +z) of a box seen by each pixel, -1 = none: slabs, exact."""
    y, x = np.mgrid[: cameras.height, : cameras.width] + 0.5
    origin, rays = cameras.rays(view, np.column_stack([x.ravel(), y.ravel()]))
    with np.errstate(divide="ignore"):
        one, other = (low - origin) / rays, (high - origin) / rays
    enter, leave = np.minimum(one, other), np.maximum(one, other)
    axis = enter.argmax(1)
    hit = enter.max(1) <= leave.min(1)
    side = (rays[np.arange(len(rays)), axis] < 0).astype(int)
    return np.where(hit, 2 * axis + side, -1).reshape(cameras.height, cameras.width)


@pytest.fixture
def write_case(tmp_path: Path) -> Callable[..., dict]:
    """Write the stage's inputs; returns the keyword arguments of `make_points` without settings."""

    def write(surfels: Surfels, patches: np.ndarray, grey: np.ndarray, cameras: Cameras, features=None) -> dict:
        names = tuple(str(i) for i in range(len(cameras)))
        rgb = np.repeat(grey[..., None], 3, axis=-1).astype(np.uint8)
        alpha = np.where(patches > 0, 255, 0).astype(np.uint8)
        provenance = Provenance("case")
        Views("case", names, rgb, alpha, cameras, np.eye(4)).write(tmp_path / "views.h5", provenance)
        noise = np.zeros(len(patches), np.float32)
        Masks(simulate.edges(patches), patches.astype(np.int16), noise).write(tmp_path / "masks.h5", provenance)
        surfels.write(tmp_path / "stage1.ply")
        Evidence().write(tmp_path / "stage1.h5", provenance)
        if features is None:
            features = np.ones((len(surfels.centers), 4), np.float32)
        Stage2(features, patches.astype(np.int16)).write(tmp_path / "stage2.h5", provenance)
        files = {"views_path": "views.h5", "masks_path": "masks.h5", "stage1_ply": "stage1.ply"}
        files |= {"stage1_h5": "stage1.h5", "stage2_path": "stage2.h5", "out_path": "points.ply"}
        return {key: tmp_path / name for key, name in files.items()}

    return write
