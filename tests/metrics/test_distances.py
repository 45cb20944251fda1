"""Distances, volumes and samples against hand-computed cases and independent libraries."""

import numpy as np
import pytest
from brepgaussian.metrics import distances, mesh, volume
from hypothesis import given, settings
from hypothesis import strategies as st

BOX = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])
BOX_TRIANGLES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]], np.int32,
)  # fmt: skip


def box(size=(1, 1, 1), origin=(0, 0, 0), count=20_000, seed=0) -> distances.SampledSurface:
    vertices = BOX * size + np.asarray(origin, float)
    points, index, _ = mesh.sample_triangles(vertices, BOX_TRIANGLES, count, seed)
    return distances.SampledSurface(vertices, BOX_TRIANGLES, points, mesh.normals(vertices, BOX_TRIANGLES)[index])


def test_clouds_by_hand():
    got = distances.cloud_distance(np.array([[0.0, 0, 0], [1, 0, 0]]), np.array([[0.0, 0, 0], [1, 2, 0], [9, 0, 0]]))
    assert got.cd_sum == pytest.approx(0.5 + (0 + 2 + 8) / 3)
    assert got.cd_avg == pytest.approx(got.cd_sum / 2)
    assert got.hd == 8
    assert np.isnan(distances.cloud_distance(np.zeros((0, 3)), np.zeros((3, 3))).hd)


def test_shifted_square_plates():
    """A unit box against one that is .1 taller: only the top and slivers of the sides differ."""
    low, high = box(count=200_000), box((1, 1, 1.1), count=200_000)
    got = distances.surface_distance(low, high)
    # low -> high: the top (1 of 6) is 0.1 off, the nearest wall being nearer within 0.1 of the rim
    grid = (np.arange(2000) + 0.5) / 2000
    rim = np.minimum(np.minimum(grid, 1 - grid)[:, None], np.minimum(grid, 1 - grid)[None])
    forward = np.minimum(rim, 0.1).mean() / 6
    # high -> low: the top is 0.1 off, of the walls a strip of height 0.1, 0.05 off on average
    backward = (0.1 * 1 + 4 * 0.1 * 0.05) / (2 + 4 * 1.1)
    assert got.cd_exact == pytest.approx((forward + backward) / 2, rel=5e-3)
    assert got.hd_exact == pytest.approx(0.1, abs=1e-6)


def test_same_surface_has_no_exact_distance_but_clouds_have_a_floor():
    first, second = box(seed=1), box(seed=2)
    exact, cloud = distances.surface_distance(first, second), distances.cloud_distance(first.points, second.points)
    assert exact.cd_exact < 1e-7
    assert exact.hd_exact < 1e-6
    assert exact.normal_consistency == pytest.approx(1)
    floor = np.sqrt(6 / 20_000) / 2  # Poisson: mean distance to the nearest of n points per area
    assert cloud.cd_sum == pytest.approx(2 * floor, rel=0.05)


@pytest.mark.parametrize("thin", [1e-1, 1e-3, 1e-5])
def test_slivers_do_not_spoil_exact_distances(thin):
    """Ray casters work in float32, which fails on triangles of high aspect."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, thin, 0], [0, thin, 0]], float)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    surface = distances.SampledSurface(vertices, triangles, vertices, np.tile([0.0, 0, 1], (4, 1)))
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.random(500), rng.random(500) * thin, rng.random(500) * 1e-3])
    np.testing.assert_allclose(surface.closest(points)[0], points[:, 2], atol=1e-5)


def test_hausdorff_agrees_with_pymeshlab():
    pymeshlab = pytest.importorskip("pymeshlab")
    first, second = box(), box((1.2, 0.9, 1), (0.05, 0, 0.1))
    meshes = pymeshlab.MeshSet()
    for item in (first, second):
        meshes.add_mesh(pymeshlab.Mesh(item.vertices, item.triangles))
    options = {"samplenum": 200_000, "maxdist": pymeshlab.PureValue(10), "sampleface": True}
    pairs = [{"sampledmesh": a, "targetmesh": b, **options} for a, b in ((0, 1), (1, 0))]
    largest = max(meshes.get_hausdorff_distance(samplevert=True, **pair)["max"] for pair in pairs)
    mean = np.mean([meshes.get_hausdorff_distance(samplevert=False, **pair)["mean"] for pair in pairs])
    got = distances.surface_distance(first, second)
    assert got.hd_exact == pytest.approx(largest, rel=1e-4)
    assert got.cd_exact == pytest.approx(mean, rel=1e-2)


def test_distance_to_triangles_agrees_with_trimesh():
    trimesh = pytest.importorskip("trimesh")
    rng = np.random.default_rng(3)
    points, corners = rng.normal(size=(500, 3)), rng.normal(size=(500, 3, 3))
    closest = trimesh.triangles.closest_point(corners, points)
    np.testing.assert_allclose(mesh.distance_to(points, corners), np.linalg.norm(points - closest, axis=1), atol=1e-12)


@settings(max_examples=10, deadline=None)
@given(st.tuples(*[st.floats(-0.9, 0.9)] * 3))
def test_volume_iou_of_shifted_boxes(shift):
    overlap = np.prod(1 - np.abs(shift))
    got = volume.volume_iou(box(count=100), box(origin=shift, count=100), 48, 0)
    assert got == pytest.approx(overlap / (2 - overlap), abs=5e-3)


def test_volume_of_a_mesh_and_splitting_changes_nothing():
    vertices, triangles = mesh.split_long(BOX * [1, 2, 3], BOX_TRIANGLES, 0.3)
    assert mesh.volume(vertices, triangles) == pytest.approx(6)
    assert mesh.areas(vertices, triangles).sum() == pytest.approx(22)
    edges, _, uses = mesh.edges_of(triangles)
    assert (uses == 2).all()
    assert np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1).max() <= 0.3


def test_samples_are_uniform_by_area_and_reproducible():
    points, index, weights = mesh.sample_triangles(BOX * [1, 1, 10], BOX_TRIANGLES, 4200, 0)
    share = np.bincount(index, minlength=12) / 4200
    np.testing.assert_allclose(share, mesh.areas(BOX * [1, 1, 10], BOX_TRIANGLES) / 42, atol=1 / 4200)
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    np.testing.assert_array_equal(points, mesh.sample_triangles(BOX * [1, 1, 10], BOX_TRIANGLES, 4200, 0)[0])
