"""The stage from files to `points.ply`, on a box with exact masks and on degenerate clouds."""

from pathlib import Path

import numpy as np
import pytest
from brepgaussian.artifacts.points import read_labellings, read_points
from brepgaussian.artifacts.stage1 import Surfels
from brepgaussian.errors import ArtifactError
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.points import simulate
from brepgaussian.points.assign import same_patches
from brepgaussian.points.stage import make_points
from brepgaussian.settings.points import PointsSettings
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

LOW, HIGH = np.array([0.0, 0.2, 0.3]), np.array([1.0, 0.8, 0.7])
GREY = np.array([60, 90, 120, 150, 180, 210])


@pytest.fixture(scope="module")
def cameras(look_at) -> Cameras:
    return look_at(14, 200)


def surfels_of(points, normals, scale=0.012) -> Surfels:
    n, f = len(points), np.float32
    return Surfels(
        points.astype(f), simulate._quaternions(normals).astype(f), np.full((n, 2), scale, f),
        np.full(n, 0.9, f), np.full((n, 3), 0.5, f), np.zeros(n, f),
    )  # fmt: skip


def box(rng, count=3500, sigma=0.002, angle=0.06):
    size = HIGH - LOW
    area = np.array([size[1] * size[2], size[0] * size[2], size[0] * size[1]])
    face = rng.choice(6, count, p=np.repeat(area, 2) / (2 * area.sum()))
    points = LOW + rng.random((count, 3)) * size
    axis = face // 2
    points[np.arange(count), axis] = np.where(face % 2, HIGH[axis], LOW[axis])
    normals = np.zeros((count, 3))
    normals[np.arange(count), axis] = np.where(face % 2, 1, -1)
    points += rng.normal(size=(count, 1)) * sigma * normals
    normals += rng.normal(size=normals.shape) * angle
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True), face


@pytest.fixture(scope="module")
def box_images(cameras, box_hit):
    faces = np.stack([box_hit(cameras, v, LOW, HIGH) for v in range(len(cameras))])
    return (faces + 1).astype(np.int16), np.where(faces >= 0, GREY[faces], 0)


@pytest.mark.parametrize("seed", [21, 22])
def test_box_gets_six_labels_and_twelve_curves(write_case, cameras, box_images, seed):
    points, normals, face = box(np.random.default_rng(seed))
    files = write_case(surfels_of(points, normals), *box_images, cameras)
    result = make_points(**files, settings=PointsSettings())
    assert len(result.xyz) >= 20000
    assert result.label.max() == 5
    assert result.curve.max() == 11
    centres = result.label[: len(points)]
    agree = sum(np.bincount(centres[(face == k) & (centres >= 0)]).max() for k in range(6))
    assert agree / len(points) > 0.98
    on = result.xyz[result.curve >= 0].astype(float)
    off = np.sort(np.minimum(np.abs(on - LOW), np.abs(on - HIGH)), axis=1)[:, :2]  # an edge lies on two faces
    assert np.median(off) < 0.001
    assert (result.edge[result.curve >= 0] == 1).all()


def test_all_masks_wrong_still_separates_by_geometry(write_case, cameras, box_images):
    points, normals, _ = box(np.random.default_rng(23))
    blind = np.where(box_images[0] > 0, 1, 0)
    files = write_case(surfels_of(points, normals), blind, box_images[1], cameras)
    assert make_points(**files, settings=PointsSettings()).label.max() == 5


def test_a_biased_side_is_drawn_to_the_images(write_case, look_at, box_hit):
    """One side lies .008 inside, as trained surfels may; the edges of the images bring it back."""
    cameras = look_at(20, 400)
    faces = np.stack([box_hit(cameras, v, LOW, HIGH) for v in range(len(cameras))])
    points, normals, face = box(np.random.default_rng(31), count=4500, sigma=0.001)
    points[face == 5, 2] -= 0.008
    files = write_case(surfels_of(points, normals), faces + 1, np.where(faces >= 0, GREY[faces], 0), cameras)
    off = {}
    for snap in (False, True):
        result = make_points(**files, settings=PointsSettings(snap_curves=snap))
        top = result.label == np.bincount(result.label[:4500][face == 5] + 1).argmax() - 1
        plain = top & (result.curve < 0)
        off[snap] = abs(np.median(result.xyz[plain, 2]) - HIGH[2])
    assert off[False] > 0.006
    assert off[True] < 0.003


