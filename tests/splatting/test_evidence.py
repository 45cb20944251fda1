"""3D edges, unobserved surface, chords and straightened channels, against solids whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.artifacts.truth import read_truth
from brepgaussian.artifacts.views import read_views
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.splatting.concave import Prism
from brepgaussian.splatting.concave.contours import chords_in, loss
from brepgaussian.splatting.concave.leaning import countersunk
from brepgaussian.splatting.concave.prism import Lattice
from brepgaussian.splatting.concave.radiance import disagreement
from brepgaussian.splatting.concave.rays import Rays, exits
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.shapes import Opening, Shape, best_depth
from brepgaussian.splatting.evidence import concavity_edges, edge_cloud, unobserved
from brepgaussian.splatting.evidence.edgels import find_edgels
from brepgaussian.splatting.evidence.edges import EdgeCloud
from brepgaussian.splatting.hull import carve
from brepgaussian.views.stage import make_views

BOX = np.array(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij")).reshape(3, -1).T.astype(float)
SIDES = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
SIDES += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]


@pytest.fixture(scope="module")
def channel(tmp_path_factory):
    """A U-channel of a seed that nothing was tuned on."""
    folder = tmp_path_factory.mktemp("channel")
    files = {"out_views": folder / "views.h5", "out_truth": folder / "truth.h5"}
    settings = ViewsSettings(rendered_views=40, image_size=500)
    make_views(object_name="channel", source="part", path="u_channel:3", settings=settings, **files)
    return read_views(files["out_views"]), read_truth(files["out_truth"])


def test_chords_of_a_box_and_what_a_half_space_leaves():
    scene = Scene(BOX, np.array(SIDES))
    origins = np.array([[-1, 0.3, 0.4], [-1, 0.3, 1.4], [0.21, 0.32, 3]])
    directions = np.array([[1.0, 0, 0], [1, 0, 0], [0, 0, -1]])
    chords = chords_in(scene, origins, directions)
    np.testing.assert_array_equal(chords.ray, [0, 2])
    np.testing.assert_allclose(chords.entry, [[0, 0.3, 0.4], [0.21, 0.32, 1]], atol=1e-6)
    up = np.array([0, 0, 1.0])
    left = chords.trimmed(up, 0.3)
    np.testing.assert_array_equal(left.ray, [2])
    np.testing.assert_allclose(left.entry, [[0.21, 0.32, 0.3]], atol=1e-6)
    assert loss(chords, left, up, 0.3) == 0.5


def test_edges_of_an_image_are_found_to_a_tenth_of_a_pixel():
    rng = np.random.default_rng(5)
    for angle, place in rng.uniform([0.2, -4], [1.3, 4], (5, 2)):
        normal = np.array([np.cos(angle), np.sin(angle)])
        y, x = np.mgrid[:600, :600] / 10 + 0.05  # ten samples a pixel: its coverage
        bright = ((x - 30) * normal[0] + (y - 30) * normal[1] > place).astype(np.float32)
        image = 100 + 50 * bright.reshape(60, 10, 60, 10).mean(axis=(1, 3), dtype=np.float32)
        edges = find_edgels(image, np.full((60, 60), 255, np.uint8), 1.0)
        inner = (np.abs(edges.points - 30) < 20).all(axis=1)
        offset = (edges.points[inner] - 30) @ normal - place
        assert inner.sum() > 20
        assert np.abs(offset).mean() < 0.1
        assert (edges.normals[inner] @ normal).min() > 0.95


def test_views_agree_at_the_true_depth_only():
    rng = np.random.default_rng(11)
    outline = np.zeros((60, 50), bool)
    outline[10:50, 10:40] = True
    count, depth = 20_000, 14.0
    start = rng.uniform([10, 10], [49, 39], (count, 2))
    sideways = rng.uniform(-1.5, 1.5, (count, 2))
    everywhere = (np.arange(count) % 7, np.zeros((count, 0)), np.ones(count, bool), np.zeros(count))  # solid below
    blank = Rays(start, sideways, np.zeros(count), *everywhere)
    leaves = exits(blank, outline, 40.0)
    sunk = np.minimum(leaves, depth)
    end = start + sunk[:, None] * sideways
    inside = np.minimum(end - [10, 10], [49, 39] - end).min(axis=1)
    assert np.abs(inside[leaves < depth]).max() < 1.0  # on a wall
    grey = 200 + 0.5 * end[:, 0] + 0.3 * sunk + 6 * (leaves < depth)
    rays = Rays(start, sideways, grey, *everywhere)
    costs = {tried: disagreement(rays, leaves, tried, 1.5)[0].mean() for tried in (8.0, 11.0, 14.0, 17.0, 22.0)}
    assert min(costs, key=costs.get) == depth


def test_a_hole_that_a_sample_of_its_rays_does_not_show_is_no_countersink():
    rng = np.random.default_rng(12)
    outline = np.zeros((40, 40), bool)
    outline[10:30, 10:30] = True
    count = 3000
    start, sideways = rng.uniform(10, 29, (count, 2)), rng.uniform(-1, 1, (count, 2))
    solid = np.zeros((count, 0)), np.ones(count, bool), np.zeros(count)
    rays = Rays(start, sideways, np.full(count, 90.0), np.arange(count) % 5, *solid)  # none shows background
    opening = Opening(rays, 1000, outline, (20.0,), 1.5, breaks=False)
    hole = Shape(20.0, through=True)
    assert not opening.holed
    assert opening.score(countersunk(opening, hole))[0] >= opening.score(hole)[0]


@pytest.mark.parametrize("shown", [False, True])
def test_a_hole_leads_on_to_another_opening_only_if_rays_show_that(shown):
    """It would break into a channel that is 20 cells deep and 10 high; no light comes through."""
    rng = np.random.default_rng(14)
    outline = np.zeros((40, 40), bool)
    outline[10:30, 10:30] = True
    count = 6000
    start, sideways = rng.uniform(10, 29, (count, 2)), rng.uniform(-0.6, 0.6, (count, 2))
    crossings = np.tile([20.0, 30.0, 60.0], (count, 1))
    beyond = crossings, np.ones(count, bool), np.zeros(count)
    rays = Rays(start, sideways, np.full(count, 90.0), np.arange(count) % 5, *beyond)
    leaves = exits(rays, outline, 61.0)
    if shown:  # the channel's far wall, with a pattern
        end = start + 30 * sideways
        grey = np.where(leaves > 20, 150 + 40 * np.sin(end[:, 0] / 4), 90.0)
        rays = Rays(start, sideways, grey, np.arange(count) % 5, *beyond)
    opening = Opening(rays, count, outline, (20.0, 61.0), 1.5, breaks=True)
    assert opening.holed
    assert not opening.lit
    assert best_depth(opening, 36).through == shown


def test_rays_at_a_rim_do_not_count_unless_that_leaves_too_few():
    rng = np.random.default_rng(13)
    start = rng.uniform(0, 40, (2000, 2))
    blank = np.zeros((2000, 2)), np.full(2000, 90.0), np.arange(2000) % 5, np.zeros((2000, 0)), np.ones(2000, bool)
    rays = Rays(start, *blank, np.zeros(2000))
    for half, narrow in ((10, False), (1, True)):
        outline = np.zeros((40, 40), bool)
        outline[10:30, 20 - half : 20 + half] = True
        opening = Opening(rays, 2000, outline, (20.0,), 1.5, breaks=False)
        every = opening.costs(Shape(5.0))[1]
        opening.keep_clear(1.0)
        counted = opening.costs(Shape(5.0))[1]
        low, high = np.array([8.5, 18.5 - half]), np.array([30.5, 20.5 + half])  # cells' centres are whole numbers
        aside = np.maximum(low - start, start - high)
        rim = (np.abs(aside.max(axis=1)) < 1.2) & (aside.min(axis=1) < -3)  # clear of corners, which are round
        if narrow:
            assert np.array_equal(counted, every)
        else:
            assert not counted[rim].any()
            assert np.array_equal(counted[aside.max(axis=1) < -2], every[aside.max(axis=1) < -2])
        opening.keep_clear(None)
        assert np.array_equal(opening.costs(Shape(5.0))[1], every)


def test_edges_and_open_channel_of_a_part(channel):
    views, truth = channel
    closed = carve(views, 96, 1)[0]
    hull = carve(views, 96, 1, True)[0]
    inside = np.abs(Scene(closed.vertices, closed.triangles).signed_distance(truth.points)).mean()
    opened = np.abs(Scene(hull.vertices, hull.triangles).signed_distance(truth.points)).mean()
    assert opened < 0.5 * inside
    scene = Scene(hull.vertices, hull.triangles)
    cloud = edge_cloud(views, scene, 0.0)
    gaps = np.linalg.norm(truth.curve_points[:, None] - cloud.points[None, ::20], axis=2).min(axis=0)
    assert np.median(gaps) < 0.003  # truth is sampled every .005: an exact point is .00125 off
    again = edge_cloud(views, scene, 0.0)
    assert again.points.tobytes() == cloud.points.tobytes()


def test_edges_of_a_concavity_are_its_border_and_corners(channel):
    views = channel[0]
    lattice = Lattice(np.array([0.0, 0.0, 1.0]), *np.eye(3), 0.01, (100, 100))
    outline = np.zeros((100, 100), bool)
    outline[30:70, 20:60] = True
    box = Scene(BOX, np.array(SIDES))
    empty = EdgeCloud(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32), np.zeros(0, np.int16))
    shallow = Prism(lattice, outline, 0.004, False, 0.0)  # so that all of it lies at the box' surface
    cloud = concavity_edges(views, box, [shallow], empty)
    low, high = np.array([0.3, 0.2]), np.array([0.7, 0.6])
    border = np.minimum(np.abs(cloud.points[:, :2] - low), np.abs(cloud.points[:, :2] - high)).min(axis=1)
    assert len(cloud.points) > 250
    assert np.quantile(border, 0.9) < 0.005
    assert ((cloud.points[:, 2] > 0.99) & (cloud.points[:, 2] < 1.001)).all()


def test_a_countersunk_hole_has_a_rim_a_throat_and_a_floor(channel):
    lattice = Lattice(np.array([0.0, 0.0, 1.0]), *np.eye(3), 0.01, (100, 100))
    rows, columns = np.indices((100, 100)) + 0.5
    outline = np.hypot(rows - 50, columns - 50) < 20
    hole = Prism(lattice, outline, 0.006, False, 0.0, draft=5.0, sink=0.02)  # so shallow that views see all of it
    empty = EdgeCloud(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32), np.zeros(0, np.int16))
    cloud = concavity_edges(channel[0], Scene(BOX, np.array(SIDES)), [hole], empty)
    radius, depth = np.hypot(*(cloud.points[:, :2] - 0.5).T), 1 - cloud.points[:, 2]
    for known_depth, known_radius in ((0.0, 0.2), (0.004, 0.18), (0.006, 0.18)):
        ring = np.abs(depth - known_depth) < 2e-4
        assert ring.sum() > 80
        assert np.abs(radius[ring] - known_radius).max() < 0.5 * lattice.pitch


def test_what_no_camera_can_see_is_unobserved(channel):
    views = channel[0]
    shelf = np.array([[0.3, 0.3, 0.5], [0.7, 0.3, 0.5], [0.7, 0.7, 0.5], [0.3, 0.7, 0.5]])
    scene = Scene(np.concatenate([BOX, shelf]), np.array([*SIDES, [8, 9, 10], [8, 10, 11]]))  # inside the box
    points = np.array([[0.5, 0.45, 0.5], [0.5, 0.45, 1.0]])
    normals = np.array([[0, 0, 1.0], [0, 0, 1.0]])
    np.testing.assert_array_equal(unobserved(views, scene, points, normals, 0.001), [True, False])


def test_more_samples_than_opencv_maps_have_rows():
    from brepgaussian.splatting.evidence.edgels import _at

    image = np.random.default_rng(3).random((50, 40), np.float32)
    x, y = np.arange(70_000) % 39 + 0.0, np.arange(70_000) % 49 + 0.0
    assert np.array_equal(_at(image, x, y), image[y.astype(int), x.astype(int)])


def test_no_rays_meet_nothing():
    box, none = Scene(BOX, np.array(SIDES)), np.zeros((0, 3))
    assert [len(found) for found in box.intersections(none, none)] == [0, 0]  # Open3D crashes on them
    assert [len(found) for found in box.hits(none, none)] == [0, 0]
    assert len(box.distances(none, none)) == len(box.occluded(none, none)) == len(box.signed_distance(none)) == 0


def test_a_deeper_floor_has_to_explain_all_rays_better_not_only_those_that_tell_of_both():
    count = 400
    opening = Opening.__new__(Opening)
    opening._units = np.arange(count)
    rng = np.random.default_rng(14)
    half = np.arange(count) < count // 2
    shallow, deep, better = Shape(10.0), Shape(20.0), Shape(30.0)
    level = 0.3 + rng.uniform(0, 0.05, count)
    costs = {
        shallow: (np.where(half, level, 0.0), np.ones(count, bool)),
        deep: (level - 0.05, half),  # tells nothing of what the shallow one explains well
        better: (np.where(half, level - 0.05, 0.0), np.ones(count, bool)),
    }
    opening.costs = costs.__getitem__
    assert opening.advantage(costs[shallow], costs[deep]) > 4
    assert opening.simplest([shallow, deep]) == shallow
    assert opening.simplest([shallow, deep, better]) == better
    assert opening.simplest([shallow, replace(deep, through=True)], {replace(deep, through=True): costs[deep]}).through
