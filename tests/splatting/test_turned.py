"""Turned parts: the axis from normals, and a groove that a hull closes between views."""

import numpy as np
import pytest
from brepgaussian.artifacts.truth import read_truth
from brepgaussian.artifacts.views import read_views
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.splatting.concave.turned import axis_of_rotation, turn
from brepgaussian.splatting.hull import carve
from brepgaussian.views.stage import make_views
from skimage.measure import marching_cubes

SPACING = 0.02


def mesh_of(distance):
    """Vertices and triangles of a shape given by its signed distance, inside positive, on [0, 1]^3."""
    grid = np.stack(np.meshgrid(*3 * [np.arange(0, 1.0001, SPACING)], indexing="ij"), -1)
    field = np.pad(distance(grid.reshape(-1, 3)).reshape(grid.shape[:3]), 1, constant_values=-1.0)
    vertices, triangles, _, _ = marching_cubes(field, 0.0, gradient_direction="ascent")
    return (vertices - 1) * SPACING, triangles.astype(np.int64)


def test_the_axis_of_a_tilted_shaft_is_found_in_spite_of_a_flat():
    direction = np.array([0.3, -0.2, 0.93])
    direction /= np.linalg.norm(direction)
    through = np.array([0.52, 0.47, 0.5])
    side = np.cross(direction, [1.0, 0, 0])
    side /= np.linalg.norm(side)

    def shaft(points):
        height = (points - through) @ direction
        radius = np.linalg.norm(points - through - height[:, None] * direction, axis=1)
        return np.minimum(np.minimum(0.25 - radius, 0.3 - np.abs(height)), 0.2 - (points - through) @ side)

    axis = axis_of_rotation(*mesh_of(shaft), 3 * SPACING)
    assert axis is not None
    assert abs(axis.direction @ direction) > np.cos(np.radians(0.3))
    off = through - axis.through
    assert np.linalg.norm(off - (off @ axis.direction) * axis.direction) < 0.1 * SPACING


def test_a_box_has_no_axis_of_rotation():
    def box(points):
        return (np.array([0.4, 0.25, 0.3]) - np.abs(points - 0.5)).min(axis=1)

    assert axis_of_rotation(*mesh_of(box), 3 * SPACING) is None


def test_a_groove_around_a_ring_is_emptied(tmp_path):
    settings = ViewsSettings(rendered_views=24, image_size=320)
    files = {"out_views": tmp_path / "views.h5", "out_truth": tmp_path / "truth.h5"}
    make_views(object_name="gland", source="part", path="o_ring_gland:3", settings=settings, **files)
    views, truth = read_views(files["out_views"]), read_truth(files["out_truth"])

    def distances(hull):
        return np.abs(hull.scene().signed_distance(truth.points))

    found = {}

    def look(images, hull, faces):
        found["before"] = distances(hull)
        hull = turn(images, hull)
        found["after"] = distances(hull)
        return hull, []

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("brepgaussian.splatting.opened.open_channels", look)
        carve(views, 96, 1, True)
    faces = range(len(truth.face_types))
    before, after = ([found[key][truth.point_face == f].mean() for f in faces] for key in ("before", "after"))
    emptied = [f for f in faces if before[f] > 0.006 and after[f] < 0.4 * before[f]]
    assert {truth.face_types[f] for f in emptied} == {"cylinder", "plane"}  # the groove's bottom and its sides
    assert all(after[f] < before[f] + 0.004 for f in faces)  # a third of a voxel
