"""Planar faces from regions: planes against analytic ones, and what must not pass for a plane."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import trimesh
from brepgaussian.artifacts.truth import read_truth
from brepgaussian.artifacts.views import read_views
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.prism import Lattice, over
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.faces import flatten
from brepgaussian.splatting.faces.align import Stack, align, parallel
from brepgaussian.splatting.faces.candidates import Candidate
from brepgaussian.splatting.faces.confirm import Face, confirm, in_doubt
from brepgaussian.splatting.hull import carve
from brepgaussian.views.stage import make_views
from poses import look_at

SIZE, FOCAL = 400, 520.0


def ring_of_cameras(count=12):
    poses = []
    for k in range(count):
        angle, height = 2 * np.pi * k / count, 0.9 + 0.5 * (k % 3)
        center = np.array([0.5 + 1.3 * np.cos(angle), 0.5 + 1.3 * np.sin(angle), 0.5 + height])
        poses.append(look_at(center))
    return Cameras(np.tile([FOCAL, FOCAL, SIZE / 2, SIZE / 2], (count, 1)), np.array(poses), SIZE, SIZE)


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


@pytest.mark.parametrize(("width", "high", "kept"), [(4, 0.15, True), (30, 0.15, False), (4, 0.05, False)])
def test_what_stands_on_a_face_keeps_its_foot_if_it_is_narrow_and_high(monkeypatch, width, high, kept):
    lattice = Lattice(np.zeros(3), *np.eye(3), 0.01, (100, 100))
    face = Face(lattice, np.ones((100, 100), bool), 0.002, 0.3)
    rows, columns = np.mgrid[2:98, 2:98].reshape(2, -1)
    above = np.column_stack([0.01 * (rows + 0.5), 0.01 * (columns + 0.5), np.full(rows.size, high)])
    foot = (rows >= 40) & (rows < 40 + width) & (columns < 70)
    # a bulge of twice the foot's samples: enough of it is needed for the face to be in doubt
    some = foot | (np.arange(rows.size) % 16 == 0)
    monkeypatch.setattr(flatten, "_needed", lambda views, samples, after: foot[some])
    found = flatten._allowed(None, face, above[some], 0.01, None)
    assert (found is not None) == kept
    if kept:
        assert not found.outline[40:44, 2:70].any()
        assert found.outline[:37].all()
        assert found.outline[:, 75:].all()


def test_a_face_on_which_nothing_needed_stands_is_left_alone(monkeypatch):
    face = Face(Lattice(np.zeros(3), *np.eye(3), 0.01, (100, 100)), np.ones((100, 100), bool), 0.002, 0.3)
    above = np.array([[0.5, 0.5, 0.1], [0.3, 0.3, 0.1]])
    monkeypatch.setattr(flatten, "_needed", lambda views, samples, after: np.zeros(len(samples), bool))
    assert flatten._allowed(None, face, above, 0.01, None) is face
    assert flatten._allowed(None, face, above[:0], 0.01, None) is face


def test_silhouettes_tell_a_bulge_from_a_rib():
    cameras = ring_of_cameras()
    base = trimesh.creation.box(bounds=[[0.2, 0.2, 0.3], [0.8, 0.8, 0.5]])
    rib = trimesh.creation.box(bounds=[[0.45, 0.2, 0.5], [0.5, 0.8, 0.7]])
    hull = trimesh.creation.box(bounds=[[0.4, 0.2, 0.5], [0.55, 0.8, 0.7]])
    part = trimesh.util.concatenate([base, rib])
    scene = Scene(part.vertices, part.faces)
    alpha = np.zeros((len(cameras), SIZE, SIZE), np.uint8)
    rows, columns = np.mgrid[:SIZE, :SIZE] + 0.5
    for view in range(len(cameras)):
        center, rays = cameras.rays(view, np.column_stack([columns.ravel(), rows.ravel()]))
        alpha[view] = 255 * scene.occluded(np.broadcast_to(center, rays.shape), rays).reshape(SIZE, SIZE)
    views = SimpleNamespace(cameras=cameras, alpha=alpha)
    lattice = Lattice(np.array([0.2, 0.2, 0.5]), *np.eye(3), 0.01, (60, 60))
    beside, all_over = np.ones((60, 60), bool), np.ones((60, 60), bool)
    beside[25:30] = False  # where the rib stands
    samples = hull.sample(20000, seed=0)
    face = Face(lattice, beside, 0.0, 0.2)
    assert flatten._allowed(views, face, samples, 0.02, scene) is face
    without = Scene(base.vertices, base.faces)
    assert flatten._allowed(views, Face(lattice, all_over, 0.0, 0.2), samples, 0.02, without) is None


@pytest.mark.parametrize(
    ("bulge", "said", "kept"),
    [
        (0.2, (0.4, 1.2, 500), False),  # walls went with it
        (0.2, (1.0, 0.4, 500), True),
        (0.2, (0.4, 1.2, 20), True),  # hardly a ray tells
        (0.01, (0.4, 1.2, 500), True),  # too low to be judged
    ],
)
def test_views_judge_high_bulges(monkeypatch, bulge, said, kept):
    monkeypatch.setattr(flatten, "disagreements", lambda *_: said)
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 51)] * 3, indexing="ij"), axis=-1)
    hull = Volume((0.3 - np.abs(grid - 0.5).max(axis=-1)).astype(np.float32), np.zeros(3), 0.02)
    lattice = Lattice(np.array([0.3, 0.3, 0.6]), *np.eye(3), 0.02, (20, 20))
    face = Face(lattice, np.ones((20, 20), bool), 0.001, bulge)
    assert flatten._agreeable(None, face, hull, hull.scene()) == kept


@pytest.mark.parametrize("high", [0.2, 0.01])
@pytest.mark.parametrize(
    ("side", "said", "kept"),
    [
        (8, (0.4, 1.2, 500), False),  # a wall went with it
        (8, (0.0, 0.0, 0), False),  # nobody sees there
        (8, (1.0, 0.4, 500), True),
        (2, (1.0, 0.4, 500), False),  # too small to be asked about
    ],
)
def test_a_face_keeps_no_spot_of_its_own_under_what_stands_beside_it(monkeypatch, side, said, kept, high):
    monkeypatch.setattr(flatten, "disagreements", lambda *_: said)
    x, y, z = np.moveaxis(np.stack(np.meshgrid(*[np.linspace(0, 1, 101)] * 3, indexing="ij"), axis=-1), -1, 0)
    base = np.minimum.reduce([0.4 - np.abs(x - 0.5), 0.4 - np.abs(y - 0.5), 0.2 - np.abs(z - 0.3)])
    boss = np.minimum.reduce([0.12 - np.hypot(x - 0.5, y - 0.5), 0.5 + high - z, z - 0.3])
    hull = Volume(np.maximum(base, boss).astype(np.float32), np.zeros(3), 0.01)
    lattice = Lattice(np.array([0.1, 0.1, 0.5]), *np.eye(3), 0.01, (80, 80))
    middle = np.linalg.norm(lattice.centers()[..., :2] - 0.5, axis=-1)
    spot = np.abs(lattice.centers()[..., :2] - 0.5).max(axis=-1) < side * 0.01 / 2
    face = Face(lattice, (middle > 0.14) | spot, 0.001, 0.2)
    left = flatten._without_spots(None, face, hull, hull.scene(), np.zeros((80, 80), int)).outline
    np.testing.assert_array_equal(left, (middle > 0.14) | (spot if kept or high < 0.02 else False))


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


@pytest.mark.parametrize(("said", "kept"), [((0.4, 1.2, 500), False), ((0, 0, 0), False), ((1.0, 0.4, 500), True)])
def test_a_wall_ends_at_a_rib_whose_edge_is_a_face_unless_views_tell(monkeypatch, said, kept):
    """A region may take the rib's side for the wall that it stands against; what is below its edge is asked alone."""
    monkeypatch.setattr(flatten, "disagreements", lambda *_: said)
    x, y, z = np.moveaxis(np.stack(np.meshgrid(*[np.linspace(0, 1, 101)] * 3, indexing="ij"), axis=-1), -1, 0)
    base = np.minimum.reduce([0.4 - np.abs(x - 0.5), 0.4 - np.abs(y - 0.5), 0.1 - np.abs(z - 0.2)])
    rib = np.minimum.reduce([y - 0.8, 0.9 - y, z - 0.1, x - 0.1, (1.0 - x - z) / np.sqrt(2)])
    hull = Volume(np.maximum(base, rib).astype(np.float32), np.zeros(3), 0.01)
    wall = Lattice(np.array([0.1, 0.1, 0.3]), *np.eye(3), 0.01, (80, 80))
    face = Face(wall, np.ones((80, 80), bool), 0.001, 0.6)
    slanted = np.array([[1, 0, -1], [0, 1, 0], [1, 0, 1]]) / np.array([[np.sqrt(2)], [1], [np.sqrt(2)]])
    edge = Lattice(np.array([0.1, 0.8, 0.9]), *slanted, 0.01, (84, 10))
    others = [face, Face(edge, np.ones((84, 10), bool), 0.001, 0.0)]
    below = 2 * flatten._below(face, others, 0.01)
    left = flatten._without_spots(None, face, hull, hull.scene(), below).outline
    foot = np.zeros((80, 80), bool)
    foot[1:56, 70:] = True  # x < .66: as high as tells
    np.testing.assert_array_equal(left[:, :69], True)
    assert (left[foot].mean() > 0.98) if kept else (left[foot].mean() < 0.02)


