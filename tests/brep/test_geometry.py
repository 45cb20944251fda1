"""Charts, sheets, borders and caps against analytic answers."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.brep.borders import border_points, continuing, open_points
from brepgaussian.brep.caps import find_caps
from brepgaussian.brep.chart import TURN, chart_of, largest_gap
from brepgaussian.brep.patches import Patch, make_patches
from brepgaussian.brep.sheets import make_sheet, octagon
from brepgaussian.brep.tidy import tidy
from brepgaussian.geometry.surfaces import cone, cylinder, plane, sphere, torus
from hypothesis import given, settings
from hypothesis import strategies as st

Z = np.array([0.0, 0.0, 1.0])
SURFACES = [
    plane([0.2, 0.3, 0.4], [1, 2, 3]),
    cylinder([0.2, 0.3, 0.4], [1, -2, 3], 0.3),
    sphere([0.5, 0.5, 0.5], 0.4),
    cone([0.2, 0.3, 0.4], [1, 2, -3], 0.3, 0.5),
    torus([0.2, 0.3, 0.4], [0, 2, 3], 0.3, 0.1),
]


def patch_of(surface, xyz, reach=0.02):
    return Patch(surface, 0, xyz, surface.normals(xyz).copy(), reach, 0.0)


@pytest.mark.parametrize("surface", SURFACES, ids=lambda s: s.kind)
@given(seed=st.integers(0, 10_000))
@settings(max_examples=10, deadline=None)
def test_chart_inverts_itself_and_lies_on_the_surface(surface, seed):
    points = surface.project(np.random.default_rng(seed).random((20, 3)))
    if surface.kind == "cone":  # points beyond the apex project to the other nappe, which is no part of the face
        points = points[surface.radius + (points - surface.origin) @ surface.axis * np.tan(surface.angle) > 0]
    chart = chart_of(surface)
    uv = chart.parameters(points)
    np.testing.assert_allclose(chart.evaluate(uv[:, 0], uv[:, 1]), points, atol=1e-9)


@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=8, max_size=40), st.floats(0.001, 0.2))
@settings(max_examples=40, deadline=None)
def test_octagon_keeps_the_margin(points, margin):
    uv = np.array(points)
    polygon = octagon(uv, margin)
    following = np.roll(polygon, -1, axis=0)
    side = following - polygon
    inward = np.column_stack([-side[:, 1], side[:, 0]]) / np.linalg.norm(side, axis=1)[:, None]
    depth = np.einsum("kd,nkd->nk", inward, uv[:, None] - polygon)
    assert depth.min() >= margin - 1e-9


def test_largest_gap_wraps():
    middle, width = largest_gap(np.array([0.5, 1.0, 6.0]))
    assert width == pytest.approx(5.0)
    assert middle == pytest.approx(3.5)


def test_fillet_ends_exactly_where_it_is_tangent():
    rng = np.random.default_rng(0)
    angle = rng.uniform(np.pi, 1.5 * np.pi, 800)  # a quarter between x = 0 and y = 0
    xyz = np.column_stack([0.2 + 0.2 * np.cos(angle), 0.2 + 0.2 * np.sin(angle), rng.random(800)])
    fillet = cylinder([0.2, 0.2, 0.0], Z, 0.2)
    walls = rng.random((600, 3))
    left, down = walls.copy(), walls.copy()
    left[:, 0], left[:, 1] = 0, 0.2 + 0.8 * left[:, 1]
    down[:, 1], down[:, 0] = 0, 0.2 + 0.8 * down[:, 0]
    patches = [
        patch_of(fillet, xyz),
        patch_of(plane([0, 0, 0], [-1, 0, 0]), left),
        patch_of(plane([0, 0, 0], [0, -1, 0]), down),
    ]  # fmt: skip
    sheet = make_sheet(0, patches, 0.04)
    ends = sheet.chart.evaluate(np.array(sheet.limits[:2]), np.array([0.5, 0.5]))
    touching = {tuple(np.round(e[:2], 7)) for e in ends}
    assert touching == {(0.0, 0.2), (0.2, 0.0)}
    assert sheet.limits[2] < 0
    assert sheet.limits[3] > 1


def quarter_and_wall(down_to):
    """A rounding of 90 degrees whose points end after 50, and the wall that it touches, without its first part."""
    rng = np.random.default_rng(0)
    angle = rng.uniform(np.pi, np.pi + np.radians(50), 800)
    xyz = np.column_stack([0.2 + 0.2 * np.cos(angle), 0.2 + 0.2 * np.sin(angle), rng.random(800)])
    wall = rng.random((600, 3))
    wall[:, 1], wall[:, 0] = 0, down_to + (1 - down_to) * wall[:, 0]
    rounding = patch_of(cylinder([0.2, 0.2, 0.0], Z, 0.2), xyz)
    return [rounding, patch_of(plane([0, 0, 0], [0, -1, 0]), wall)]


def test_an_extended_rounding_ends_where_the_extended_wall_touches_it():
    patches = quarter_and_wall(0.5)
    assert make_sheet(0, patches, 0.04, {0}).limits[1] == TURN  # nothing is known of what lies beyond
    sheet = make_sheet(0, patches, 0.04, {0, 1})
    end = sheet.chart.evaluate(np.array(sheet.limits[1:2]), np.array([0.5]))[0]
    np.testing.assert_allclose(end, [0.2, 0.0, end[2]], atol=1e-7)
    touched = make_sheet(1, quarter_and_wall(0.25), 0.04, {0, 1})
    x = touched.chart.evaluate(*touched.polygon.T)[:, 0]
    assert x.min() == pytest.approx(0.2, abs=1e-9)


@pytest.mark.parametrize(("missing", "found"), [(False, []), (True, [2])])
def test_half_a_chamfer_goes_on_where_its_neighbours_are_open(missing, found):
    rng = np.random.default_rng(4)
    angle, height = rng.uniform(0, TURN, 9000), rng.random(9000)
    side = np.column_stack([0.3 * np.cos(angle), 0.3 * np.sin(angle), 0.3 * height])
    top = 0.28 * np.sqrt(height)
    lid = np.column_stack([top * np.cos(angle), top * np.sin(angle), np.full(9000, 0.32)])
    edge = 0.3 - 0.02 * height[:800]
    turn = angle[:800] / 2 if missing else angle[:800]
    slope = np.column_stack([edge * np.cos(turn), edge * np.sin(turn), 0.6 - edge])
    bottom = lid * [1, 1, 0]
    patches = [
        patch_of(cylinder(np.zeros(3), Z, 0.3), side, 0.02),
        patch_of(plane([0, 0, 0.32], Z), lid, 0.02),
        patch_of(cone([0, 0, 0.3], -Z, 0.3, np.pi / 4), slope, 0.02),
        patch_of(plane(np.zeros(3), -Z), bottom, 0.02),
    ]
    borders = open_points(patches)
    assert not len(borders[2])
    assert continuing(patches, borders) == found


def test_most_of_a_turn_is_a_full_turn_with_its_seam_in_the_gap():
    angle = np.linspace(0.5, TURN - 0.5, 2000)
    xyz = np.column_stack([0.3 * np.cos(angle), 0.3 * np.sin(angle), np.tile([0, 0.5], 1000)])
    sheet = make_sheet(0, [patch_of(cylinder(np.zeros(3), Z, 0.3), xyz)], 0.04)
    assert sheet.limits[:2] == (0.0, TURN)
    np.testing.assert_allclose(sheet.chart.x, [1, 0, 0], atol=1e-6)


def test_border_points_lie_on_the_border():
    xyz = np.column_stack([np.random.default_rng(1).random((3000, 2)), np.zeros(3000)])
    patches = [patch_of(plane(np.zeros(3), Z), xyz, reach=0.025)]
    depth = np.minimum(xyz[:, :2], 1 - xyz[:, :2]).min(axis=1)
    found = np.isin(np.arange(3000), border_points(patches[0]))
    assert depth[found].max() < 0.04
    assert found[depth < 0.002].mean() > 0.9


@pytest.mark.parametrize("missing", [0, 3, 5])
def test_a_missing_side_of_a_box_is_guessed(kit, missing):
    known = kit.block_with_hole(sigma=0.002, radius=0.0, count=15000, seed=missing)
    items = [p for i, p in enumerate(known.primitives.items) if i != missing]
    patches = make_patches(items, known.points, 0.05)
    caps = find_caps(patches, open_points(patches), seed=0)
    truth = known.primitives.items[missing].surface
    best = min(caps, key=lambda c: np.abs(truth.signed_distance(c.xyz)).max())
    assert np.abs(truth.signed_distance(best.xyz)).max() < 0.01
    assert best.surface.axis @ truth.axis > 1 - 1e-9


def test_a_missing_bore_is_guessed(kit):
    known = kit.block_with_hole(sigma=0.002, count=15000, seed=2)
    patches = make_patches(known.primitives.items[:6], known.points, 0.05)
    caps = find_caps(patches, open_points(patches), seed=0)
    assert [c.surface.kind for c in caps] == ["cylinder"]
    surface = caps[0].surface
    assert surface.flipped
    assert surface.radius == pytest.approx(0.2, abs=0.01)
    np.testing.assert_allclose(surface.origin[:2], 0.5, atol=0.01)


def test_nothing_is_open_on_a_whole_box(kit):
    known = kit.block_with_hole(sigma=0.002, count=15000, seed=4)
    patches = make_patches(known.primitives.items, known.points, 0.05)
    assert sum(len(b) for b in open_points(patches)) == 0


@pytest.mark.parametrize(("through", "corner"), [(False, 0.2), (True, 0.0)])
def test_a_wall_ends_where_a_fillet_takes_over_unless_it_goes_on_elsewhere(through, corner):
    """A wall x = 0 above y = .2, from where a fillet touches it; if `through`, it goes on beside the fillet."""
    rng = np.random.default_rng(0)
    angle = rng.uniform(np.pi, 1.5 * np.pi, 800)
    xyz = np.column_stack([0.2 + 0.2 * np.cos(angle), 0.2 + 0.2 * np.sin(angle), 0.5 * rng.random(800)])
    wall = np.column_stack([np.zeros(4000), rng.random((4000, 2))])
    beyond = wall[:, 1] < 0.2
    wall = wall[~beyond | (through & (wall[:, 2] > 0.5))]
    patches = [patch_of(cylinder([0.2, 0.2, 0.0], Z, 0.2), xyz), patch_of(plane([0, 0, 0], [-1, 0, 0]), wall)]
    sheet = make_sheet(1, patches, 0.04)
    corners = sheet.chart.evaluate(*sheet.polygon.T)
    if through:
        assert corners[:, 1].min() < corner - 0.04
    else:
        assert corners[:, 1].min() == pytest.approx(corner, abs=1e-12)
    assert corners[:, 1].max() > 1.04


def test_tidy_joins_one_cylinder_found_twice_but_not_two_steps():
    rng = np.random.default_rng(0)
    angle, height = rng.random(600) * TURN, rng.random(600)
    xyz = np.column_stack([0.3 * np.cos(angle), 0.3 * np.sin(angle), height]) + 0.001 * rng.normal(size=(600, 3))
    low, high = height < 0.5, height >= 0.5
    one, two = cylinder(np.zeros(3), Z, 0.3), cylinder([0.002, 0, 0], [0.005, 0, 1], 0.301)
    step = np.column_stack([rng.random((600, 2)), np.zeros(600)])
    planes = [plane([0, 0, z], Z) for z in (0.0, 0.01)]
    patches = [Patch(one, 0, xyz[low], one.normals(xyz[low]), 0.02, 0.001)]
    patches += [Patch(two, 1, xyz[high], two.normals(xyz[high]), 0.02, 0.001)]
    patches += [Patch(p, 2 + i, step + p.origin, p.normals(step).copy(), 0.02, 0.001) for i, p in enumerate(planes)]
    result = tidy(patches, 0.0005)
    assert [p.surface.kind for p in result] == ["cylinder", "plane", "plane"]
    assert len(result[0].xyz) == 600


def test_tidy_keeps_a_small_face_beside_exact_ones():
    """Where most points are exact to rounding, one wrong label makes a small face's residual many times theirs."""
    rng = np.random.default_rng(0)
    side = np.column_stack([rng.random((2000, 2)), np.zeros(2000)])
    walls = [side[:, [0, 1, 2]], side[:, [0, 2, 1]], side[:, [2, 0, 1]]]
    surfaces = [plane(np.zeros(3), normal) for normal in (Z, np.array([0, 1.0, 0]), np.array([1.0, 0, 0]))]
    patches = [
        Patch(f, i, w, f.normals(w).copy(), 0.02, 1e-12) for i, (f, w) in enumerate(zip(surfaces, walls, strict=True))
    ]
    small = Patch(plane([0, 0, 0.5], Z), 3, walls[0][:20] * 0.1 + [0, 0, 0.5], np.tile(Z, (20, 1)), 0.02, 1e-5)
    assert [p.primitive for p in tidy([*patches, small], 0.0005)] == [0, 1, 2, 3]
    poor = replace(small, sigma=0.002)
    assert [p.primitive for p in tidy([*patches, poor], 0.0005)] == [0, 1, 2]
    assert [p.primitive for p in tidy([*patches, poor], 0.0005, all_of_them=True)] == [0, 1, 2, 3]


def test_an_extended_torus_goes_all_the_way_round():
    surface = torus(np.full(3, 0.5), np.array([0, 0, 1.0]), 0.3, 0.1)
    u, v = np.meshgrid(np.linspace(0, 2, 40), np.linspace(2.0, 5.5, 30))
    xyz = chart_of(surface).evaluate(u.ravel(), v.ravel())
    patch = Patch(surface, 0, xyz, surface.normals(xyz).copy(), 0.01, 1e-3)
    sheet = make_sheet(0, [patch], 0.04, {0})
    np.testing.assert_allclose(np.diff(sheet.limits)[[0, 2]], 2 * np.pi, atol=1e-12)
    part = make_sheet(0, [patch], 0.04)
    assert np.diff(part.limits)[2] < 5.5
