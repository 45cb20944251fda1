"""Faces whose points have the label of a larger one, against the true faces."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.primitives.stage import primitives_of
from brepgaussian.primitives.unclaimed import with_unclaimed
from brepgaussian.settings.primitives import PrimitivesSettings

SETTINGS = PrimitivesSettings()
SIGMA = 0.0008


def face_at(truth, kind, height):
    """Index of the face of a kind whose points are nearest to a height along z, in the middle."""
    middles = [
        abs(truth.points[truth.point_face == i, 2].mean() - height) if k == kind else np.inf
        for i, k in enumerate(truth.face_types)
    ]
    return int(np.argmin(middles))


def swallowed(points, primitives, small, large):
    """Points of a small face with a large one's label, and the primitives without the small one's."""
    label = np.where(points.label == small, large, points.label).astype(np.int32)
    items = [p for p in primitives.items if np.mean(points.label[p.support] == small) < 0.5]
    assert len(items) == len(primitives.items) - 1
    return replace(points, label=label), replace(primitives, items=tuple(items), relations=())


@pytest.mark.parametrize("seed", [11, 12])
def test_a_neck_that_shares_its_label_with_the_cone_above_it_has_a_surface(truth_maker, point_maker, seed):
    truth = truth_maker("spray_nozzle")
    points = point_maker(truth, SIGMA, 0.0, np.random.default_rng(seed), count=20000)
    primitives = primitives_of(points, SETTINGS)
    cone = face_at(truth, "cone", 0.75)
    neck = face_at(truth, "cylinder", 0.53)
    radius = next(p.surface.radius for p in primitives.items if np.mean(points.label[p.support] == neck) > 0.5)
    mixed, fewer = swallowed(points, primitives, neck, cone)
    found = with_unclaimed(mixed, fewer, SETTINGS)
    assert found is not None
    assert len(found.items) == len(primitives.items)
    added = found.items[-1]
    assert added.surface.kind == "cylinder"
    assert added.surface.radius == pytest.approx(radius, abs=2 * SIGMA)
    assert np.mean(points.label[added.support] == neck) > 0.95


def test_where_all_points_have_a_surface_nothing_is_added(truth_maker, point_maker):
    points = point_maker(truth_maker("block_hole"), SIGMA, 0.0, np.random.default_rng(13))
    assert with_unclaimed(points, primitives_of(points, SETTINGS), SETTINGS) is None


def test_a_face_that_bulges_is_no_second_one(truth_maker, point_maker):
    """A patch in the middle of a face lies before it: its points support no surface, and are parallel to one."""
    truth = truth_maker("block_hole")
    points = point_maker(truth, SIGMA, 0.0, np.random.default_rng(14), count=20000)
    primitives = primitives_of(points, SETTINGS)
    face = primitives.items[0]
    on = points.xyz[face.support]
    raised = face.support[np.linalg.norm(on - on[len(on) // 2], axis=1) < 0.12]
    xyz = points.xyz.copy()
    xyz[raised] += 0.006 * points.normals[raised]
    less = replace(face, support=np.setdiff1d(face.support, raised))
    bulging = replace(primitives, items=(less, *primitives.items[1:]), relations=())
    assert len(raised) > 100
    assert with_unclaimed(replace(points, xyz=xyz), bulging, SETTINGS) is None
