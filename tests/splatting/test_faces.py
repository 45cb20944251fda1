"""Planar faces from regions: planes against analytic ones, and what must not pass for a plane."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import trimesh
from brepgaussian.artifacts.truth import read_truth
from brepgaussian.artifacts.views import read_views
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.prism import Lattice, over
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.faces.align import Stack, align, parallel
from brepgaussian.splatting.faces.candidates import Candidate
from brepgaussian.splatting.faces.confirm import Face, confirm, in_doubt
from brepgaussian.splatting.hull import carve
from brepgaussian.views.stage import make_views
from ring import SIZE, ring_of_cameras


def masks_of(cameras, corners):
    """(V, H, W) region 1 where each view shows the polygon."""
    masks = np.zeros((len(cameras), SIZE, SIZE), np.int32)
    for view in range(len(cameras)):
        pixels = cameras.project(view, corners)[0]
        cv2.fillPoly(masks[view], [np.round((pixels - 0.5) * 16).astype(np.int32)], 1, shift=4)
    return masks


def nothing():
    """A scene whose only triangle hides nothing."""
    return Scene(np.array([[9.0, 9, 9], [9.1, 9, 9], [9, 9.1, 9]]), np.array([[0, 1, 2]]))


def candidate_on(plane_at, cameras, bulge, seed):
    """Samples of a hull that bulges above z = plane_at(x, y) by up to `bulge`."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0.3, 0.7, (400, 2))
    bump = bulge * np.prod(1 - ((xy - 0.5) / 0.2) ** 2, axis=1)
    points = np.column_stack([xy, plane_at(xy) + bump])
    return Candidate(points, np.tile([0, 0, 1.0], (len(points), 1)), dict.fromkeys(range(len(cameras)), 1))


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_the_plane_of_a_region_is_found_under_a_bulge(seed):
    rng = np.random.default_rng(seed)
    slope, height = rng.uniform(-0.08, 0.08, 2), rng.uniform(0.45, 0.55)
    cameras = ring_of_cameras()

    def plane_at(xy):
        return height + (xy - 0.5) @ slope

    square = np.array([[0.3, 0.3], [0.7, 0.3], [0.7, 0.7], [0.3, 0.7]])
    masks = masks_of(cameras, np.column_stack([square, plane_at(square)]))
    candidate = candidate_on(plane_at, cameras, 0.03, seed)
    aligned = align(Stack(cameras, masks, candidate), candidate, nothing())
    assert aligned is not None
    normal = np.array([*-slope, 1.0]) / np.linalg.norm([*slope, 1.0])
    assert np.degrees(np.arccos(min(aligned.normal @ normal, 1))) < 0.3
    through = np.array([0.5, 0.5, height])
    assert abs((aligned.through - through) @ normal) < 0.001  # a third of a pixel's footprint
    assert aligned.disagreement < 0.01


def turn_of(aligned):
    return np.degrees(np.arccos(min(aligned.normal[2], 1)))


@pytest.mark.parametrize("seed", [31, 32, 33])
def test_a_face_whose_masks_are_spoilt_is_parallel_to_others_if_views_agree_about_as_well(seed):
    """Along one side masks lose a strip of the face, more the flatter they see it: as if that side were lower."""
    rng = np.random.default_rng(seed)
    cameras, masks = ring_of_cameras(), []
    square = np.array([[0.3, 0.3, 0.5], [0.7, 0.3, 0.5], [0.7, 0.7, 0.5], [0.3, 0.7, 0.5]])
    for view, center in enumerate(cameras.centers):
        way = (center - 0.5)[0] / (center - 0.5)[2]
        lost = square.copy()
        lost[1:3, 0] += 0.02 * way + 0.003 * rng.normal()
        masks.append(masks_of(cameras, lost)[view])
    candidate = candidate_on(flat, cameras, 0.0, seed)
    stack = Stack(cameras, np.array(masks), candidate)
    aligned = align(stack, candidate, nothing())
    assert aligned is not None
    assert 0.5 < turn_of(aligned) < 5
    others = [np.array([0, 0, -1.0]), np.array([0, 1.0, 0]), np.array([0, 0, 1.0])]
    settled = parallel(stack, candidate, nothing(), aligned, others)
    assert turn_of(settled) < 1e-6
    assert parallel(stack, candidate, nothing(), aligned, others[:2]) is aligned


@pytest.mark.parametrize("degrees", [1.0, 2.0, 4.0])
def test_a_face_with_a_draft_keeps_it(degrees):
    cameras, slope = ring_of_cameras(), np.tan(np.radians(degrees))

    def plane_at(xy):
        return 0.5 + slope * (xy[:, 0] - 0.5)

    square = np.array([[0.3, 0.3], [0.7, 0.3], [0.7, 0.7], [0.3, 0.7]])
    masks = masks_of(cameras, np.column_stack([square, plane_at(square)]))
    candidate = candidate_on(plane_at, cameras, 0.02, 41)
    stack = Stack(cameras, masks, candidate)
    aligned = align(stack, candidate, nothing())
    assert aligned is not None
    settled = parallel(stack, candidate, nothing(), aligned, [np.array([0, 0, 1.0])])
    assert turn_of(settled) == pytest.approx(degrees, abs=0.1)


