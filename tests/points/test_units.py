"""The parts of the stage against slow references and exact answers."""

import itertools

import numpy as np
import pytest
from brepgaussian.artifacts.stage1 import Surfels
from brepgaussian.geometry import surfaces
from brepgaussian.points import batchfit, pearl, simulate
from brepgaussian.points.batch_rows import evaluate
from brepgaussian.points.batchfit import Noise, Sets
from brepgaussian.points.bridges import joined
from brepgaussian.points.curves import Curve, find_curves, project
from brepgaussian.points.densify import densify
from brepgaussian.points.graph import components, neighbour_pairs, spacing_of, thin
from brepgaussian.points.shading import fit_shading, gradients
from brepgaussian.points.snap import believed
from brepgaussian.points.superpoints import contract
from brepgaussian.points.votes import agreement, interior, nan_median
from brepgaussian.settings.points import PointsSettings
from hypothesis import given, settings
from hypothesis import strategies as st


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def some_surfels(count, rng, scales=None):
    normals = unit(rng.normal(size=(count, 3)))
    scales = np.full((count, 2), 0.01) if scales is None else scales
    f = np.float32
    return Surfels(
        rng.random((count, 3)).astype(f), simulate._quaternions(normals).astype(f), scales.astype(f),
        np.full(count, 0.9, f), np.zeros((count, 3), f), np.zeros(count, f),
    )  # fmt: skip


def test_densify_gives_centre_and_four_points_on_the_ellipse_but_slivers_only_their_centre():
    scales = np.array([[0.01, 0.02], [0.001, 0.1], [0.03, 0.01]])
    surfels = some_surfels(3, np.random.default_rng(1), scales)
    samples = densify(surfels, PointsSettings(minimum_points=0))
    assert np.bincount(samples.surfel).tolist() == [5, 1, 5]
    np.testing.assert_allclose(samples.xyz[:3], surfels.centers, atol=1e-7)
    offset = samples.xyz - surfels.centers[samples.surfel]
    local = np.einsum("nij,ni->nj", surfels.axes[samples.surfel], offset)[3:]
    on_ellipse = ((local[:, :2] / scales[samples.surfel[3:]]) ** 2).sum(1)
    np.testing.assert_allclose(on_ellipse, 1, atol=1e-3)
    np.testing.assert_allclose(local[:, 2], 0, atol=1e-6)


def test_densify_fills_up_inside_the_ellipses_in_proportion_to_area():
    scales = np.array([[0.01, 0.01], [0.02, 0.02]])
    surfels = some_surfels(2, np.random.default_rng(2), scales)
    samples = densify(surfels, PointsSettings(minimum_points=1000))
    assert len(samples) == 1000
    counts = np.bincount(samples.surfel)
    assert counts[1] / counts[0] == pytest.approx(4, rel=0.1)
    local = np.einsum("nij,ni->nj", surfels.axes[samples.surfel], samples.xyz - surfels.centers[samples.surfel])
    assert ((local[:, :2] / scales[samples.surfel]) ** 2).sum(1).max() < 1.001


def test_without_densification_only_centres():
    assert len(densify(some_surfels(7, np.random.default_rng(0)), PointsSettings(densify=False))) == 7


def test_thin_is_even_and_close_to_the_count():
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.random((20000, 2)), np.zeros(20000)])
    points[:15000, 0] *= 0.5  # denser on one side
    chosen = points[thin(points, 2000)]
    assert 1800 < len(chosen) < 2200
    left = (chosen[:, 0] < 0.5).mean()
    assert 0.45 < left < 0.55


@pytest.mark.parametrize("count", [1, 2, 3])
def test_graph_of_few_points(count):
    points = np.zeros((count, 3))
    pairs, distance = neighbour_pairs(points, np.tile([0, 0, 1.0], (count, 1)), 12)
    assert len(pairs) == len(distance)
    assert spacing_of(points) > 0


def test_neighbours_leave_out_the_other_side_of_a_thin_wall():
    rng = np.random.default_rng(0)
    flat = np.column_stack([rng.random((400, 2)), np.zeros(400)])
    points = np.concatenate([flat, flat + np.array([0, 0, 0.002])])
    normals = np.repeat([[0, 0, -1.0], [0, 0, 1.0]], 400, axis=0)
    pairs, _ = neighbour_pairs(points, normals, 10)
    assert len(pairs)
    assert ((pairs < 400).all(1) | (pairs >= 400).all(1)).all()
    assert set(components(pairs, np.zeros(800, int))[:400]).isdisjoint(components(pairs, np.zeros(800, int))[400:])


