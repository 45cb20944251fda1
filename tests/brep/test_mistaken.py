"""Fillets whose middle was fitted by something else, against the torus or cylinder that the points were drawn from."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.brep.mistaken import mistaken
from brepgaussian.brep.patches import Patch
from brepgaussian.geometry.rolling import rolling, touching
from brepgaussian.geometry.surfaces import cone, cylinder, plane, unit

NOISE, WALL, TUBE = 0.001, 0.25, 0.05
EX, EY, EZ = np.eye(3)


def patch(surface, xyz, primitive, rng):
    noisy = xyz + rng.normal(0, NOISE, xyz.shape)
    return Patch(surface, primitive, noisy, surface.normals(xyz), 0.02, surface.rms(noisy))


def hub(rng, lean, count=2500):
    """A hub on a flange, and the middle of the fillet between them, fitted by a cone that leans by some degrees."""
    wall, floor = cylinder(np.zeros(3), EZ, WALL), plane(np.zeros(3), EZ)
    right = touching(wall, floor, -TUBE)
    turn, height, out = (
        rng.uniform(0, 2 * np.pi, count),
        rng.uniform(TUBE, 0.3, count),
        rng.uniform(WALL + TUBE, 0.5, count),
    )
    ring = np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
    t = np.radians(rng.uniform(185, 265, count))
    xyz = (WALL + TUBE + TUBE * np.cos(t))[:, None] * ring + (TUBE + TUBE * np.sin(t))[:, None] * EZ
    middle = WALL + TUBE - TUBE / np.sqrt(2)
    axis = unit(-EZ + np.tan(np.radians(lean)) * EX)
    fitted = cone(np.array([0.004 * lean, 0, TUBE - TUBE / np.sqrt(2)]), axis, middle, np.pi / 4)
    return [
        patch(wall, WALL * ring + height[:, None] * EZ, 0, rng),
        patch(floor, out[:, None] * ring, 1, rng),
        replace(patch(right, xyz, 2, rng), surface=fitted),
    ], right


@pytest.mark.parametrize("seed", [7, 8, 9])
def test_a_cone_that_leans_between_a_hub_and_its_flange_is_their_fillet(seed):
    patches, right = hub(np.random.default_rng(seed), 2.5)
    (change,) = mistaken(patches)
    made = change.new[0].surface
    assert change.gone == (2,)
    assert change.smooth
    assert made.kind == "torus"
    assert made.minor == pytest.approx(TUBE, rel=0.03)
    np.testing.assert_allclose(made.signed_distance(right.project(patches[2].xyz)), 0, atol=NOISE)


def test_what_is_a_fillet_already_is_not_asked_about():
    patches, _ = hub(np.random.default_rng(7), 2.5)
    assert len(mistaken(patches, {0, 1})) == 1
    assert mistaken(patches, {2}) == []


def test_a_cone_about_the_hubs_own_axis_is_a_chamfer():
    patches, _ = hub(np.random.default_rng(7), 0.3)
    assert mistaken(patches) == []


def test_what_a_fillet_explains_less_stays():
    """A cylinder that crosses the corner at an angle: its points lie on no ball's way."""
    rng = np.random.default_rng(5)
    patches, _ = hub(rng, 2.5)
    leaning = cylinder(np.array([0.3, 0, 0]), unit(EX + EZ), 0.06)
    around, along = rng.uniform(0, 2 * np.pi, 2500), rng.uniform(-0.1, 0.1, 2500)
    u, v, axis = leaning.frame()
    xyz = leaning.origin + 0.06 * (np.cos(around)[:, None] * u + np.sin(around)[:, None] * v) + along[:, None] * axis
    assert mistaken([*patches[:2], patch(leaning, xyz, 2, rng)]) == []


def test_a_cylinder_that_leans_in_a_corner_of_two_planes_is_their_fillet():
    rng = np.random.default_rng(6)
    floor, wall = plane(np.zeros(3), EZ), plane(np.zeros(3), EX)
    right = rolling(floor, wall, -TUBE)
    turn, y = np.radians(rng.uniform(190, 260, 2000)), rng.uniform(0, 0.15, 2000)
    xyz = np.column_stack([TUBE + TUBE * np.cos(turn), y, TUBE + TUBE * np.sin(turn)])
    out, across = rng.uniform(TUBE, 0.4, 2000), rng.uniform(0, 0.15, 2000)
    leaning = cylinder(np.array([TUBE, 0, TUBE]), unit(EY + 0.05 * EX), TUBE, flipped=True)
    patches = [
        patch(floor, np.column_stack([out, across, 0 * out]), 0, rng),
        patch(wall, np.column_stack([0 * out, across, out]), 1, rng),
        replace(patch(right, xyz, 2, rng), surface=leaning),
    ]
    (change,) = mistaken(patches)
    made = change.new[0].surface
    assert made.kind == "cylinder"
    assert made.flipped
    np.testing.assert_allclose(made.signed_distance(right.project(xyz)), 0, atol=NOISE)