def test_one_region_over_a_step_is_no_plane():
    cameras = ring_of_cameras()
    low = masks_of(cameras, np.array([[0.3, 0.3, 0.44], [0.5, 0.3, 0.44], [0.5, 0.7, 0.44], [0.3, 0.7, 0.44]]))
    high = masks_of(cameras, np.array([[0.5, 0.3, 0.52], [0.7, 0.3, 0.52], [0.7, 0.7, 0.52], [0.5, 0.7, 0.52]]))
    candidate = candidate_on(lambda xy: np.where(xy[:, 0] < 0.5, 0.44, 0.52), cameras, 0.0, 5)
    aligned = align(Stack(cameras, np.maximum(low, high), candidate), candidate, nothing())
    assert aligned is None or aligned.disagreement > 0.012


SQUARE = np.array([[0.3, 0.3, 0.5], [0.7, 0.3, 0.5], [0.7, 0.7, 0.5], [0.3, 0.7, 0.5]])


def flat(xy):
    return np.full(len(xy), 0.5)


@pytest.mark.parametrize("seed", [21, 22])
def test_holes_that_views_show_differently_do_not_spoil_the_plane(seed):
    rng = np.random.default_rng(seed)
    cameras = ring_of_cameras()
    masks = masks_of(cameras, SQUARE)
    for view in range(len(cameras)):  # a piece of a hole's wall is merged with the face, another one in each view
        hole = np.column_stack([0.5 + 0.1 * rng.uniform(-1, 1, (5, 2)), np.full(5, 0.5)])
        corners = cv2.convexHull(cameras.project(view, hole)[0].astype(np.float32))
        cv2.fillPoly(masks[view], [np.round(corners).astype(np.int32)], 2)
    candidate = candidate_on(flat, cameras, 0.0, seed)
    aligned = align(Stack(cameras, masks, candidate), candidate, nothing())
    assert aligned is not None
    assert not aligned.holes
    assert aligned.disagreement < 0.004
    assert np.degrees(np.arccos(min(aligned.normal[2], 1))) < 0.3


@pytest.mark.parametrize("alike", [True, False])
def test_a_face_runs_on_where_the_hull_hides_it_if_views_look_alike(alike):
    rng = np.random.default_rng(5)
    cameras = ring_of_cameras()
    masks = masks_of(cameras, SQUARE)
    left = [[0.1, 0.1, 0.505], [0.42, 0.9, 0.75]]  # what silhouettes leave in an inner corner
    fill = trimesh.creation.box(bounds=left)
    points = rng.uniform([0.3, 0.3], [0.7, 0.7], (500, 2))
    height = np.where(points[:, 0] < 0.42, 0.75, 0.5)
    regions = dict.fromkeys(range(len(cameras)), 1)
    candidate = Candidate(np.column_stack([points, height]), np.tile([0, 0, 1.0], (500, 1)), regions)
    grey = np.full(masks.shape, 120, np.float32)
    if not alike:  # something else is seen there
        strip = masks_of(
            cameras, np.array([[0.28, 0.28, 0.5], [0.42, 0.28, 0.5], [0.42, 0.72, 0.5], [0.28, 0.72, 0.5]])
        )
        for view, seen in enumerate(strip):
            grey[view][seen > 0] = rng.uniform(60, 180)
    images = Images(SimpleNamespace(cameras=cameras), grey, 1.5)
    scene, stack = Scene(fill.vertices, fill.faces), Stack(cameras, masks, candidate)
    aligned = align(stack, candidate, scene)
    assert aligned is not None
    face = confirm(images, stack, candidate, aligned, scene)
    assert face is not None
    hidden = np.column_stack([rng.uniform([0.31, 0.33], [0.33, 0.67], (500, 2)), np.full(500, 0.5)])
    share = over(face.lattice, face.outline, hidden)[0].mean()
    assert share > 0.95 if alike else share < 0.3


def test_what_is_hidden_belongs_to_a_face_only_if_it_touches_it():
    rng = np.random.default_rng(6)
    cameras = ring_of_cameras()
    apart = SQUARE * [0.5, 1, 1] + [0.6, 0, 0]  # x from .75 to .95
    masks = np.maximum(masks_of(cameras, SQUARE), masks_of(cameras, apart))
    fill = trimesh.creation.box(bounds=[[0.72, 0.1, 0.505], [1.0, 0.9, 0.75]])
    points = rng.uniform([0.3, 0.3, 0.5], [0.95, 0.7, 0.500001], (500, 3))
    regions = dict.fromkeys(range(len(cameras)), 1)
    candidate = Candidate(points, np.tile([0, 0, 1.0], (500, 1)), regions)
    images = Images(SimpleNamespace(cameras=cameras), np.full(masks.shape, 120, np.float32), 1.5)
    scene, stack = Scene(fill.vertices, fill.faces), Stack(cameras, masks, candidate)
    aligned = align(stack, candidate, scene)
    assert aligned is not None
    face = confirm(images, stack, candidate, aligned, scene)
    assert face is not None
    assert face.lattice.centers()[face.outline][:, 0].max() < 0.75


