"""Relations that hold to rounding hold exactly, and what the kernel makes of that."""

import numpy as np
import pytest
from brepgaussian.brep import occ
from brepgaussian.brep.assemble import make_sheets
from brepgaussian.brep.build_faces import build_face
from brepgaussian.brep.cells import arrange
from brepgaussian.brep.exact import exact
from brepgaussian.brep.job import Rung
from brepgaussian.brep.patches import Patch
from brepgaussian.geometry.surfaces import cone, cylinder, plane, sphere, unit
from hypothesis import given
from hypothesis import strategies as st

UP = np.array([0, 0, 1.0])


def patch(surface, number=0):
    points = surface.project(np.random.default_rng(0).uniform(0.2, 0.8, (50, 3)))
    return Patch(surface, number, points, surface.normals(points), 0.02, 0.001)


@given(seed=st.integers(0, 10_000), off=st.floats(0, 5e-9))
def test_nearly_square_frames_become_square(seed, off):
    rng = np.random.default_rng(seed)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    planes = [plane(rng.random(3), sign * frame[k] + off * rng.normal(size=3)) for k in range(3) for sign in (1, -1)]
    axes = np.array([p.surface.axis for p in exact([patch(s) for s in planes])])
    for k in range(0, 6, 2):
        np.testing.assert_array_equal(axes[k], -axes[k + 1])
    assert np.abs(axes[::2] @ axes[::2].T - np.eye(3)).max() < 1e-15
    assert max(np.linalg.norm(a - s.axis) for a, s in zip(axes, planes, strict=True)) < 1e-7


def test_axes_that_are_nearly_one_become_one_and_others_stay():
    tilted = unit(UP + np.array([3e-10, -2e-10, 0]))
    around = [cylinder(np.array([0.5, 0.5, 0.2]), UP, 0.1), cone(np.array([0.5, 0.5 + 3e-9, 0.7]), -tilted, 0.2, 0.3)]
    apart = [
        cylinder(np.array([0.5, 0.51, 0.2]), unit(UP + np.array([1e-4, 0, 0])), 0.1),
        sphere(np.array([0.5, 0.5, 0.5]), 0.2),
    ]
    first, second, third, ball = (p.surface for p in exact([patch(s) for s in around + apart]))
    np.testing.assert_array_equal(second.axis, -first.axis)
    np.testing.assert_array_equal(np.cross(second.origin - first.origin, first.axis), 0)
    assert third == apart[0]
    assert ball == apart[1]


@pytest.mark.parametrize("off", [0.0, 1e-10, 3e-9])
def test_lobes_with_nearly_parallel_axes_are_cells(off):
    """A disk with three lobes, as a pump's cover has: the kernel loses them if axes are 1e-10 apart."""
    rng = np.random.default_rng(3)
    turn = np.arange(3) * 2 * np.pi / 3
    places = [np.array([0.5, 0.5]), *(0.5 + 0.35 * np.column_stack([np.cos(turn), np.sin(turn)]))]
    patches = []
    for k, (place, radius) in enumerate(zip(places, (0.3, 0.1, 0.1, 0.1), strict=True)):
        wall = cylinder(np.append(place, 0.5), unit(UP + off * rng.normal(size=3)), radius)
        angle, height = rng.uniform(0, 2 * np.pi, 900), rng.uniform(0.4, 0.6, 900)
        points = np.column_stack([place[0] + radius * np.cos(angle), place[1] + radius * np.sin(angle), height])
        patches.append(Patch(wall, k, points, wall.normals(points), 0.02, 0.001))
    for k, z in enumerate((0.4, 0.6)):
        face = plane(np.array([0.5, 0.5, z]), np.sign(z - 0.5) * UP)
        points = np.column_stack([rng.uniform(0.02, 0.98, (2000, 2)), np.full(2000, z)])
        patches.append(Patch(face, 4 + k, points, face.normals(points), 0.02, 0.001))
    sheets = make_sheets(patches, Rung("support", 0.04))
    found = arrange([build_face(s) for s in sheets], [s.patch for s in sheets], 1e-5)
    assert found.cells == 7  # the disk without the lobes' inner parts, and both parts of each lobe
    assert all(occ.area(f) > 0 for f in found.facets)
