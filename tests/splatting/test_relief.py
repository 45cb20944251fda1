"""A hull's surface moved to where parallax shows it: views of exact solids whose radiance is known."""

import numpy as np
import pytest
from brepgaussian.artifacts.views import Views
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.splatting.concave import Images
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.relief import relieve
from hypothesis import given, settings
from hypothesis import strategies as st
from poses import look_at

COUNT = 90
SPACING = 1 / (COUNT - 1)
GRID = np.stack(np.meshgrid(*[SPACING * np.arange(COUNT)] * 3, indexing="ij"), axis=-1)
TOP, HALF, SIDE_PX, FOCAL = 0.6, 0.28, 260, 330.0
FLAT = (0.0, 0.0)


def corner(depth=FLAT):
    """A block with a step on it, and (height, width) of a bulge of the floor before the step."""
    x, y, z = np.moveaxis(GRID, -1, 0)
    height, width = depth
    bulge = height * np.exp(-((x - 0.45) ** 2 + (y - 0.5) ** 2) / max(width, 1e-9) ** 2)
    walls = np.minimum.reduce([HALF - np.abs(x - 0.5), HALF - np.abs(y - 0.5), z - TOP + 0.4])
    step = np.minimum(x - 0.6, TOP + 0.1 - z)
    field = np.minimum(walls, np.maximum(TOP + bulge - z, step))
    return Volume(field.astype(np.float32), np.zeros(3), SPACING)


def images_of(volume, radiance, count=14):
    """Views of a volume from above, whose places have the radiance of (N, 3) points; and one region for each normal."""
    scene, poses = volume.scene(), []
    for k in range(count):
        angle = 2 * np.pi * k / count
        tilt = 0.5 + 0.5 * (k % 2)
        eye = np.array([np.cos(angle) * np.sin(tilt), np.sin(angle) * np.sin(tilt), np.cos(tilt)])
        poses.append(look_at(0.5 + 1.6 * eye, np.full(3, 0.5)))
    intrinsics = np.tile([FOCAL, FOCAL, SIDE_PX / 2, SIDE_PX / 2], (count, 1))
    cameras = Cameras(intrinsics, np.array(poses), SIDE_PX, SIDE_PX)
    pixels = np.stack(np.meshgrid(np.arange(SIDE_PX), np.arange(SIDE_PX)), axis=-1).reshape(-1, 2) + 0.5
    grey, alpha = np.zeros((count, SIDE_PX**2), np.uint8), np.zeros((count, SIDE_PX**2), np.uint8)
    patches = np.zeros((count, SIDE_PX**2), np.int32)
    for view in range(count):
        center, directions = cameras.rays(view, pixels)
        ray, points, normals = scene.seen(np.broadcast_to(center, directions.shape), directions)
        grey[view, ray] = np.clip(np.round(radiance(points)), 1, 254)
        alpha[view, ray] = 255
        patches[view, ray] = 1 + np.abs(normals).argmax(axis=1)
    shape = (count, SIDE_PX, SIDE_PX)
    rgb = np.repeat(grey.reshape(*shape, 1), 3, axis=3)
    names = tuple(str(k) for k in range(count))
    views = Views("corner", names, rgb, alpha.reshape(shape), cameras, np.eye(4))
    return Images.of(views), patches.reshape(shape)


def heights(volume):
    """Of the surface over places of the floor in front of the step."""
    spots = np.stack(np.meshgrid(np.linspace(0.35, 0.55, 11), np.linspace(0.35, 0.65, 13)), axis=-1).reshape(-1, 2)
    start = np.column_stack([spots, np.full(len(spots), 0.95)])
    return 0.95 - volume.scene().distances(start, np.broadcast_to([0.0, 0, -1], start.shape))


def towards_the_step(points):
    return 90 + 300 * points[:, 0] + 60 * points[:, 1] ** 2 - 100 * points[:, 2]


@pytest.mark.parametrize("depth", [(0.015, 0.06), (-0.012, 0.07)])
def test_a_bulge_and_a_dent_go_where_radiance_changes(depth):
    images, patches = images_of(corner(), towards_the_step)
    hull = corner(depth)
    before, after = (np.abs(heights(volume) - TOP) for volume in (hull, relieve(images, patches, [], hull)))
    pixel = images.views.cameras.footprint()
    assert before.max() > 2 * pixel
    assert after.max() < pixel  # what lies nearer is not sure to lie elsewhere
    assert after.mean() < 0.4 * before.mean()


def test_what_is_right_stays_as_it_is():
    images, patches = images_of(corner(), towards_the_step)
    hull = corner()
    assert relieve(images, patches, [], hull) is hull


def test_nothing_is_moved_where_radiance_does_not_tell():
    images, patches = images_of(corner(), lambda points: np.full(len(points), 120.0))
    hull = corner((0.015, 0.06))
    assert relieve(images, patches, [], hull) is hull


def test_masks_without_a_clear_pixel_tell_nothing():
    images, patches = images_of(corner(), towards_the_step)
    hull = corner((0.015, 0.06))
    assert relieve(images, np.zeros_like(patches), [], hull) is hull


@settings(max_examples=6, deadline=None)
@given(
    gradient=st.tuples(*[st.floats(-150, 150)] * 2),
    noise=st.floats(0, 2),
    seed=st.integers(0, 2**16),
)
def test_noise_moves_no_surface_that_is_right(gradient, noise, seed):
    rng = np.random.default_rng(seed)

    def radiance(points):
        return 120 + (points[:, :2] - 0.5) @ gradient + rng.normal(0, noise, len(points))

    images, patches = images_of(corner(), radiance, count=8)
    images = Images.of(images.views, noise)
    moved = relieve(images, patches, [], corner())
    assert np.abs(heights(moved) - TOP).max() < 0.5 * images.views.cameras.footprint()
