"""Concavities: the geometry of a prism, and pockets of a rendered part that every silhouette is blind to."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.artifacts.truth import read_truth
from brepgaussian.artifacts.views import read_views
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.splatting.concave import Prism
from brepgaussian.splatting.concave.agreement import disagreements
from brepgaussian.splatting.concave.find import _hangs
from brepgaussian.splatting.concave.join import joined
from brepgaussian.splatting.concave.leaning import to_best_dome
from brepgaussian.splatting.concave.openings import Images, Stack, openings
from brepgaussian.splatting.concave.planes import Plane, planar_regions
from brepgaussian.splatting.concave.prism import Lattice
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.shapes import Shape
from brepgaussian.splatting.hull import carve
from brepgaussian.views.stage import make_views


def box_prism(through=False):
    """An opening of 0.2 x 0.1 in the plane z = 0.5, 0.3 deep."""
    lattice = Lattice(np.array([0.3, 0.3, 0.5]), *np.eye(3), 0.01, (40, 30))
    outline = np.zeros((40, 30), bool)
    outline[10:30, 10:20] = True
    return Prism(lattice, outline, 0.3, through, 0.0)


def test_signed_distance_of_a_prism_is_that_of_its_box():
    prism = box_prism()
    points = np.random.default_rng(3).uniform([0.25, 0.25, 0.1], [0.75, 0.65, 0.6], (500, 3))
    low, high = np.array([0.4, 0.4, 0.2]), np.array([0.6, 0.5, 0.52])  # reaches .02 above the opening
    inside = ((points > low) & (points < high)).all(axis=1)
    clear = np.abs(np.concatenate([points - low, points - high], axis=1)).min(axis=1) > 0.006  # half a cell
    assert np.array_equal((prism.signed_distance(points, 0.02) < 0)[clear], inside[clear])
    assert prism.area == pytest.approx(0.02)


def test_a_prism_that_goes_through_is_open_at_its_end():
    below = np.array([[0.5, 0.45, 0.19]])
    assert box_prism().signed_distance(below, 0.02)[0] > 0
    assert box_prism(through=True).signed_distance(below, 0.02)[0] < 0


@pytest.mark.parametrize(("interreflection", "bound"), [(0.0, 0.02), (0.9, 0.01)])
def test_blind_pockets_are_opened_down_to_their_floors(tmp_path, interreflection, bound):
    settings = ViewsSettings(rendered_views=30, image_size=400, interreflection=interreflection)
    files = {"out_views": tmp_path / "views.h5", "out_truth": tmp_path / "truth.h5"}
    make_views(object_name="plate", source="part", path="pocket_plate:5", settings=settings, **files)
    views, truth = read_views(files["out_views"]), read_truth(files["out_truth"])
    planes = [f for f, kind in enumerate(truth.face_types) if kind == "plane"]
    normal = np.array([0.0, 0.0, 1.0])
    up = [f for f in planes if (truth.normals[truth.point_face == f] @ normal).mean() > 0.99]
    heights = {f: truth.points[truth.point_face == f][:, 2].mean() for f in up}
    floors = np.isin(truth.point_face, [f for f in up if heights[f] < max(heights.values()) - 0.01])

    def distance(concavities):
        hull, _ = carve(views, 96, 1, concavities)
        scene = Scene(hull.vertices, hull.triangles)
        return float(np.mean(np.abs(scene.signed_distance(truth.points[floors]))))

    assert floors.any()
    assert distance(False) > 0.04
    assert distance(True) < bound


@pytest.mark.parametrize(
    ("turn", "height", "taken"), [(0.0, 0.502, True), (0.02, 0.502, True), (0.2, 0.502, False), (0.0, 0.53, False)]
)
def test_a_region_that_bulges_takes_the_plane_of_its_face(turn, height, taken):
    """A face with a bulge over a third of it, which turns the plane that fits it."""
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 41), indexing="ij"))
    vertices = np.column_stack([x, y, 0.5 + 0.006 * np.clip(y - 0.6, 0, 1)])
    corner = (np.arange(40)[:, None] * 41 + np.arange(40)).ravel()
    triangles = np.concatenate([np.column_stack([corner, corner + a, corner + b]) for a, b in ((41, 42), (42, 1))])
    (region,) = planar_regions(vertices, triangles, 0.01)
    face = Plane(
        np.array([np.sin(turn), 0, np.cos(turn)]), np.array([0.5, 0.5, height]) @ [np.sin(turn), 0, np.cos(turn)]
    )
    other = Plane(np.array([0, 0, -1.0]), -height)
    on = region.on([other, face], vertices, triangles, 0.01)
    assert np.array_equal(on.triangles, region.triangles)
    assert (on.normal is face.normal and on.offset == face.offset) == taken
    assert taken or on is region


def test_what_is_left_of_a_lid_below_a_known_plane_does_not_turn_its_region():
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 41), indexing="ij"))
    vertices = np.column_stack([x, y, np.where((x > 0.6) & (np.abs(y - 0.5) < 0.2), 0.485, 0.5)])
    corner = (np.arange(40)[:, None] * 41 + np.arange(40)).ravel()
    triangles = np.concatenate([np.column_stack([corner, corner + a, corner + b]) for a, b in ((41, 42), (42, 1))])
    face = Plane(np.array([0, 0, 1.0]), 0.5)
    alone, known = (planar_regions(vertices, triangles, 0.02, planes)[0] for planes in ((), (face,)))
    assert alone.normal @ face.normal < 0.9999
    assert known.normal is face.normal
    flat = np.flatnonzero((vertices[triangles][..., 2] == 0.5).all(axis=1))
    assert np.isin(flat, known.triangles).all()


@pytest.mark.parametrize(("turn", "taken"), [(0.002, True), (0.022, False)])
def test_two_faces_on_one_plane_do_not_take_the_turned_plane_of_one_of_them(turn, taken):
    """Feet on both sides of a gap; the plane passes through the middle of both, and through the first."""
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 41), indexing="ij"))
    vertices = np.column_stack([x, y, np.full(len(x), 0.3)])
    corner = (np.arange(40)[:, None] * 41 + np.arange(40)).ravel()
    corner = corner[np.abs(x[corner] - 0.5) > 0.25]
    triangles = np.concatenate([np.column_stack([corner, corner + a, corner + b]) for a, b in ((41, 42), (42, 1))])
    (region,) = planar_regions(vertices, triangles, 0.01)
    normal = np.array([np.sin(turn), 0, np.cos(turn)])
    of_one = Plane(normal, float(np.array([0.55, 0.5, 0.3]) @ normal))
    on = region.on([of_one], vertices, triangles, 0.01)
    assert (on.normal is of_one.normal) == taken
    assert taken or on is region


@pytest.mark.parametrize("turn", [0.0, 0.08, 0.2])
def test_a_strip_of_a_shaft_bends_by_the_angle_that_it_covers(turn):
    x, t = (v.ravel() for v in np.meshgrid(np.linspace(0, 0.4, 41), np.linspace(-0.5, 0.5, 41), indexing="ij"))
    radius = 0.2 / turn if turn else np.inf
    y, z = (radius * np.sin(turn * t), radius * np.cos(turn * t) - radius) if turn else (0.2 * t, 0 * t)
    corner = (np.arange(40)[:, None] * 41 + np.arange(40)).ravel()
    triangles = np.concatenate([np.column_stack([corner, corner + a, corner + b]) for a, b in ((41, 42), (42, 1))])
    (region,) = planar_regions(np.column_stack([x, y, z]), triangles, 0.01)
    assert region.bend == pytest.approx(turn, rel=0.05, abs=1e-6)


def test_a_ring_shaped_opening_keeps_its_island():
    rows, columns = np.mgrid[:120, :110]
    radius = np.hypot(rows - 60, columns - 55)
    ring = (radius > 20) & (radius < 40)
    shown = np.zeros((20, 120, 110), np.uint8)  # the lid's grey
    shown[::3, ring] = 1  # a third of the views see something else
    stack = Stack(
        Lattice(np.zeros(3), *np.eye(3), 0.005, ring.shape),
        np.ones(ring.shape, bool),
        shown,
        shown * 1.0,
        np.zeros(ring.shape),
    )
    found = openings(stack, 0.001)
    overlap = [(o & ring).sum() / (o | ring).sum() for o in found]
    assert max(overlap) > 0.9
    assert any(o[60, 55] for o in found)  # the disc is a hypothesis as well


def ray_prism(draft=0.0, sink=np.inf, through=False, endless=False, up=1.0, height=0.5, radius=12):
    """A round opening around (.5, .5) in the plane z = height that looks up or down."""
    normal = np.array([0.0, 0.0, up])
    first, second = np.array([1.0, 0.0, 0.0]), np.array([0.0, up, 0.0])
    origin = np.array([0.3, 0.5 - 0.2 * up, height])
    rows, columns = np.mgrid[:40, :40]
    outline = np.hypot(rows - 19.5, columns - 19.5) < radius
    lattice = Lattice(origin, first, second, normal, 0.01, (40, 40))
    return Prism(lattice, outline, 0.3, through, 0.0, draft=draft, sink=sink, endless=endless)


def test_a_countersunk_prism_is_its_cone_and_its_throat():
    prism = ray_prism(draft=1.0, sink=0.05)
    points = np.random.default_rng(4).uniform([0.35, 0.35, 0.15], [0.65, 0.65, 0.55], (4000, 3))
    radius, depth = np.hypot(*(points[:, :2] - 0.5).T), 0.5 - points[:, 2]
    allowed = 0.12 - np.clip(depth, 0, 0.05)
    inside = (radius < allowed) & (depth < 0.3) & (depth > -0.02)
    clear = (np.abs(radius - allowed) > 0.01) & (np.abs(depth - 0.3) > 0.01) & (np.abs(depth + 0.02) > 0.01)
    assert np.array_equal((prism.signed_distance(points, 0.02) < 0)[clear], inside[clear])


@pytest.mark.parametrize(("draft", "sink", "depth"), [(0.0, np.inf, 0.08), (0.0, np.inf, 0.25), (0.8, 0.04, 0.12)])
def test_a_domed_prism_is_its_walls_and_a_spherical_cap(draft, sink, depth):
    prism = replace(ray_prism(draft, sink), depth=depth, domed=True)
    wide = np.sqrt(prism.area / np.pi)  # of a circle of as many cells
    throat, top = (wide - sink, sink / draft) if draft else (wide, 0.0)
    high = min(depth - top, throat)
    sphere = (throat**2 + high**2) / (2 * high)
    points = np.random.default_rng(5).uniform([0.35, 0.35, 0.2], [0.65, 0.65, 0.55], (4000, 3))
    radius, deep = np.hypot(*(points[:, :2] - 0.5).T), 0.5 - points[:, 2]
    walls = wide - np.clip(deep, 0, top) * draft
    cap = sphere - np.hypot(radius, deep - depth + sphere)  # positive within
    inside = (radius < walls) & (deep > -0.02) & ((deep < depth - high) | (cap > 0))
    clear = (np.abs(radius - walls) > 0.01) & (np.abs(deep + 0.02) > 0.01) & (np.abs(cap) > 0.004)
    assert np.array_equal((prism.signed_distance(points, 0.02) < 0)[clear], inside[clear])


def test_a_recess_around_a_hub_goes_before_one_under_it():
    whole = replace(ray_prism(), error=0.16)
    rows, columns = np.mgrid[:40, :40]
    ring = whole.outline & (np.hypot(rows - 19.5, columns - 19.5) > 5)
    around = replace(whole, outline=ring, above=0.05, error=0.1)
    assert _hangs(whole, around)
    assert not _hangs(replace(whole, error=0.05), around)  # the views like it better
    beside = replace(whole, outline=np.roll(whole.outline, 20, axis=0))
    assert not _hangs(beside, around)


def test_two_endless_openings_that_face_each_other_are_one_hole():
    ends = [ray_prism(endless=True), ray_prism(endless=True, up=-1.0, height=0.1, radius=11)]
    first, second = joined(ends, 0.01)
    assert second.through
    assert second.depth == pytest.approx(0.4)
    assert not first.through
    floors = [ray_prism(), ray_prism(up=-1.0, height=0.1, radius=11)]  # both tell a floor: a web is between them
    assert joined(floors, 0.01) == floors
    aside = [
        ray_prism(endless=True),
        replace(ends[1], lattice=replace(ends[1].lattice, origin=np.array([0.4, 0.7, 0.1]))),
    ]
    assert joined(aside, 0.01) == aside


def test_the_narrower_end_of_a_hole_is_its_width():
    wide, narrow = ray_prism(through=True, radius=15), ray_prism(through=True, up=-1.0, height=0.2)
    rim, hole = joined([wide, narrow], 0.01)
    assert hole is narrow
    assert not rim.through
    assert rim.depth == 0
    chamfered = ray_prism(through=True, radius=17, draft=1.0, sink=0.02)
    rim, hole = joined([chamfered, narrow], 0.01)
    assert rim.depth == pytest.approx(0.05, abs=0.006)  # from a radius of .17 to the other's .12


def views_of(tmp_path, part, count=40, size=500):
    """Views and truth of a bundled part."""
    files = {"out_views": tmp_path / "views.h5", "out_truth": tmp_path / "truth.h5"}
    settings = ViewsSettings(rendered_views=count, image_size=size)
    make_views(object_name="part", source="part", path=part, settings=settings, **files)
    return read_views(files["out_views"]), read_truth(files["out_truth"])


def distances(views, truth, face):
    """Mean distance of a true face to the hull, closed and opened."""
    points = truth.points[truth.point_face == face]
    hulls = [carve(views, 120, 1, concavities)[0] for concavities in (False, True)]
    return [float(np.abs(Scene(h.vertices, h.triangles).signed_distance(points)).mean()) for h in hulls]


def test_the_countersink_of_a_dome_is_sought_with_its_throat_and_depth():
    true = Shape(28.0, grow=1.0, draft=0.85, sink=6.0, domed=True)

    def cost(shape):
        names = ("depth", "grow", "draft", "sink")
        return sum((getattr(shape, n) / getattr(true, n) - 1) ** 2 for n in names)

    start = Shape(26.0, grow=0.0, draft=1.2, sink=4.0, domed=True)  # as few rays chose it
    found = to_best_dome(SimpleNamespace(middle=(0, 25.0), cost=cost), [start])
    assert found.draft == pytest.approx(true.draft, rel=0.05)
    assert (found.depth, found.grow, found.sink) == pytest.approx((28.0, 1.0, 6.0), abs=0.5)


def test_a_spherical_seat_is_domed(tmp_path):
    """A countersunk spherical hollow, which no silhouette shows, with a hole through its pole."""
    views, truth = views_of(tmp_path, "seat_block:4")
    (sphere,) = [f for f, kind in enumerate(truth.face_types) if kind == "sphere"]
    closed, opened = distances(views, truth, sphere)
    assert closed > 0.05
    assert opened < 0.006  # .0127 as a cone with a flat floor


def test_a_cross_hole_in_a_shaft_is_opened(tmp_path):
    """Most of a cross hole's wall is hidden from every silhouette; its mouth lies on a cylinder."""
    views, truth = views_of(tmp_path, "d_shaft:3")
    areas = {f: (truth.point_face == f).sum() for f, kind in enumerate(truth.face_types) if kind == "cylinder"}
    closed, opened = distances(views, truth, min(areas, key=areas.get))
    assert closed > 0.015
    assert opened < closed / 3