@pytest.mark.parametrize(("size", "found"), [(1.0, True), (0.35, False)])
def test_four_views_confirm_a_large_face(size, found):
    """Of few views fewer see a face; a narrow strip of a curved one agrees as well in four."""
    cameras = ring_of_cameras(4)
    square = SQUARE.mean(axis=0) + size * (SQUARE - SQUARE.mean(axis=0))
    masks = masks_of(cameras, square)
    rng = np.random.default_rng(7)
    points = np.column_stack([rng.uniform(square.min(axis=0)[:2], square.max(axis=0)[:2], (400, 2)), np.full(400, 0.5)])
    candidate = Candidate(points, np.tile([0, 0, 1.0], (400, 1)), dict.fromkeys(range(4), 1))
    images = Images(SimpleNamespace(cameras=cameras), np.full(masks.shape, 120, np.float32), 1.5)
    stack = Stack(cameras, masks, candidate)
    aligned = align(stack, candidate, nothing())
    assert aligned is not None
    assert (confirm(images, stack, candidate, aligned, nothing()) is not None) == found


@pytest.fixture(scope="module")
def bracket(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bracket")
    files = {"out_views": folder / "views.h5", "out_truth": folder / "truth.h5"}
    settings = ViewsSettings(rendered_views=30, image_size=300)
    make_views(object_name="bracket", source="part", path="l_bracket:7", settings=settings, **files)
    views, truth = read_views(files["out_views"]), read_truth(files["out_truth"])
    regions = truth.face_ids.astype(np.int32) + 1
    return truth, *(carve(views, 96, patches=p) for p in (None, regions))


def test_faces_of_a_bracket_lie_on_its_planes(bracket):
    truth, _, (_, faces) = bracket
    assert len(faces) >= 5
    for face in faces:
        normals = np.array([truth.normals[truth.point_face == f].mean(0) for f in range(len(truth.face_types))])
        alike = [f for f, n in enumerate(normals) if n @ face.lattice.normal > 0.999]
        heights = [np.abs(face.lattice.coordinates(truth.points[truth.point_face == f])[1]).max() for f in alike]
        assert min(heights) < 0.006


def test_the_inner_corner_of_a_bracket_is_carved(bracket):
    truth, (before, _), (after, _) = bracket

    def stands_out(hull):
        scene = Scene(truth.mesh_vertices, truth.mesh_triangles)
        return np.quantile(scene.signed_distance(hull.vertices), 0.99)

    assert stands_out(after) < 0.6 * stands_out(before)


def test_a_ball_has_no_planar_face(tmp_path):
    files = {"out_views": tmp_path / "views.h5", "out_truth": tmp_path / "truth.h5"}
    settings = ViewsSettings(rendered_views=30, image_size=300)
    make_views(object_name="pin", source="part", path="ball_pin:4", settings=settings, **files)
    views, truth = read_views(files["out_views"]), read_truth(files["out_truth"])
    _, faces = carve(views, 96, patches=truth.face_ids.astype(np.int32) + 1)
    flat = np.isin(truth.point_face, [f for f, kind in enumerate(truth.face_types) if kind == "plane"])
    for face in faces:
        within, heights = over(face.lattice, face.outline, truth.points)
        near = within & (np.abs(heights) < 0.01)
        assert flat[near].mean() > 0.9


@pytest.mark.parametrize(("merging", "doubt"), [(0, True), (4, True), (5, False)])
@pytest.mark.parametrize("outside", [4.0, 1.0])
def test_where_a_rib_stands_is_in_doubt_though_regions_of_some_views_merge_them(merging, doubt, outside):
    """Five views would see the foot if nothing stood there; those that split have it outside the region, by pixels."""
    lattice = Lattice(np.array([0.1, 0.1, 0.5]), *np.eye(3), 0.1, (8, 8))
    foot, unseen = np.zeros((8, 8), bool), np.zeros((8, 8), bool)
    foot[3:5], unseen[6:] = True, True  # what nobody sees stays
    before, after = object(), object()
    sees = {id(before): ~foot & ~unseen, id(after): ~unseen}
    inside = np.stack([~foot | (k < merging) for k in range(5)])
    stack = SimpleNamespace(
        visible=lambda cells, scene: np.tile(sees[id(scene)].ravel(), (5, 1)),
        sample=lambda cells, views, holes: np.where(inside.reshape(5, -1), 4.0, -outside),
    )
    face = Face(lattice, np.ones((8, 8), bool), 0.001, 0.2)
    found = in_doubt(face, stack, SimpleNamespace(views=np.arange(5)), before, after)
    np.testing.assert_array_equal(found, foot & (doubt and outside > 2))
