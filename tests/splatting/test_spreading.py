"""Points spread over a box with a small step on it, whose areas are known."""

from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.mesh import vertex_normals
from brepgaussian.splatting.spreading import faces_of, spread, spread_closer
from scipy.spatial import cKDTree

VOXELS = 101
SIDE = 0.6  # of the box
STEP = 0.08  # side of the square block on its top
HIGH = 0.06


def _hull(step: float) -> SimpleNamespace:
    """Mesh of a box from .2 to .8 with a square block of side `step` on top; 0 = none."""
    axis = np.linspace(0, 1, VOXELS)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    sides = np.minimum(SIDE / 2 - abs(x - 0.5), SIDE / 2 - abs(y - 0.5))
    field = np.minimum(sides, SIDE / 2 - abs(z - 0.5))
    if step:
        block = np.minimum(step / 2 - abs(x - 0.5), step / 2 - abs(y - 0.5))
        field = np.maximum(field, np.minimum(block, np.minimum(0.8 + HIGH - z, z - 0.5)))
    vertices, triangles = Volume(field.astype(np.float32), np.zeros(3), axis[1]).mesh()
    return SimpleNamespace(
        vertices=vertices, triangles=triangles, normals=vertex_normals(vertices, triangles), spacing=axis[1]
    )


def test_areas_are_those_of_the_faces() -> None:
    hull = _hull(STEP)
    areas, widths = faces_of(hull)
    centre = hull.vertices[hull.triangles].mean(axis=1)
    on_step = abs(centre - [0.5, 0.5, 0.8 + HIGH]).max(axis=1) < STEP / 4
    assert on_step.any()
    assert np.ptp(areas[on_step]) == 0
    assert STEP**2 * 0.5 < areas[on_step][0] < STEP**2 * 1.05  # up to a voxel less on each side
    below = abs(centre - [0.5, 0.5, 0.2]).max(axis=1) < SIDE / 4
    assert SIDE**2 * 0.85 < areas[below][0] < SIDE**2 * 1.05
    for face, side in ((on_step, STEP), (below, SIDE)):  # twice the area over the perimeter of a square
        assert np.ptp(widths[face]) == 0
        assert side / 2 * 0.7 < widths[face][0] < side / 2 * 1.05


def test_where_no_face_is_small_nothing_changes() -> None:
    hull = _hull(0)
    even, closer = spread(hull, 1000, 4), spread_closer(hull, 1000, 4)
    np.testing.assert_array_equal(even[0], closer[0])
    np.testing.assert_array_equal(even[1], closer[1])
    np.testing.assert_array_equal(closer[2], even[2])


@pytest.mark.parametrize("seed", [0, 7])
def test_points_are_closer_on_small_faces_and_even_on_each(seed: int) -> None:
    hull = _hull(STEP)
    usual = spread(hull, 1000, seed)[2]
    points, normals, distances = spread_closer(hull, 1000, seed)
    on_step = (abs(points[:, :2] - 0.5) < STEP / 2 - hull.spacing).all(axis=1) & (points[:, 2] > 0.8 + HIGH / 2)
    beside = points[:, 2] < 0.79
    assert (distances[on_step] < 0.7 * usual).all()
    np.testing.assert_allclose(distances[beside], usual)
    nearest = cKDTree(points).query(points, 2)[0][:, 1]
    assert (nearest >= distances.min() - 1e-12).all()
    assert nearest[on_step].max() < 2 * distances[on_step].max()
    assert nearest[beside].min() > usual - 1e-12 or distances.min() < usual
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)


def test_points_are_closer_on_a_narrow_strip_however_long_it_is() -> None:
    """A rib along all of the box: its top is .06 wide and .6 long."""
    axis = np.linspace(0, 1, VOXELS)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    across = SIDE / 2 - abs(x - 0.5)
    rib = np.minimum.reduce([0.03 - abs(y - 0.5), across, 0.8 + HIGH - z, z - 0.5])
    field = np.maximum(np.minimum.reduce([across, SIDE / 2 - abs(y - 0.5), SIDE / 2 - abs(z - 0.5)]), rib)
    vertices, triangles = Volume(field.astype(np.float32), np.zeros(3), axis[1]).mesh()
    hull = SimpleNamespace(vertices=vertices, triangles=triangles, normals=vertex_normals(vertices, triangles))
    usual = spread(hull, 1500, 2)[2]
    points, _, distances = spread_closer(hull, 1500, 2)
    on_top = (points[:, 2] > 0.8 + HIGH - 0.005) & (abs(points[:, 1] - 0.5) < 0.015)
    assert np.count_nonzero(on_top) > 30
    assert (distances[on_top] < 0.06 / 2).all()
    assert (distances[on_top] < 0.75 * usual).all()
    np.testing.assert_allclose(distances[points[:, 2] < 0.7], usual)


def test_the_same_seed_gives_the_same_points() -> None:
    hull = _hull(STEP)
    for one, other in zip(spread_closer(hull, 1000, 1), spread_closer(hull, 1000, 1), strict=True):
        np.testing.assert_array_equal(one, other)
