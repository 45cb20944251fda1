"""Controlled damage to truth-labelled points, for the benchmark of assembly."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.artifacts.points import Points
from brepgaussian.artifacts.truth import Truth
from brepgaussian.errors import SettingsError

DAMAGES = ("none", "half_patch", "whole_patch", "merged", "split")
_NEIGHBOURS = 12  # a wrong label is one that occurs among this many nearest points of other faces
_NORMAL_NOISE = 2.0  # radians of normal noise per unit of position noise, over the spacing of 20,000 points


def damaged(truth: Truth, sigma: float, wrong_labels: float, damage: str, seed: int) -> Points:
    """Points of a truth with noise and one kind of damage.

    Args:
        truth: the known model.
        sigma: standard deviation of the positions, unit frame; normals tilt by as much over the spacing.
        wrong_labels: share of points that carry the label of a neighbouring face.
        damage: one of `DAMAGES`, done to one face (or pair) drawn by the seed.
        seed: of all random choices.

    Raises:
        SettingsError: an unknown kind of damage.
    """
    if damage not in DAMAGES:
        raise SettingsError(f"there is no damage {damage!r}", fix=f"use one of: {', '.join(DAMAGES)}")
    rng = np.random.default_rng(seed)
    label = truth.point_face.astype(np.int64).copy()
    label = _mislabel(truth, label, wrong_labels, rng)
    keep = np.ones(len(label), bool)
    target = int(rng.integers(len(truth.face_types)))
    on = np.flatnonzero(label == target)
    direction = rng.normal(size=3)
    if damage in ("half_patch", "split") and len(on):
        direction -= (direction @ truth.normals[on[0]]) * truth.normals[on[0]]
        along = truth.points[on] @ direction
        half = on[along > np.median(along)]
        if damage == "split":
            label[half] = label.max() + 1
        else:
            keep[half] = False
    elif damage == "whole_patch":
        keep[on] = False
    elif damage == "merged":
        around = truth.face_pairs[(truth.face_pairs == target).any(axis=1)]
        if len(around):
            pair = around[int(rng.integers(len(around)))]
            label[np.isin(label, pair)] = pair.min()
    spacing = 1 / np.sqrt(len(label))
    xyz = truth.points + sigma * rng.normal(size=truth.points.shape)
    normals = truth.normals + _NORMAL_NOISE * min(sigma / spacing, 0.3) / 4 * rng.normal(size=truth.normals.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    _, label = np.unique(label[keep], return_inverse=True)
    count = int(keep.sum())
    return Points(
        xyz[keep].astype(np.float32),
        normals[keep].astype(np.float32),
        np.zeros(count, np.float32),
        label.astype(np.int32),
        np.full(count, -1, np.int32),
    )


def _mislabel(truth: Truth, label: NDArray[np.int64], share: float, rng: np.random.Generator) -> NDArray[np.int64]:
    """Give a share of the points the label of another face nearby."""
    result = label.copy()
    chosen = rng.permutation(len(label))[: round(share * len(label))]
    for face in np.unique(label[chosen]):
        mine = chosen[label[chosen] == face]
        others = np.flatnonzero(label != face)
        if not len(others):
            continue
        count = min(_NEIGHBOURS, len(others))
        near = cKDTree(truth.points[others]).query(truth.points[mine], count)[1].reshape(len(mine), -1)
        result[mine] = label[others[near[np.arange(len(mine)), rng.integers(count, size=len(mine))]]]
    return result
