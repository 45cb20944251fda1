"""Surfels and patch masks as the stages before would make them, from a known model: for benchmarks and tests."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from brepgaussian.artifacts.stage1 import Surfels
from brepgaussian.artifacts.truth import Truth

Array = NDArray[np.float64]
CORRELATION = 0.03  # unit frame; the errors of trained surfels are smooth over about this length
_WHITE_SHARE, _STRAY_SHARE, _STRAY = 0.2, 0.004, 0.03  # of the noise; of the surfels, and how far these are off
_BLUR = 0.009  # unit frame; normals of trained surfels are averages over this radius
_WAVES = 60
_SIZE = 0.5  # standard deviation of a surfel in spacings


def surfels(truth: Truth, count: int, sigma: float, angle: float, seed: int) -> Surfels:
    """Surfels on a model with smooth, correlated errors.

    Args:
        truth: the model.
        count: number of surfels.
        sigma: standard deviation of the positions along the normal, unit frame.
        angle: of the normals, radians.
        seed: of the errors.
    """
    rng = np.random.default_rng(seed)
    count = min(count, len(truth.points))
    pick = rng.choice(len(truth.points), count, replace=False)
    points = truth.points[pick]
    near = cKDTree(truth.points).query_ball_point(points, _BLUR)
    normals = _unit(np.array([truth.normals[i].mean(0) for i in near]))
    lift = sigma * (_smooth(points, rng, 1)[:, 0] + _WHITE_SHARE * rng.normal(size=count))
    turn = angle * (0.87 * _smooth(points, rng, 3) + 0.5 * rng.normal(size=(count, 3))) / np.sqrt(1.5)
    points = points + lift[:, None] * normals
    stray = rng.random(count) < _STRAY_SHARE
    points[stray] += rng.normal(size=(int(stray.sum()), 3)) * _STRAY
    normals = _unit(normals + turn)
    triangles = truth.mesh_vertices[truth.mesh_triangles]
    area = (
        np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1).sum() / 2
    )
    scales = np.exp(rng.normal(size=(count, 2)) * 0.4) * _SIZE * np.sqrt(area / count)
    edge = np.zeros(count)
    if len(truth.curve_points):
        edge = np.exp(-((cKDTree(truth.curve_points).query(points)[0] / _BLUR) ** 2))
    float32 = np.float32
    return Surfels(
        centers=points.astype(float32),
        rotations=_quaternions(normals).astype(float32),
        scales=scales.astype(float32),
        opacities=np.full(count, 0.95, float32),
        colors=np.full((count, 3), 0.5, float32),
        edges=edge.astype(float32),
    )


def masks(
    face_ids: NDArray[np.int16], grey: NDArray[np.floating], step: float, split: float, seed: int
) -> NDArray[np.int16]:
    """True regions, corrupted: neighbours of similar grey are merged, some regions are cut in two.

    Args:
        face_ids: (V, H, W) visible face, -1 = none; grey: (V, H, W) grey levels.
        step: grey levels; borders with a smaller median step are missed.
        split: share of the regions that are cut.
        seed: of the cuts.
    """
    rng = np.random.default_rng(seed)
    return np.stack([_corrupted(ids, levels, step, split, rng) for ids, levels in zip(face_ids, grey, strict=True)])


def edges(patches: NDArray[np.integer]) -> NDArray[np.uint8]:
    """(V, H, W) edge maps: the pixels on both sides of every border of regions, 255, so that they centre on it."""
    found = np.zeros(patches.shape, np.uint8)
    for axis in (1, 2):
        here = [slice(None)] * 3
        after = [slice(None)] * 3
        here[axis], after[axis] = slice(None, -1), slice(1, None)
        border = patches[tuple(here)] != patches[tuple(after)]
        found[tuple(here)][border] = 255
        found[tuple(after)][border] = 255
    return found


def _corrupted(
    ids: NDArray[np.int16], grey: NDArray[np.floating], step: float, split: float, rng: np.random.Generator
) -> NDArray[np.int16]:
    import cv2

    regions = np.zeros(ids.shape, np.int64)
    count = 1
    for face in np.unique(ids[ids >= 0]):
        found, parts = cv2.connectedComponents((ids == face).astype(np.uint8), connectivity=4)
        regions[parts > 0] = parts[parts > 0] + count - 1
        count += found - 1
    grey = grey.astype(np.float64)
    keys, steps = [], []
    for axis in (0, 1):
        after = np.roll(regions, -1, axis)
        border = (regions != after) & (regions > 0) & (after > 0)
        low, high = np.minimum(regions, after)[border], np.maximum(regions, after)[border]
        keys.append(low * count + high)
        steps.append(
            np.abs(np.roll(grey, 1, axis) - np.roll(grey, -2, axis))[border]
        )  # beside the border's mixed pixels
    key, rise = np.concatenate(keys), np.concatenate(steps)
    values, inverse = np.unique(key, return_inverse=True)
    medians = np.array([np.median(rise[inverse == k]) for k in range(len(values))])
    weak = values[medians < step] if len(values) else values
    links = coo_matrix((np.ones(len(weak)), (weak // count, weak % count)), shape=(count, count))
    merged = connected_components(links, directed=False)[1] + 1
    regions = np.where(regions > 0, merged[regions], 0)
    top = int(regions.max())
    for region in np.unique(regions[regions > 0]):
        if rng.random() < split:
            row, column = np.nonzero(regions == region)
            direction = rng.normal(size=2)
            along = row * direction[0] + column * direction[1]
            far = along > np.quantile(along, rng.uniform(0.2, 0.8))
            top += 1
            regions[row[far], column[far]] = top
    return regions.astype(np.int16)


def _smooth(points: Array, rng: np.random.Generator, dimensions: int) -> Array:
    """(N, dimensions) random field of unit variance, correlated over `CORRELATION`."""
    wave = rng.normal(size=(_WAVES, 3)) / CORRELATION
    phase = rng.uniform(0, 2 * np.pi, _WAVES)
    return np.cos(points @ wave.T + phase) @ rng.normal(size=(_WAVES, dimensions)) * np.sqrt(2 / _WAVES)


def _unit(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)


def _quaternions(normals: Array) -> Array:
    """(N, 4) wxyz of the shortest turn from z to each normal."""
    w = 1 + normals[:, 2]
    down = w < 1e-6
    q = np.column_stack([w, -normals[:, 1], normals[:, 0], np.zeros(len(normals))])
    q[down] = (0, 1, 0, 0)
    return q / np.linalg.norm(q, axis=1, keepdims=True)
