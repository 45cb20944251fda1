"""Small solids with a known answer, made without the bundled parts; makes `brep_support` importable."""

import sys
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.artifacts.base import Provenance
from brepgaussian.artifacts.points import Points
from brepgaussian.artifacts.primitives import Primitive, Primitives
from brepgaussian.artifacts.views import Views
from brepgaussian.brep.silhouettes import Silhouettes
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.geometry.surfaces import Surface, cylinder, plane

sys.path.insert(0, str(Path(__file__).parent))

SIDE = 200


@dataclass(frozen=True)
class Known:
    """A solid as labelled points with exact surfaces."""

    points: Points
    primitives: Primitives
    volume: float
    faces: int


def box_planes(size: np.ndarray) -> list[Surface]:
    """The six planes of a box centred at (.5, .5, .5)."""
    result = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = sign
            result.append(plane(0.5 + 0.5 * sign * size * np.eye(3)[axis], normal))
    return result


def block_with_hole(sigma: float = 0.0, radius: float = 0.2, count: int = 6000, seed: int = 0) -> Known:
    """A block 1 x .8 x .5 with a through hole along z (radius 0: none)."""
    rng = np.random.default_rng(seed)
    size = np.array([1.0, 0.8, 0.5])
    surfaces = box_planes(size)
    areas = np.repeat([size[1] * size[2], size[0] * size[2], size[0] * size[1]], 2)
    xyz, label = [], []
    for index, area in enumerate(areas):
        n = int(count * area / areas.sum())
        u = 0.5 + (rng.random((n, 3)) - 0.5) * size
        axis, sign = index // 2, -1.0 if index % 2 == 0 else 1.0
        u[:, axis] = 0.5 + 0.5 * sign * size[axis]
        if axis == 2:
            u = u[np.hypot(*(u[:, :2] - 0.5).T) > radius]
        xyz.append(u)
        label.append(np.full(len(u), index))
    if radius:
        surfaces.append(cylinder(np.full(3, 0.5), np.array([0, 0, 1.0]), radius, flipped=True))
        n = int(count * 2 * np.pi * radius * size[2] / areas.sum())
        angle = rng.random(n) * 2 * np.pi
        wall = np.column_stack([np.cos(angle) * radius, np.sin(angle) * radius, (rng.random(n) - 0.5) * size[2]])
        xyz.append(wall + 0.5)
        label.append(np.full(n, 6))
    positions, labels = np.concatenate(xyz), np.concatenate(label)
    normals = np.zeros_like(positions)
    for index, surface in enumerate(surfaces):
        normals[labels == index] = surface.normals(positions[labels == index])
    positions = positions + sigma * rng.normal(size=positions.shape)
    points = make_points(positions, normals, labels)
    items = tuple(Primitive(s, i, np.flatnonzero(labels == i), sigma) for i, s in enumerate(surfaces))
    volume = float(np.prod(size) - np.pi * radius**2 * size[2])
    return Known(points, Primitives(items, sigma=sigma), volume, len(surfaces))


def make_points(xyz: np.ndarray, normals: np.ndarray, label: np.ndarray) -> Points:
    """Labelled points without edges."""
    n = len(xyz)
    return Points(
        xyz.astype(np.float32), normals.astype(np.float32), np.zeros(n, np.float32), label.astype(np.int32),
        np.full(n, -1, np.int32),
    )  # fmt: skip


def make_cameras(count: int = 10, side: int = SIDE) -> Cameras:
    """Cameras on a sphere of radius 4 that look at the middle."""
    k = np.arange(count) + 0.5
    polar, turn = np.arccos(1 - 2 * k / count), np.pi * (1 + 5**0.5) * k
    poses = []
    for d in np.column_stack([np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)]):
        x = np.cross(-d, [0, 0, 1.0])
        x /= np.linalg.norm(x)
        pose = np.eye(4)
        pose[:3, :3] = [x, np.cross(-d, x), -d]
        pose[:3, 3] = -pose[:3, :3] @ (0.5 + 4 * d)
        poses.append(pose)
    focal = 1111.11 * side / 800
    return Cameras(np.tile([focal, focal, side / 2, side / 2], (count, 1)), np.array(poses), side, side)


def make_views(corners: np.ndarray, world_from_unit: np.ndarray | None = None, unit: str = "mm") -> Views:
    """Views whose silhouettes are those of (T, 3, 3) triangles."""
    cameras = make_cameras()
    blank = np.zeros((len(cameras), SIDE, SIDE), np.uint8)
    canvas = Silhouettes(blank, blank.astype(np.float32), cameras)
    alpha = np.stack([canvas.draw(v, corners) for v in range(len(cameras))]).astype(np.uint8) * 255
    world = np.eye(4) if world_from_unit is None else world_from_unit
    names = tuple(str(v) for v in range(len(cameras)))
    return Views("test_part", names, np.repeat(alpha[..., None], 3, -1), alpha, cameras, world, unit)


def box_corners(size: np.ndarray) -> np.ndarray:
    """(12, 3, 3) triangles of a box centred at (.5, .5, .5)."""
    from scipy.spatial import ConvexHull

    vertices = 0.5 + (np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T - 0.5) * size
    return vertices[ConvexHull(vertices).simplices]


@pytest.fixture
def kit():
    """The makers above (tests cannot import their conftest)."""
    return SimpleNamespace(
        block_with_hole=block_with_hole, box_corners=box_corners, make_points=make_points, make_views=make_views,
        make_cameras=make_cameras, box_planes=box_planes, Known=Known,
    )  # fmt: skip


@pytest.fixture
def paths(tmp_path):
    """Write the three inputs of the stage and give its keyword arguments."""

    def write(known: Known, views: Views | None = None) -> dict:
        views = views or make_views(box_corners(np.array([1.0, 0.8, 0.5])))
        views.write(tmp_path / "views.h5", Provenance())
        known.points.write(tmp_path / "points.ply")
        known.primitives.write(tmp_path / "primitives.h5", Provenance())
        return {
            "views_path": tmp_path / "views.h5",
            "points_path": tmp_path / "points.ply",
            "primitives_path": tmp_path / "primitives.h5",
            "out_step": tmp_path / "brep.step",
            "out_glb": tmp_path / "brep.glb",
            "out_h5": tmp_path / "brep.h5",
        }

    return write