def test_the_other_side_of_a_groove_stands_when_a_face_is_cleared():
    """A shaft beyond a relief groove lies over the flange's face, and is no bulge of it."""
    spacing, grid = 0.01, np.stack(np.meshgrid(*[np.linspace(0, 1, 101)] * 3, indexing="ij"), axis=-1)
    away, height = np.hypot(grid[..., 0] - 0.5, grid[..., 1] - 0.5), grid[..., 2]

    def cylinder(radius: float, low: float, high: float):
        return np.minimum(radius - away, np.minimum(height - low, high - height))

    bulge = cylinder(0.3, 0.3, 0.34)  # what a hull has beside the groove
    field = np.max([cylinder(0.4, 0.1, 0.3), cylinder(0.15, 0.3, 0.36), cylinder(0.2, 0.36, 0.9), bulge], axis=0)
    hull = Volume(field.astype(np.float32), np.zeros(3), spacing)
    lattice = Lattice(np.array([0.0, 0.0, 0.3]), *np.eye(3), spacing, (100, 100))
    middles = lattice.centers()
    radius = np.hypot(middles[..., 0] - 0.5, middles[..., 1] - 0.5)
    face = Face(lattice, (radius > 0.16) & (radius < 0.39), 0.0, 0.06)
    cut = flatten._carve(hull, [face])
    angles = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    around = np.column_stack([np.cos(angles), np.sin(angles)])

    def at(radius: float, height: float):
        return np.column_stack([0.5 + radius * around, np.full(len(around), height)])

    assert hull.inside(at(0.25, 0.32)).all()
    assert not cut.inside(at(0.25, 0.32)).any()
    assert cut.inside(at(0.18, 0.38)).all()


def test_a_face_all_of_which_something_stands_on_clears_nothing():
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 41)] * 3, indexing="ij"), axis=-1)
    field = 0.4 - np.abs(grid - 0.5).max(axis=-1)
    hull = Volume(field.astype(np.float32), np.zeros(3), 0.025)
    lattice = Lattice(np.array([0.25, 0.25, 0.3]), *np.eye(3), 0.025, (20, 20))
    face = Face(lattice, np.ones((20, 20), bool), 0.0, 0.1)  # within the block
    np.testing.assert_array_equal(flatten._carve(hull, [face]).field, hull.field)
