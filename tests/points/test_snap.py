"""Curves on the edges of edge maps drawn by hand, and primitives drawn to them."""

import cv2
import numpy as np
import pytest
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.points.anchor import anchor_surfaces
from brepgaussian.points.curves import Curve
from brepgaussian.points.snap import snap
from poses import look_at

SIZE, FOCAL = 400, 520.0


def cameras_above(count=12):
    poses = []
    for k in range(count):
        angle = 2 * np.pi * k / count
        eye = np.array([0.5 + 1.2 * np.cos(angle), 0.5 + 1.2 * np.sin(angle), 1.5 + 0.3 * (k % 2)])
        poses.append(look_at(eye))
    return Cameras(np.tile([FOCAL, FOCAL, SIZE / 2, SIZE / 2], (count, 1)), np.array(poses), SIZE, SIZE)


def plane(point, normal):
    return Surface("plane", np.asarray(point, float), np.asarray(normal, float))


def snapped(shift, jitter_px, seed):
    """A ridge along y, whose edge the views show beside it: by a shift in space, and by chance."""
    rng = np.random.default_rng(seed)
    y = np.linspace(0.3, 0.7, 81)
    ridge = np.column_stack([np.full(81, 0.5), y, np.full(81, 0.5)])
    cameras = cameras_above()
    edges = np.zeros((len(cameras), SIZE, SIZE), np.uint8)
    for view in range(len(cameras)):
        pixels = cameras.project(view, ridge + shift)[0] + rng.normal(0, jitter_px, 2)
        line = np.round((pixels - 0.5) * 16).astype(np.int32).reshape(-1, 1, 2)
        cv2.polylines(edges[view], [line], False, 255, 1, cv2.LINE_AA, 4)
    surfaces = [plane([0.5, 0.5, 0.5], [0, 0, 1]), plane([0.5, 0.5, 0.5], [1, 0, 0])]
    (curve,) = snap([Curve(ridge, (0, 1), False)], surfaces, cameras, edges, ridge, 0.005)
    return ridge, curve


@pytest.mark.parametrize("seed", [3, 4])
def test_a_curve_moves_to_where_all_views_have_its_edge(seed):
    shift = np.random.default_rng(seed).uniform(-0.004, 0.004, 3) * [1, 0, 1]
    ridge, curve = snapped(shift, 0.0, seed)
    inner = slice(10, -10)
    off = (curve.points - ridge - shift)[inner][:, [0, 2]]
    assert np.abs(off).max() < 0.001  # a third of a pixel
    assert curve.shown > 0.95
    assert curve.scatter < 0.3


@pytest.mark.parametrize("seed", [5, 6])
def test_views_that_differ_about_an_edge_are_noticed(seed):
    assert snapped(np.zeros(3), 2.5, seed)[1].scatter > 0.6


@pytest.mark.parametrize(("scatter", "least", "most"), [(0.2, 0.004, 0.005), (1.4, 0.0, 0.001)])
def test_a_curve_draws_its_plane_as_far_as_the_views_agree_about_it(scatter, least, most):
    rng = np.random.default_rng(7)
    nodes = np.column_stack([rng.uniform(0, 1, (400, 2)), np.zeros(400)])
    around = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    rim = np.column_stack([0.5 + 0.5 * np.cos(around), 0.5 + 0.5 * np.sin(around), np.full(120, 0.005)])
    curve = Curve(rim, (0, 1), True, 1.0, scatter)
    (found,) = anchor_surfaces([plane([0, 0, 0], [0, 0, 1])], nodes, np.zeros(400, int), [curve])
    moved = np.median(np.abs(found.signed_distance(nodes)))
    assert least <= moved <= most


def test_nodes_that_lie_on_a_known_wall_are_hardly_drawn():
    rng = np.random.default_rng(8)
    nodes = np.column_stack([rng.uniform(0, 1, (400, 2)), np.zeros(400)])
    around = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    rim = np.column_stack([0.5 + 0.5 * np.cos(around), 0.5 + 0.5 * np.sin(around), np.full(120, 0.002)])
    curve, flat, labels = Curve(rim, (0, 1), True, 1.0, 0.2), plane([0, 0, 0], [0, 0, 1]), np.zeros(400, int)
    free, told = (
        anchor_surfaces([flat], nodes, labels, [curve], np.full(400, known))[0].signed_distance(nodes)
        for known in (False, True)
    )
    unknown = anchor_surfaces([flat], nodes, labels, [curve])[0].signed_distance(nodes)
    np.testing.assert_array_equal(free, unknown)
    assert np.median(np.abs(told)) < 0.5 * np.median(np.abs(free))
