"""The hull against a sphere seen from all sides; spreading; the prior."""

import numpy as np
import pytest
from brepgaussian.artifacts.views import Views
from brepgaussian.errors import StageError
from brepgaussian.splatting.hull import Hull, carve, silhouette_distance
from brepgaussian.splatting.settle import settle
from brepgaussian.splatting.spreading import spread
from synthetic import sphere_masks, sphere_views


@pytest.fixture(scope="module")
def views() -> Views:
    return sphere_views(count=24, size=120)


@pytest.fixture(scope="module")
def hull(views: Views) -> Hull:
    return carve(views, 64)[0]


def test_hull_of_a_sphere_has_no_voxel_bias(hull: Hull) -> None:
    radius = np.linalg.norm(hull.vertices - 0.5, axis=1)
    assert np.quantile(radius, 0.02) > 0.5 - 0.25 * hull.spacing  # never inside by more than a quarter voxel
    assert abs(np.quantile(radius, 0.1) - 0.5) < 0.2 * hull.spacing  # tangent places lie on the sphere
    outward = ((hull.vertices - 0.5) * hull.normals).sum(axis=1)
    assert (outward > 0).mean() > 0.999


def test_silhouette_distance_is_sub_pixel() -> None:
    """A half-plane whose border crosses pixels at a fraction."""
    border = 20.3
    x = np.arange(40)
    coverage = np.clip(border - x, 0, 1)
    alpha = np.round(np.tile(coverage, (16, 1)) * 255).astype(np.uint8)
    distance = silhouette_distance(alpha)
    np.testing.assert_allclose(distance[8, 4:36], border - (x[4:36] + 0.5), atol=0.02)


def test_spread_is_even_and_close_to_the_wanted_number(hull: Hull) -> None:
    from scipy.spatial import cKDTree

    points, normals, spacing = spread(hull, 800, seed=3)
    assert 650 < len(points) < 950
    nearest = cKDTree(points).query(points, 2)[0][:, 1]
    assert nearest.min() > spacing - 1e-12
    assert np.quantile(nearest, 0.99) < 2 * spacing
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)


def test_no_common_inside_is_a_clear_error(views: Views) -> None:
    empty = Views(**{**vars(views), "alpha": np.zeros_like(views.alpha)})
    with pytest.raises(StageError, match="no common inside"):
        carve(empty, 32)


def test_the_prior_keeps_spheres_and_flattens_noise() -> None:
    rng = np.random.default_rng(0)
    i = np.arange(3000) + 0.5
    z, angle = 1 - 2 * i / 3000, i * np.pi * (1 + 5**0.5)
    normals = np.column_stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z])
    noisy = normals * (0.5 + 0.003 * rng.standard_normal((3000, 1)))
    tilted = normals + 0.1 * rng.standard_normal((3000, 3))
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    options = {"sweeps": 3, "below": 0.5, "color_scale": 0.01, "angle_scale_deg": 25.0}
    centers, turned = settle(noisy, tilted, np.full((3000, 1), 0.5), **options)
    radius = np.linalg.norm(centers, axis=1)
    assert abs(radius.mean() - 0.5) < 0.001  # no shrinking
    assert radius.std() < 0.0015  # less than half the noise
    error = np.degrees(np.arccos(np.clip((turned * normals).sum(axis=1), -1, 1)))
    assert np.median(error) < 2.0  # from 7 degrees


def test_the_prior_stops_at_a_colour_step() -> None:
    """Two planes that meet at 10 degrees, in two greys, stay two planes; of one grey they are rounded."""
    rng = np.random.default_rng(1)
    xy = rng.uniform(-1, 1, (4000, 2))
    slope = np.tan(np.radians(10))
    right = xy[:, 0] > 0
    points = np.column_stack([xy, np.where(right, -slope * xy[:, 0], 0)])
    normals = np.where(right[:, None], [np.sin(np.radians(10)), 0, np.cos(np.radians(10))], [0.0, 0.0, 1.0])
    grey = np.where(right, 0.4, 0.6)[:, None]
    options = {"sweeps": 3, "below": 0.5, "color_scale": 0.01, "angle_scale_deg": 15.0}
    near = np.abs(xy[:, 0]) < 0.1
    errors = []
    for colors in (grey, np.full_like(grey, 0.5)):
        _, turned = settle(points, normals, colors, **options)
        errors.append(np.degrees(np.arccos(np.clip((turned * normals).sum(axis=1), -1, 1)))[near].mean())
    assert errors[0] < 0.1
    assert errors[1] > 10 * errors[0]


def test_masks_of_the_synthetic_sphere_fit(views: Views) -> None:
    assert sphere_masks(views).edges.shape == views.alpha.shape