def test_contract_keeps_two_planes_apart_and_each_whole():
    rng = np.random.default_rng(4)
    flat = np.column_stack([rng.random((300, 2)), np.zeros(300)])
    points = np.concatenate([flat, flat[:, [2, 1, 0]]])
    normals = np.repeat([[0, 0, 1.0], [1.0, 0, 0]], 300, axis=0)
    pairs, _ = neighbour_pairs(points, normals, 10)
    angle = np.arccos(np.clip((normals[pairs[:, 0]] * normals[pairs[:, 1]]).sum(1), -1, 1))
    parts = contract(pairs, 1 - angle, normals, np.cos(0.2))
    assert len(set(parts[:300])) == 1
    assert len(set(parts[300:])) == 1
    assert parts[0] != parts[300]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 7))
def test_expansion_move_is_the_best_of_all_subsets(seed, count):
    rng = np.random.default_rng(seed)
    data = rng.random((count, 3)) * 2
    pairs = np.array(list(itertools.combinations(range(count), 2)))
    weights = np.round(rng.random(len(pairs)) * (rng.random(len(pairs)) < 0.7), 3)
    labels = rng.integers(0, 3, count)
    best = min(
        pearl.energy(data, pairs, weights, np.where(np.array(choice), 1, labels))
        for choice in itertools.product([False, True], repeat=count)
    )
    found = pearl.expand(data, pairs, weights, labels, 1, reach=1e3)
    assert pearl.energy(data, pairs, weights, found) == pytest.approx(best, abs=0.001 * (count + len(pairs)))


def test_alpha_expansion_never_raises_the_energy():
    rng = np.random.default_rng(5)
    data, labels = rng.random((60, 4)), rng.integers(0, 4, 60)
    pairs = np.array([(i, i + 1) for i in range(59)])
    weights = np.full(59, 0.4)
    found = pearl.alpha_expansion(data, pairs, weights, labels, reach=10)
    assert pearl.energy(data, pairs, weights, found) < pearl.energy(data, pairs, weights, labels)


SURFACES = [
    surfaces.plane(np.array([0.4, 0.5, 0.6]), np.array([1.0, 2, 3])),
    surfaces.cylinder(np.array([0.5, 0.4, 0.5]), np.array([0.3, 1, 0.2]), 0.2),
    surfaces.cylinder(np.array([0.5, 0.4, 0.5]), np.array([0.3, 1, 0.2]), 0.05, flipped=True),
    surfaces.sphere(np.array([0.5, 0.6, 0.5]), 0.3),
    surfaces.cone(np.array([0.5, 0.5, 0.4]), np.array([0.1, 0.2, 1]), 0.2, 0.6),
    surfaces.cone(np.array([0.5, 0.5, 0.4]), np.array([0.1, 0.2, 1]), 0.2, 0.9, flipped=True),
    surfaces.torus(np.array([0.5, 0.5, 0.5]), np.array([0.1, 0.2, 1]), 0.25, 0.08),
    surfaces.torus(np.array([0.5, 0.5, 0.5]), np.array([0.1, 0.2, 1]), 0.25, 0.08, flipped=True),
]


def sample(surface, rng, count=60):
    """Points on a piece of a surface: random ones near one of its points."""
    seed = surface.project(rng.random((1, 3)))
    return surface.project(seed + rng.uniform(-0.12, 0.12, (count, 3)))


@pytest.mark.parametrize("surface", SURFACES, ids=lambda s: f"{s.kind}{'-' if s.flipped else ''}")
def test_batch_evaluation_agrees_with_the_single_one(surface):
    points = np.random.default_rng(6).random((3, 20, 3))
    rows = np.tile(surfaces.surface_to_row(surface), (3, 1))
    distance, normal = evaluate(surface.kind, rows, points)
    for b in range(3):
        np.testing.assert_allclose(distance[b], surface.signed_distance(points[b]), atol=1e-9)
        np.testing.assert_allclose(normal[b], surface.normals(points[b]), atol=1e-6)


@pytest.mark.parametrize("surface", SURFACES, ids=lambda s: f"{s.kind}{'-' if s.flipped else ''}")
@pytest.mark.parametrize("seed", [101, 102, 103])
def test_batch_fit_recovers_exact_pieces(surface, seed):
    rng = np.random.default_rng(seed)
    points = np.stack([sample(surface, rng) for _ in range(4)])
    normals = np.stack([surface.normals(p) for p in points])
    sets = Sets(points, normals, np.full_like(points, np.nan), np.ones(points.shape[:2]))
    rows = batchfit.fit(surface.kind, sets, Noise(0.002, 0.05), iterations=12)
    distance, normal = evaluate(surface.kind, rows, points)
    assert np.median(np.abs(distance).max(1)) < 1e-4
    assert np.median(np.abs(normal - normals).max((1, 2))) < 5e-3


