"""The contact sheet and the pictures that it is made of."""

import numpy as np
from brepgaussian.artifacts.views import read_views
from brepgaussian.metrics.distances import SampledSurface
from brepgaussian.report import colors, picture


def test_sheet_has_two_rows_of_four_filled_panels(made):
    import cv2

    sheet = cv2.imread(str(made.sheet))
    assert sheet.shape == (2 * 150, 4 * 120, 3)
    for row in range(2):
        for column in range(4):
            panel = sheet[row * 150 + 30 : (row + 1) * 150, column * 120 : (column + 1) * 120]
            assert (panel < 230).any(axis=2).mean() > 0.02, (row, column)


def test_drawing_agrees_with_the_input_view(made, example):
    """The truth, drawn through a frame, covers the view's silhouette pixel by pixel."""
    views = read_views(made.files.views)
    truth = example.truth_of(example.drilled_plate(), 100)
    surface = SampledSurface(truth.mesh_vertices, truth.mesh_triangles, truth.points, truth.normals)
    frame = picture.frame_on_object(views, 1, 200)
    black = np.zeros((len(surface.triangles), 3))
    drawn = picture.draw_triangles(frame, surface, black, flat=True).mean(axis=2) < 0.5
    wanted = frame.crop(views.alpha[1]) > 127
    assert (drawn & wanted).sum() / (drawn | wanted).sum() > 0.97
    pixels, distance = frame.project(truth.points)
    assert ((pixels > 0) & (pixels < 200)).all()
    assert (np.abs(distance - 2.4) < 1).all()


def test_visible_is_what_the_camera_sees(made, example):
    views = read_views(made.files.views)
    truth = example.truth_of(example.drilled_plate(), 2000)
    surface = SampledSurface(truth.mesh_vertices, truth.mesh_triangles, truth.points, truth.normals)
    frame = picture.frame_on_object(views, 0, 100)
    seen = picture.visible(frame, truth.points, surface)
    facing = ((views.cameras.centers[0] - truth.points) * truth.normals).sum(axis=1) > 0
    wall = truth.point_face == truth.face_types.index("cylinder")
    rim = np.hypot(*(truth.points[:, :2] - 0.5).T) < 0.25  # grazing points near the hole may go either way
    assert (seen == facing)[~wall & ~rim].mean() > 0.99
    assert seen[wall].mean() < facing[wall].mean()


def test_runs_share_their_ends():
    assert picture.runs(np.array([True, True, False, True])) == [(0, 3, True), (2, 4, False), (3, 4, True)]
    assert picture.runs(np.array([True])) == [(0, 1, True)]


def test_colors_are_distinct_and_errors_have_a_round_scale():
    table = colors.patch_colors(np.arange(-1, 40))
    gaps = np.linalg.norm(table[:, None] - table[None], axis=2) + np.eye(41)
    assert gaps.min() > 0.03
    assert np.linalg.norm(np.diff(table, axis=0), axis=1).min() > 0.2
    assert colors.error_end(np.array([0.0017] * 10)) == 0.002
    assert colors.error_end(np.zeros(0)) > 0
    ends = colors.error_colors(np.array([0.0, 1.0, 2.0]), 1.0)
    np.testing.assert_array_equal(ends[1], ends[2])


def test_best_view_shows_the_hole_from_above(made, example):
    """A flat view of one side tells less than a view of three sides; all example cameras are above."""
    views = read_views(made.files.views)
    truth = example.truth_of(example.drilled_plate(), 100)
    surface = SampledSurface(truth.mesh_vertices, truth.mesh_triangles, truth.points, truth.normals)
    best = picture.best_view(views, surface, truth.triangle_face)
    seen = [len(np.unique(ids)) for ids in example.render(truth, views.cameras)[0]]
    assert seen[best] == max(seen)
    assert picture.upward(views.cameras)[2] > 0.99