def test_same_bytes_again(write_case, cameras, box_images):
    points, normals, _ = box(np.random.default_rng(24), count=1500)
    files = write_case(surfels_of(points, normals), *box_images, cameras)
    written = []
    for threads in (1, 2):
        make_points(**files, settings=PointsSettings(), threads=threads)
        written.append(Path(files["out_path"]).read_bytes())
    assert written[0] == written[1]
    assert read_points(files["out_path"]).label.dtype == np.int32


def test_other_labellings_are_kept_if_their_patches_differ(write_case, cameras, box_images):
    points, normals, _ = box(np.random.default_rng(26), count=1500)
    files = write_case(surfels_of(points, normals), *box_images, cameras)
    first = make_points(**files, settings=PointsSettings())
    assert len(read_labellings(files["out_path"])) == 1  # a box has the same six faces at every cost
    make_points(**files, settings=PointsSettings(other_label_costs=(1e6, 2e6)))
    again, other = read_labellings(files["out_path"])  # no label is worth so much: both costs leave the same pieces
    np.testing.assert_array_equal(again.label, first.label)
    np.testing.assert_array_equal(read_points(files["out_path"]).xyz, first.xyz)
    assert other.label.max() != first.label.max()


def test_the_order_of_labels_makes_no_other_patches():
    labels = np.repeat(np.arange(4), 25)
    rng = np.random.default_rng(3)
    turned = np.array([2, 0, 3, 1])[labels]
    turned[rng.choice(100, 10, replace=False)] = -1  # points at borders
    assert same_patches(labels, turned)
    assert not same_patches(labels, np.minimum(labels, 2))
    assert not same_patches(
        np.repeat(np.arange(4), 25), np.repeat([0, 1, 2, 3, 3, 3, 3, 3], [25, 25, 5, 5, 10, 10, 10, 10])
    )
    assert not same_patches(labels, np.full(100, -1))


def test_labels_from_features_alone(write_case, cameras, box_images):
    rng = np.random.default_rng(25)
    points, normals, face = box(rng)
    features = np.eye(6, 8)[face] + rng.normal(size=(len(face), 8)) * 0.05
    features /= np.linalg.norm(features, axis=1, keepdims=True)
    files = write_case(surfels_of(points, normals), *box_images, cameras, features.astype(np.float32))
    assert make_points(**files, settings=PointsSettings(labels="features")).label.max() == 5


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(1, 60), st.sampled_from(["random", "plane", "line", "point"]), st.integers(0, 1000))
@example(53, "random", 2)  # in one view, all points of a curve are seen end on
def test_any_cloud_gives_a_result(write_case, cameras, count, shape, seed):
    rng = np.random.default_rng(seed)
    points = rng.random((count, 3))
    flat = {"random": [], "plane": [2], "line": [1, 2], "point": [0, 1, 2]}[shape]
    points[:, flat] = 0.5
    normals = rng.normal(size=(count, 3)) if shape == "random" else np.tile([0, 0, 1.0], (count, 1))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    nothing = np.zeros((len(cameras), cameras.height, cameras.width), np.int16)
    files = write_case(surfels_of(points, normals), nothing, nothing, cameras)
    result = make_points(**files, settings=PointsSettings(minimum_points=500))
    assert np.isfinite(result.xyz).all()
    used = np.unique(result.label[result.label >= 0])
    assert used.tolist() == list(range(len(used)))
    assert len(used) >= 1


def test_one_plane_is_one_label(write_case, cameras):
    rng = np.random.default_rng(26)
    points = np.column_stack([rng.random((2500, 2)), np.full(2500, 0.5)])
    normals = np.tile([0, 0, 1.0], (2500, 1)) + rng.normal(size=(2500, 3)) * 0.05
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    nothing = np.zeros((len(cameras), cameras.height, cameras.width), np.int16)
    files = write_case(surfels_of(points, normals), nothing, nothing, cameras)
    result = make_points(**files, settings=PointsSettings())
    assert result.label.max() == 0
    assert result.curve.max() == -1


def test_features_of_another_cloud_are_refused(write_case, cameras, box_images):
    points, normals, _ = box(np.random.default_rng(27), count=300)
    files = write_case(surfels_of(points, normals), *box_images, cameras, np.ones((5, 4), np.float32))
    with pytest.raises(ArtifactError, match="another number of surfels"):
        make_points(**files, settings=PointsSettings())


def test_no_surfels_are_refused(write_case, cameras, box_images):
    files = write_case(surfels_of(np.zeros((0, 3)), np.zeros((0, 3))), *box_images, cameras)
    with pytest.raises(ArtifactError, match="no surfels"):
        make_points(**files, settings=PointsSettings())