def test_softened_costs_rise_and_are_exact_below_the_knee():
    costs = np.linspace(0, 100, 500)
    soft = batchfit.soften(costs)
    assert (np.diff(soft) > 0).all()
    np.testing.assert_array_equal(soft[costs < batchfit.KNEE], costs[costs < batchfit.KNEE])


def test_shading_learns_a_light_and_gradients_match_it():
    rng = np.random.default_rng(7)
    cylinder = surfaces.cylinder(np.array([0.5, 0.5, 0.5]), np.array([0, 0, 1.0]), 0.3)
    points = cylinder.project(rng.random((3000, 3)))
    normals = cylinder.normals(points)
    light = np.array([60.0, 20, 10])
    grey = 120 + normals @ light
    shading = fit_shading(normals, grey, np.ones(len(points)))
    np.testing.assert_allclose(shading(normals), grey, atol=1.0)
    pairs, _ = neighbour_pairs(points, normals, 12)
    slope = gradients(points, normals, grey, pairs, np.ones(len(pairs)))
    known = np.isfinite(slope[:, 0])
    assert known.mean() > 0.9
    tangent = np.cross([0, 0, 1.0], normals)
    exact = (tangent @ light / 0.3)[:, None] * tangent  # derivative along the circle: light . dn/ds
    assert np.median(np.linalg.norm(slope - exact, axis=1)[known]) < 8  # of up to 210 levels per unit


def test_interior_leaves_out_a_band_around_borders():
    patches = np.ones((20, 20), np.int16)
    patches[:, 10:] = 2
    inner = interior(patches, 1.5)
    assert (inner[:, 9:11] == 0).all()
    assert (inner[:, 8] == 1).all()
    assert (inner[:, 11] == 2).all()


def test_agreement_counts_views():
    found = np.array([[1, 1, 2], [3, 3, 3], [0, 4, 4], [5, 0, 0]], np.int16)
    same, both = agreement(found, np.array([[0, 1], [1, 2], [0, 2]]))
    assert same.tolist() == [2, 2, 1]
    assert both.tolist() == [2, 3, 2]


def test_median_without_nan():
    values = np.random.default_rng(8).random((9, 40)).astype(np.float32)
    values[np.random.default_rng(9).random(values.shape) < 0.5] = np.nan
    values[:, 0] = np.nan
    with np.errstate(all="ignore"):
        import warnings

        warnings.simplefilter("ignore")
        expected = np.nanmedian(values, axis=0)
    np.testing.assert_allclose(nan_median(values), expected, rtol=1e-6)


def test_projection_lands_on_both_surfaces():
    one, other = SURFACES[0], SURFACES[1]
    start = other.project(np.random.default_rng(10).random((200, 3)))
    start = start[np.abs(one.signed_distance(start)) < 0.05]
    on, valid = project(start, one, other)
    assert valid.mean() > 0.9
    assert np.abs(one.signed_distance(on[valid])).max() < 1e-5
    assert np.abs(other.signed_distance(on[valid])).max() < 1e-5


