"""A patch over an inner edge may be a skin; the floor of a slot, a chamfer and a large face are none."""

import numpy as np
import pytest
from brepgaussian.brep.explanations import bared
from brepgaussian.brep.job import Job
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.skins import ramps, skins
from brepgaussian.geometry.surfaces import cylinder, plane
from brepgaussian.settings.brep import BrepSettings

NOISE = 0.001
RNG = np.random.default_rng(0)


def strip(middle, normal, along, width, length=0.5, count=400, sigma=NOISE):
    """A rectangle of points with its plane."""
    normal, along = (np.asarray(v, float) / np.linalg.norm(v) for v in (normal, along))
    across = np.cross(normal, along)
    u, v, w = RNG.uniform(-0.5, 0.5, (3, count))
    xyz = np.asarray(middle) + np.outer(u * length, along) + np.outer(v * width, across)
    xyz += 2 * sigma * np.outer(w, normal)
    return Patch(plane(middle, normal), 0, xyz, np.tile(normal, (count, 1)), 0.03, sigma)


def corner(angle_deg, side):
    """Two walls along y, at x = 0 and z = 0, and a strip over the edge: `side` 1 in the air, -1 in the material."""
    lean = np.array([np.sin(np.radians(angle_deg)), 0.0, np.cos(np.radians(angle_deg))])
    walls = [
        strip([0, 0, side * 0.25], [1, 0, 0], [0, 1, 0], 0.4, count=4000),
        strip([side * 0.25, 0, 0], [0, 0, 1], [0, 1, 0], 0.4, count=4000),
    ]
    return [*walls, strip(side * 0.05 * lean, lean, [0, 1, 0], 0.08, count=60, sigma=3 * NOISE)]


@pytest.mark.parametrize("angle", [30, 45, 60])
def test_a_strip_over_an_inner_edge_may_be_a_skin(angle):
    assert skins(corner(angle, 1)) == (2,)


@pytest.mark.parametrize("angle", [30, 45, 60])
def test_a_chamfer_on_an_outer_edge_is_none(angle):
    assert skins(corner(angle, -1)) == ()


def test_the_floor_of_a_slot_is_none():
    walls = [strip([s * 0.05, 0, 0.2], [-s, 0, 0], [0, 1, 0], 0.4, count=4000) for s in (-1, 1)]
    assert skins([*walls, strip([0, 0, 0], [0, 0, 1], [0, 1, 0], 0.1, count=60, sigma=3 * NOISE)]) == ()


def test_a_large_strip_that_fits_is_a_face():
    patches = corner(45, 1)
    patches[2] = strip([0.02, 0, 0.02], [1, 0, 1], [0, 1, 0], 0.08, count=400)
    assert skins(patches) == ()


def test_a_job_without_its_skins_keeps_them_as_evidence():
    patches = tuple(corner(45, 1))
    (job,) = bared(Job(patches, (), np.zeros((0, 3)), (), None, BrepSettings()))
    assert job.patches == patches[:2]
    assert job.left_out == patches[2:]
    assert list(bared(job)) == []


@pytest.mark.parametrize(("radius", "found"), [(0.02, (2,)), (0.09, ())])
def test_a_fillet_deeper_than_a_hull_rounds_is_a_face(radius, found):
    walls = corner(45, 1)[:2]
    turn, along = RNG.uniform(np.pi, 1.5 * np.pi, 60), RNG.uniform(-0.25, 0.25, 60)
    outward = -np.column_stack([np.cos(turn), np.zeros(60), np.sin(turn)])
    axis = np.array([radius, 0.0, radius])
    xyz = axis - radius * outward + np.outer(along, [0, 1, 0])
    fillet = cylinder(axis, np.array([0, 1.0, 0]), radius, flipped=True)
    assert skins([*walls, Patch(fillet, 0, xyz, outward, 0.03, NOISE)]) == found


def beside_a_fillet(side, round_=True):
    """A floor z = 0, an inner fillet (or a plane as steep) that touches it, and a strip across: `side` 1 in the air."""
    angle = np.radians(RNG.uniform(20, 90, 1500))
    normals = np.column_stack([np.sin(angle), np.zeros(1500), np.cos(angle)])
    xyz = np.array([0.2, 0, 0.2]) - 0.2 * normals + RNG.uniform(-0.25, 0.25, 1500)[:, None] * [0, 1, 0]
    fillet = Patch(cylinder((0.2, 0, 0.2), (0, 1, 0), 0.2).flip(), 0, xyz, normals, 0.03, NOISE)
    if not round_:
        fillet = strip([0.1, 0, 0.02], [np.sin(0.25), 0, np.cos(0.25)], [0, 1, 0], 0.2, count=1500)
    floor = strip([0.5, 0, 0], [0, 0, 1], [0, 1, 0], 0.5, count=4000)
    lean = np.array([0.1, 0, 1])
    return [fillet, floor, strip([0.19, 0, side * 0.006], lean, [0, 1, 0], 0.11, count=80)]


def test_a_strip_that_cuts_across_where_a_fillet_begins_may_be_a_ramp():
    assert ramps(beside_a_fillet(1)) == (2,)
    assert skins(beside_a_fillet(1)) == ()


def test_a_strip_below_both_or_between_planes_is_no_ramp():
    assert ramps(beside_a_fillet(-1)) == ()
    assert ramps(beside_a_fillet(1, round_=False)) == ()
    assert ramps(corner(45, 1)) == ()


def test_a_job_without_its_ramps():
    patches = tuple(beside_a_fillet(1))
    (job,) = bared(Job(patches, (), np.zeros((0, 3)), (), None, BrepSettings()))
    assert job.patches == patches[:2]
    assert job.left_out == patches[2:]
