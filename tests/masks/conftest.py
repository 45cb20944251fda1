"""A box in three views, drawn by hand: silhouettes, grey faces, face ids and samples that are known exactly."""

import cv2
import numpy as np
import pytest
from brepgaussian.artifacts.truth import Truth
from brepgaussian.artifacts.views import Views
from brepgaussian.geometry.cameras import Cameras
from poses import look_at

SIZE = 160
EYES = np.array([[2.2, 1.6, 1.9], [-1.3, 1.8, 1.7], [1.9, -1.2, -0.8]])
GREYS = np.array([90.0, 118.0, 150.0, 176.0, 205.0, 232.0])
EXTENT = np.array([1.0, 0.7, 0.5])


def box_faces() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners (6, 4, 3), centres (6, 3) and normals (6, 3) of the box's faces."""
    corners, centres, normals = [], [], []
    for axis in range(3):
        for sign in (-1, 1):
            a, b = (i for i in range(3) if i != axis)
            normal = np.zeros(3)
            normal[axis] = sign
            quad = []
            for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                corner = normal.copy()
                corner[a], corner[b] = s, t
                quad.append(0.5 + corner * EXTENT / 2)
            corners.append(quad)
            centres.append(0.5 + normal * EXTENT / 2)
            normals.append(normal)
    return np.array(corners), np.array(centres), np.array(normals)


@pytest.fixture(scope="session")
def box() -> tuple[Views, np.ndarray]:
    """Views of the box and its (V, H, W) int16 face ids."""
    corners, centres, normals = box_faces()
    count = len(EYES)
    cameras = Cameras(
        np.tile([SIZE * 1.3, SIZE * 1.3, SIZE / 2, SIZE / 2], (count, 1)),
        np.stack([look_at(e) for e in EYES]),
        SIZE,
        SIZE,
    )
    ids = np.full((count, SIZE, SIZE), -1, np.int16)
    for view, eye in enumerate(EYES):
        for face in range(6):
            if normals[face] @ (eye - centres[face]) > 0:
                pixel, _ = cameras.project(view, corners[face])
                shape = np.rint((pixel - 0.5) * 16).astype(np.int32)
                cv2.fillConvexPoly(ids[view], shape, face, shift=4)
    grey = np.where(ids >= 0, GREYS[ids], 0)
    rgb = np.repeat(np.rint(grey).astype(np.uint8)[..., None], 3, 3)
    alpha = np.where(ids >= 0, 255, 0).astype(np.uint8)
    names = tuple(f"{i}.png" for i in range(count))
    return Views("box", names, rgb, alpha, cameras, np.eye(4)), ids


@pytest.fixture(scope="session")
def box_samples() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """6000 noisy samples of the box: xyz, normals, face of each, 2 % of the labels wrong."""
    rng = np.random.default_rng(11)
    corners, _, normals = box_faces()
    face = rng.integers(0, 6, 6000)
    s, t = rng.random((2, 6000, 1))
    quad = corners[face]
    xyz = quad[:, 0] + s * (quad[:, 1] - quad[:, 0]) + t * (quad[:, 3] - quad[:, 0])
    xyz += rng.normal(0, 0.003, xyz.shape)
    normal = normals[face] + rng.normal(0, 0.08, xyz.shape)
    label = np.where(rng.random(6000) < 0.02, rng.integers(0, 6, 6000), face)
    return xyz, normal / np.linalg.norm(normal, axis=1, keepdims=True), label


@pytest.fixture(scope="session")
def box_truth(box: tuple[Views, np.ndarray]) -> Truth:
    empty = np.zeros((0, 3))
    none = np.zeros(0, np.int32)
    return Truth(
        empty, empty, none, ("plane",) * 6, np.zeros((0, 2), np.int32), empty, none, (), empty,
        np.zeros((0, 3), np.int32), none, 12, 8, 0.35, box[1],
    )  # fmt: skip
