"""Tips of chamfers, against the analytic edges of a nut's corner; curves on surfaces that are fitted together."""

import numpy as np
import pytest
from brepgaussian.artifacts.points import Points
from brepgaussian.geometry import surfaces
from brepgaussian.points.curves import Curve, find_curves
from brepgaussian.points.graph import spacing_of
from brepgaussian.points.models import shared_surfaces
from brepgaussian.points.tips import _to_the_tip, without_tips

SIDE, TOP, RIGHT, LEFT = range(4)
WIDE = 0.5  # of the side, from its middle
NARROW = 0.2  # of the side, from its middle: there the chamfer has no label of its own


def nut_side(rng, narrow=NARROW, count=6000):
    """Points, labels and surfaces of a nut's side x = 1, its top z = 0, and its chamfer of 45 degrees, which touches
    the edge between the two in the middle."""
    y = rng.uniform(-WIDE, WIDE, count)
    side = np.column_stack([np.ones(count), y, rng.uniform(-0.4, 0, count)])
    side = side[side[:, 2] < 1 - np.hypot(1, side[:, 1])]
    top = np.column_stack([rng.uniform(0.5, 1, count), rng.uniform(-WIDE, WIDE, count), np.zeros(count)])
    top = top[np.hypot(top[:, 0], top[:, 1]) < 1]
    z = rng.uniform(-0.12, 0, 4 * count)
    angle = rng.uniform(-0.5, 0.5, 4 * count)
    cone = np.column_stack([(1 - z) * np.cos(angle), (1 - z) * np.sin(angle), z])
    cone = cone[(cone[:, 0] < 1) & (np.abs(cone[:, 1]) < WIDE)][: count // 2]
    label = np.where(cone[:, 1] > 0, RIGHT, LEFT)
    lost = np.abs(cone[:, 1]) < narrow
    label[lost] = np.where(1 - cone[lost, 0] < -cone[lost, 2], SIDE, TOP)
    points = np.concatenate([side, top, cone])
    labels = np.concatenate([np.full(len(side), SIDE), np.full(len(top), TOP), label])
    chamfer = surfaces.cone(np.array([0, 0, -1.0]), np.array([0, 0, -1.0]), 2.0, np.pi / 4)
    known = [
        surfaces.plane(np.array([1.0, 0, 0]), np.array([1.0, 0, 0])),
        surfaces.plane(np.zeros(3), np.array([0, 0, 1.0])),
        chamfer,
        chamfer,
    ]
    return points, labels, known


@pytest.mark.parametrize("seed", [21, 22])
def test_a_narrow_tip_is_no_edge_of_its_neighbours(seed):
    points, labels, known = nut_side(np.random.default_rng(seed))
    spacing = spacing_of(points)
    found = find_curves(points, labels, known, spacing, 0.01)
    assert (SIDE, TOP) in {c.pair for c in found}
    curves = without_tips(found, points, labels, known, spacing, 0.01)
    assert sorted(c.pair for c in curves) == [(SIDE, RIGHT), (SIDE, LEFT), (TOP, RIGHT), (TOP, LEFT)]
    for curve in curves:
        tip = np.linalg.norm(curve.points - [1, 0, 0], axis=1).min()
        assert tip < 0.02
        sign = 1 if RIGHT in curve.pair else -1
        assert (sign * curve.points[:, 1]).min() > -0.02


def test_an_edge_with_points_up_to_it_stays():
    """The chamfer stops: beyond its end, the side and the top reach their edge."""
    rng = np.random.default_rng(23)
    points, labels, known = nut_side(rng)
    y = rng.uniform(-NARROW, NARROW, 2000)
    low = np.column_stack([np.ones(2000), y, rng.uniform(-0.05, 0, 2000)])
    high = np.column_stack([rng.uniform(0.9, 1, 2000), y, np.zeros(2000)])
    every = np.concatenate([points, low, high])
    label = np.concatenate([labels, np.full(2000, SIDE), np.full(2000, TOP)])
    spacing = spacing_of(every)
    curves = without_tips(find_curves(every, label, known, spacing, 0.01), every, label, known, spacing, 0.01)
    assert (SIDE, TOP) in {c.pair for c in curves}


@pytest.mark.parametrize("way", [1, -1])
def test_a_curve_that_runs_along_a_tip_goes_no_farther_than_that(way):
    """The other patch, which it nears, is met far beyond."""
    spacing, step = 0.015, 0.005
    x, z = surfaces.plane(np.zeros(3), np.array([1.0, 0, 0])), surfaces.plane(np.zeros(3), np.array([0, 0, 1.0]))
    beside = surfaces.plane(np.array([0, 0, 0.02]), np.array([0, way * 0.01, 1.0]) / np.hypot(1, 0.01))  # ever nearer
    y = way * np.arange(0, 0.6, step)
    tip = Curve(np.column_stack([np.zeros(len(y)), y, np.full(len(y), 0.02)]), (0, 2), False)
    curve = Curve(np.column_stack([np.zeros(8), y[-8:], np.zeros(8)]), (0, 1), False)
    longer = _to_the_tip(curve, tip, [x, z, beside], beside, spacing, step)
    reach = way * longer.points[:, 1]
    assert -3 * spacing <= reach.min()
    assert reach.max() <= 0.6 + 3 * spacing


def test_pieces_of_one_cone_get_its_surface_and_others_keep_theirs():
    points, labels, known = nut_side(np.random.default_rng(24), narrow=0.05)
    normals = np.concatenate([known[k].normals(points[labels == k]) for k in range(4)])
    order = np.concatenate([np.flatnonzero(labels == k) for k in range(4)])
    xyz, label = points[order], labels[order]
    noisy = xyz + 0.0005 * np.random.default_rng(25).normal(size=xyz.shape)
    cloud = Points(
        noisy.astype(np.float32), normals.astype(np.float32), np.zeros(len(xyz), np.float32), label.astype(np.int32),
        np.full(len(xyz), -1, np.int32),
    )  # fmt: skip
    flat = surfaces.plane(xyz[label == RIGHT].mean(axis=0), normals[label == RIGHT].mean(axis=0))
    wrong = [known[SIDE], known[TOP], flat, known[LEFT]]
    found = shared_surfaces(cloud, wrong)
    assert [s.kind for s in found[:2]] == ["plane", "plane"]
    for k in (RIGHT, LEFT):
        assert found[k].rms(xyz[label == k]) < 0.001
    assert found[RIGHT].kind == "cone"


def test_without_labelled_points_surfaces_stay():
    cloud = Points(*(np.zeros((5, 3), np.float32),) * 2, np.zeros(5, np.float32), *(np.full(5, -1, np.int32),) * 2)
    own = [surfaces.plane(np.zeros(3), np.array([0, 0, 1.0]))]
    assert shared_surfaces(cloud, own) == own


def test_an_arc_in_a_corner_ends_where_the_walls_touch_it():
    """A pocket's floor and the round corner between two of its walls, both of which are tangent to it."""
    rng, radius = np.random.default_rng(26), 0.06
    floor = np.column_stack([rng.uniform(0, 1, (8000, 2)), np.zeros(8000)])
    out = (floor[:, :2] < radius).all(axis=1) & (np.linalg.norm(floor[:, :2] - radius, axis=1) > radius)
    floor = floor[~out]
    angle, high = rng.uniform(np.pi, 1.5 * np.pi, 2000), rng.uniform(0, 0.5, 2000)
    bend = np.column_stack([radius + radius * np.cos(angle), radius + radius * np.sin(angle), high])
    along, up = rng.uniform(radius, 1, (2, 2500)), rng.uniform(0, 0.5, (2, 2500))
    walls = [np.column_stack([np.zeros(2500), along[0], up[0]]), np.column_stack([along[1], np.zeros(2500), up[1]])]
    points = np.concatenate([floor, bend, *walls])
    labels = np.repeat([0, 1, 2, 3], [len(floor), 2000, 2500, 2500])
    known = [
        surfaces.plane(np.zeros(3), np.array([0, 0, 1.0])),
        surfaces.cylinder(np.array([radius, radius, 0]), np.array([0, 0, 1.0]), radius, flipped=True),
        surfaces.plane(np.array([-0.0004, 0, 0]), np.array([1.0, 0, 0])),  # as fits are: not quite tangent
        surfaces.plane(np.array([0, -0.0004, 0]), np.array([0, 1.0, 0])),
    ]
    curves = find_curves(points, labels, known, spacing_of(points), 0.01)
    (arc,) = [c for c in curves if c.pair == (0, 1)]
    ends = sorted(arc.points[[0, -1]].tolist())
    np.testing.assert_allclose(ends, [[0, radius, 0], [radius, 0, 0]], atol=0.02)
