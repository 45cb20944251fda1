"""Labelled points of bundled parts with known noise; `sampled_surfaces` of the geometry tests."""

import functools
import sys
from pathlib import Path

import numpy as np
import pytest
from brepgaussian.artifacts.points import Points
from brepgaussian.artifacts.truth import Truth

sys.path.insert(0, str(Path(__file__).parents[1] / "geometry"))


@functools.cache
def truth_of(name: str, seed: int = 0) -> Truth:
    from brepgaussian.settings.views import ViewsSettings
    from brepgaussian.views.parts import build_part
    from brepgaussian.views.truth import transformed, truth_of_solid, unit_from_world

    solid = build_part(name, seed).wrapped
    return truth_of_solid(transformed(solid, unit_from_world(solid)), ViewsSettings())[0]


def labelled(truth: Truth, sigma: float, wrong: float, rng: np.random.Generator, count: int = 5000) -> Points:
    """Noisy points of a truth, labelled by its faces, a share of the labels wrong."""
    chosen = np.sort(rng.choice(len(truth.points), min(count, len(truth.points)), replace=False))
    xyz = truth.points[chosen] + sigma * rng.normal(size=(len(chosen), 3))
    normals = truth.normals[chosen] + min(sigma * 10, 0.05) * rng.normal(size=(len(chosen), 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    label = truth.point_face[chosen].copy()
    bad = rng.random(len(label)) < wrong
    label[bad] = rng.integers(0, len(truth.face_types), bad.sum())
    none = np.zeros(len(label), np.float32)
    return Points(
        xyz.astype(np.float32),
        normals.astype(np.float32),
        none,
        label.astype(np.int32),
        np.full(len(label), -1, np.int32),
    )


@pytest.fixture
def truth_maker():
    return truth_of


@pytest.fixture
def point_maker():
    return labelled