def test_a_port_ends_in_its_pocket(tmp_path):
    """A port through one wall shows background by way of the pocket."""
    views, truth = views_of(tmp_path, "pocket_housing:4")
    hull, _ = carve(views, 100, 1, True)
    distance = np.abs(Scene(hull.vertices, hull.triangles).signed_distance(truth.points))
    by_face = {f: distance[truth.point_face == f] for f in range(len(truth.face_types))}
    planes = [f for f, kind in enumerate(truth.face_types) if kind == "plane"]
    outer = [f for f in planes if np.ptp(truth.points[truth.point_face == f], axis=0).max() > 0.9]
    assert len(outer) >= 4
    assert max(np.quantile(by_face[f], 0.98) for f in outer) < 0.01  # no hole in the wall behind the pocket


def test_surfaces_that_no_place_tells_of_are_not_told_apart(tmp_path):
    views, _ = views_of(tmp_path, "block_hole:2", 8, 120)
    hull, _ = carve(views, 48, 1)
    middle = hull.vertices.mean(axis=0)
    scene, smaller = (Scene(middle + s * (hull.vertices - middle), hull.triangles) for s in (1.0, 0.98))
    images = Images.of(views)
    old, new, count = disagreements(images, scene, smaller, 0.5)  # no ray differs that much
    assert (old, new, count) == (0.0, 0.0, 0)


def test_a_keyway_longer_than_its_cylinder_is_wide_is_opened(tmp_path):
    """The face around a keyway is looked at as far as the keyway is wide, not as far as it is long."""
    views, truth = views_of(tmp_path, "keyway_journal:3")
    shares = np.bincount(truth.point_face)
    planes = [f for f, kind in enumerate(truth.face_types) if kind == "plane"]
    planes = [f for f in planes if abs(truth.normals[truth.point_face == f][0, 0]) > 0.99]
    closed, opened = distances(views, truth, max(planes, key=lambda f: shares[f]))
    assert closed > 0.04
    assert opened < closed / 8
