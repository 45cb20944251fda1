"""Samples of flat surfels on curved surfaces."""

import numpy as np
import pytest
from brepgaussian.geometry.surfaces import cylinder, plane, sphere
from brepgaussian.points.bend import bent
from brepgaussian.points.densify import Samples


def disks(surface, radius: float, count: int = 200, seed: int = 5) -> Samples:
    """Four samples around each centre on a surface, in its tangent plane, with the centre's normal."""
    rng = np.random.default_rng(seed)
    centers = surface.project(rng.uniform(-0.08, 0.08, (count, 3)))
    normals = surface.normals(centers)
    first = np.cross(normals, [0.3, 0.5, 0.8])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    rings = [centers, *(centers + sign * radius * way for way in (first, second) for sign in (1, -1))]
    surfel = np.tile(np.arange(count), 5)
    return Samples(np.concatenate(rings), normals[surfel], np.zeros(5 * count), surfel)


@pytest.mark.parametrize("surface", [cylinder([0, 0, 0], [0, 0, 1], 0.05, flipped=True), sphere([0, 0, 0], 0.07)])
def test_samples_of_tangent_disks_lie_on_the_surface(surface):
    samples = disks(surface, 0.009)
    assert np.abs(surface.signed_distance(samples.xyz)).max() > 0.0005
    found = bent(samples, np.zeros(len(samples), int), [surface])
    assert np.abs(surface.signed_distance(found.xyz)).max() < 1e-9
    assert np.einsum("nc,nc->n", found.normals, surface.normals(found.xyz)).min() > 1 - 1e-9


def test_errors_of_the_surfels_stay():
    surface = cylinder([0, 0, 0], [0, 0, 1], 0.05)
    samples = disks(surface, 0.009)
    rise = np.random.default_rng(1).normal(0, 0.002, 200)[samples.surfel]
    raised = Samples(samples.xyz + rise[:, None] * samples.normals, samples.normals, samples.edge, samples.surfel)
    found = bent(raised, np.zeros(len(samples), int), [surface])
    assert np.allclose(surface.signed_distance(found.xyz), rise, atol=1e-9)


def test_planes_and_samples_of_other_labels_stay():
    surface = cylinder([0, 0, 0], [0, 0, 1], 0.05)
    samples = disks(surface, 0.009)
    labels = np.zeros(len(samples), int)
    assert np.array_equal(bent(samples, labels, [plane([0, 0, 0], [0, 0, 1])]).xyz, samples.xyz)
    labels[200:] = 1  # the centres belong to another patch
    found = bent(samples, labels, [surface, surface])
    assert np.array_equal(found.xyz, samples.xyz)
    assert np.array_equal(bent(samples, np.full(len(samples), -1), [surface]).xyz, samples.xyz)
