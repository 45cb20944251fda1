"""Rooms over a floor: without what fills them views agree about it, and at no other height about as much of it."""

import numpy as np
import pytest
from brepgaussian.splatting.concave import Images, floors, open_levels
from brepgaussian.splatting.concave.planes import Plane
from brepgaussian.splatting.sample import sample
from build123d import Align, Box, Cylinder, Pos, Rot
from rendered import rendered, silhouette_volume

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
RADIUS, THICK, HUB, HIGH, WIDE = 30.0, 5.0, 8.0, 12.0, 4.0
BOTTOM = Plane(np.array([0.0, 0.0, -1.0]), 0.0)


def impeller(count):
    """A disc with a hub and `count` vanes from it to near the rim."""
    body = Cylinder(RADIUS, THICK, align=LOW) + Cylinder(HUB, THICK + HIGH, align=LOW)
    for k in range(count):
        body += Rot(0, 0, 360 * k / count) * Pos(14, 0, 0) * Box(24, WIDE, THICK + HIGH, align=LOW)
    return body


def around(count, radius, angle, height, truth):
    """(count, 3) places in the unit frame, at an angle past each vane, mm and degrees."""
    turns = np.radians(360 * np.arange(count) / count + angle)
    places = np.column_stack([radius * np.cos(turns), radius * np.sin(turns), np.full(count, height)])
    low, high = truth.mesh_vertices.min(axis=0), truth.mesh_vertices.max(axis=0)
    return (low + high) / 2 * [1, 1, 0] + [0, 0, low[2]] + places / (2 * RADIUS)


def fields(volume, places):
    """(N,) of a volume at places (N, 3)."""
    return sample(volume.field, (places - volume.origin) / volume.spacing, -1.0)


@pytest.mark.parametrize("count", [3, 5])
def test_rooms_between_vanes_are_opened_down_to_the_disc(tmp_path, count):
    views, truth = rendered(tmp_path, impeller(count), 40)
    hull = silhouette_volume(views, 96)
    bottom = Plane(BOTTOM.normal, -float(truth.mesh_vertices[:, 2].min()))
    opened = open_levels(Images.of(views), hull, [bottom])
    middle, near = 180 / count, 1.5
    rooms = around(count, 20, middle, THICK + near, truth)
    assert (fields(hull, rooms) > 0).any()  # silhouettes do not show it
    assert (fields(opened, rooms) < 0).all()
    assert (fields(opened, around(count, 20, middle, THICK - near, truth)) > 0).all()
    assert (fields(opened, around(count, 20, 0, THICK + HIGH / 2, truth)) > 0).all()  # the vanes
    assert (fields(opened, around(count, HUB - near, middle, THICK + HIGH / 2, truth)) > 0).all()
    height = float(truth.mesh_vertices[:, 2].min()) + THICK / (2 * RADIUS)
    images = Images.of(views)
    start = floors.Floor.of(images, hull, Plane(-BOTTOM.normal, height - 3 * hull.spacing))
    settled = start.settled(images, start.room(images), floors.COARSELY, floors.FINELY)
    assert settled.lattice.offset == pytest.approx(height, abs=hull.spacing / 2)


def test_pockets_are_left_to_their_outlines(tmp_path):
    part = Box(40, 40, 20, align=LOW) - Pos(0, 0, 12) * Box(24, 20, 8, align=LOW)
    views, truth = rendered(tmp_path, part, 40)
    hull, images = silhouette_volume(views, 96), Images.of(views)
    low = truth.mesh_vertices.min(axis=0)
    planes = [Plane(BOTTOM.normal, -float(low[2]))]
    inside = low + np.array([[20, 20, 13.5]]) / 40
    assert (fields(hull, inside) > 0).all()
    assert open_levels(images, hull, planes) is hull


def test_a_step_is_no_room(tmp_path):
    """What all views show to be there stays, however alike its top and the floor are."""
    views, truth = rendered(tmp_path, Box(40, 40, 10, align=LOW) + Pos(4, 0, 10) * Box(20, 24, 3, align=LOW), 40)
    hull, images = silhouette_volume(views, 96), Images.of(views)
    low = truth.mesh_vertices.min(axis=0)
    planes = [Plane(BOTTOM.normal, -float(low[2])), Plane(-BOTTOM.normal, float(low[2] + 10 / 40))]
    step = low + np.array([[x, y, 11.5] for x in (16, 24, 32) for y in (10, 20, 30)]) / 40
    assert (fields(open_levels(images, hull, planes), step) > 0).all()


def test_agreement_is_the_share_of_views_that_show_what_half_of_them_do():
    rng = np.random.default_rng(5)
    grey = rng.integers(0, 12, (9, 40)).astype(np.float32)
    grey[rng.random(grey.shape) < 0.3] = np.nan
    grey[rng.random(grey.shape) < 0.2] = -1.0
    grey[:, 0] = np.nan
    share, count = floors._agreement(grey, 2.0)
    for k in range(grey.shape[1]):
        seen = np.sort(grey[np.isfinite(grey[:, k]), k])
        assert count[k] == len(seen)
        if len(seen):
            common = seen[(len(seen) - 1) // 2] if len(seen) % 2 else seen[len(seen) // 2]
            half = seen[len(seen) // 2] if len(seen) % 2 == 0 else common
            near = [
                np.mean((np.abs(seen - c) <= 2.0) & (seen >= 0)) for c in (common, half, seen[(len(seen) - 1) // 2])
            ]
            assert any(share[k] == pytest.approx(n) for n in near)
    assert share[0] == 0.0