def box_points(rng, count=6000):
    """Points of the unit box's faces with labels 2 * axis + side, and its six planes."""
    face = rng.integers(0, 6, count)
    points = rng.random((count, 3))
    points[np.arange(count), face // 2] = face % 2
    planes = []
    for k in range(6):
        normal = np.zeros(3)
        normal[k // 2] = 1 if k % 2 else -1
        planes.append(surfaces.plane(np.full(3, k % 2, float), normal))
    return points, face, planes


def test_box_has_twelve_curves_that_end_in_its_corners():
    points, face, planes = box_points(np.random.default_rng(11))
    curves = find_curves(points, face, planes, spacing_of(points), 0.01)
    assert len(curves) == 12
    for curve in curves:
        assert not curve.closed
        ends = curve.points[[0, -1]]
        np.testing.assert_allclose(ends, np.round(ends), atol=1e-6)
        assert np.linalg.norm(np.diff(ends, axis=0)) == pytest.approx(1, abs=1e-6)


def test_tube_has_two_closed_circles_between_one_pair_of_labels():
    rng = np.random.default_rng(12)
    phi, z = rng.uniform(0, 2 * np.pi, 3000), rng.uniform(-0.3, 0.3, 3000)
    ball = surfaces.sphere(np.zeros(3), 0.5)
    tube = surfaces.cylinder(np.zeros(3), np.array([0, 0, 1.0]), 0.4, flipped=True)
    inner = np.column_stack([0.4 * np.cos(phi), 0.4 * np.sin(phi), z])
    outer = ball.project(rng.normal(size=(6000, 3)))
    outer = outer[np.abs(outer[:, 2]) < 0.3]
    points = np.concatenate([inner, outer])
    labels = np.repeat([0, 1], [len(inner), len(outer)])
    curves = find_curves(points, labels, [tube, ball], spacing_of(points), 0.005)
    assert len(curves) == 2
    assert all(c.closed for c in curves)
    for curve in curves:
        np.testing.assert_allclose(np.abs(curve.points[:, 2]), 0.3, atol=1e-5)
        length = np.linalg.norm(np.diff(curve.points, axis=0, append=curve.points[:1]), axis=1).sum()
        assert length == pytest.approx(2 * np.pi * 0.4, rel=1e-3)


def test_tangent_patches_have_no_curve():
    rng = np.random.default_rng(13)
    x, y = rng.random(3000), rng.random(3000)
    phi = rng.uniform(0, np.pi / 2, 3000)
    flat = np.column_stack([x, y, np.zeros(3000)])
    bend = np.column_stack([1 + 0.3 * np.sin(phi), y, -0.3 + 0.3 * np.cos(phi)])
    tops = [
        surfaces.plane(np.zeros(3), np.array([0, 0, 1.0])),
        surfaces.cylinder(np.array([1, 0, -0.3]), np.array([0, 1.0, 0]), 0.3),
    ]
    points, labels = np.concatenate([flat, bend]), np.repeat([0, 1], 3000)
    assert find_curves(points, labels, tops, spacing_of(points), 0.01) == []


@pytest.mark.parametrize(("wall", "expected"), [(False, True), (True, False)])
def test_pieces_of_a_plane_join_unless_a_wall_cuts_them(wall, expected):
    x, y = np.meshgrid(np.arange(-1, 1, 0.02), np.arange(0, 1, 0.02))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    points = points[np.abs(points[:, 0]) > 0.04]
    labels = (points[:, 0] > 0).astype(int)
    planes = [surfaces.plane(np.zeros(3), np.array([0, 0, 1.0]))] * 2
    x2, z2 = np.meshgrid(np.arange(-1, 1, 0.02), np.arange(-0.2, 0, 0.02))
    for side in (0, 1):  # the block's ends bound the pieces
        end = np.column_stack([x2.ravel(), np.full(x2.size, float(side)), z2.ravel()])
        points = np.concatenate([points, end])
        labels = np.concatenate([labels, np.full(len(end), len(planes))])
        planes = [*planes, surfaces.plane(np.array([0, side, 0.0]), np.array([0, 2.0 * side - 1, 0]))]
    if wall:  # a slot between the pieces
        z, y2 = np.meshgrid(np.arange(-0.2, 0, 0.02), np.arange(0, 1, 0.02))
        for side in (-1, 1):
            plane = np.column_stack([np.full(z.size, side * 0.03), y2.ravel(), z.ravel()])
            points = np.concatenate([points, plane])
            labels = np.concatenate([labels, np.full(len(plane), len(planes))])
            planes = [*planes, surfaces.plane(np.array([side * 0.03, 0, 0]), np.array([-side, 0.0, 0]))]
    assert joined(points, labels, 0, 1, planes[0], planes, 0.02, 0.001) is expected


def circle_between(first, second, shown, radius=0.2):
    """A closed curve between patches 0 and 1 of two surfaces."""
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(60)])
    return Curve(points, (0, 1), True, shown), [first, second]


@pytest.mark.parametrize(
    ("degrees", "shown", "kept"),
    [(90, 0.0, True), (40, 0.1, True), (25, 0.95, True), (25, 0.5, False), (10, 1.0, False)],
)
def test_curves_at_small_angles_are_believed_only_if_views_show_them(degrees, shown, kept):
    cylinder = surfaces.Surface("cylinder", np.zeros(3), np.array([0, 0, 1.0]), radius=0.2)
    taper = np.radians(degrees)
    origin = np.array([0, 0, 0.2 / np.tan(taper)])  # the cone's apex; it is as wide as the cylinder at z = 0
    cone = surfaces.Surface("cone", origin, np.array([0, 0, -1.0]), angle=taper)
    curve, pair = circle_between(cylinder, cone, shown)
    assert abs(cone.signed_distance(curve.points)).max() < 1e-9
    assert bool(believed([curve], pair)) == kept
