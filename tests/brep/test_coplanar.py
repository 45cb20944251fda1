"""Small planes beside larger ones, whose points are those of faces that lie in one plane, or do not."""

import numpy as np
import pytest
from brepgaussian.brep.coplanar import coplanar
from brepgaussian.brep.patches import Patch
from brepgaussian.geometry.surfaces import plane

UP, REACH = np.eye(3)[2], 0.012


def face(rng, count, low, side, height, normal, lean=0.0):
    xyz = np.column_stack([low + rng.uniform(0, side, (count, 2)), height + rng.normal(0, 0.001, count)])
    axis = normal * np.array([np.sin(lean), 0.0, np.cos(lean)])
    return Patch(plane(xyz.mean(axis=0), axis), 0, xyz, np.tile(normal * UP, (count, 1)), REACH, 0.001)


@pytest.mark.parametrize(
    ("height", "lean", "normal", "moved"),
    [(0.003, 3.0, -1.0, True), (-0.003, 0.0, 1.0, True), (0.03, 3.0, -1.0, False), (0.003, 8.0, -1.0, False)],
    ids=["the back of a rib", "a step of less than its points tell", "another plane", "a slant"],
)
def test_a_small_plane_lies_on_a_larger_one_that_is_nearly_the_same(height, lean, normal, moved):
    rng = np.random.default_rng(3)
    large = face(rng, 3000, 0.0, 0.4, 0.0, 1.0)
    small = face(rng, 200, 0.45, 0.08, height, normal, np.radians(lean))
    same, found = coplanar([large, small])
    assert same is large
    assert (found is not small) is moved
    if moved:
        assert found.surface.axis @ UP == pytest.approx(normal)
        assert np.abs(found.surface.signed_distance(large.surface.project(large.xyz))).max() < 1e-9
