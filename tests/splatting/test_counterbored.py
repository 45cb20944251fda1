"""Counterbores in curved faces, about the mouths of holes that are known."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.splatting.concave import Images, find
from brepgaussian.splatting.concave.counterbored import _mouths, counterbored
from brepgaussian.splatting.concave.curved import leaning_ways, spot_around
from brepgaussian.splatting.concave.planes import Plane
from brepgaussian.splatting.concave.prism import Lattice, Prism, plane_axes
from brepgaussian.splatting.concave.volume import Volume
from build123d import Align, Cylinder, Pos, Rot
from rendered import rendered

RADIUS, TALL, SIZE = 20.0, 18.0, 40.0  # of a drum, mm: it fills the unit frame
BORE = 2.4
CELLS = 96
WAY = np.array([0, -1.0, 0])  # out of the drum


def drum(aside: float, wide: float, floor: float):
    """A drum with a hole across, `aside` of its axis, that is wider up to a floor at y = -floor."""
    part = Cylinder(RADIUS, TALL) - Pos(aside, 0, 0) * Rot(90, 0, 0) * Cylinder(BORE, 50)
    if wide:
        low = (Align.CENTER, Align.CENTER, Align.MIN)
        part -= Pos(aside, -floor, 0) * Rot(90, 0, 0) * Cylinder(wide, 30, align=low)
    return part


def hull_of(aside: float) -> Volume:
    """What silhouettes and a known hole leave of it."""
    x, y, z = np.moveaxis(
        np.stack(np.meshgrid(*[np.arange(CELLS + 1) / CELLS] * 3, indexing="ij"), axis=-1) - 0.5, -1, 0
    )
    solid = np.minimum(RADIUS / SIZE - np.hypot(x, y), TALL / SIZE / 2 - np.abs(z))
    hole = BORE / SIZE - np.hypot(x - aside / SIZE, z)
    return Volume(np.minimum(solid, -hole).astype(np.float32), np.zeros(3), 1 / CELLS)


def known(aside: float) -> Prism:
    pitch, count = 1 / 200, 41
    first, second = plane_axes(-WAY)
    middle = np.array([0.5 + aside / SIZE, 0.5 + np.sqrt(RADIUS**2 - aside**2) / SIZE, 0.5])
    rows, columns = np.mgrid[:count, :count]
    outline = np.hypot(rows - count // 2, columns - count // 2) * pitch < BORE / SIZE
    origin = middle - (first + second) * pitch * count / 2
    return Prism(Lattice(origin, first, second, -WAY, pitch, (count, count)), outline, 0.9, True, 0.0)


@pytest.mark.parametrize(("aside", "wide", "floor"), [(0.0, 4.2, 11.0), (11.0, 4.6, 7.0)])
def test_a_counterbore_about_a_known_hole_goes_down_to_its_shoulder(tmp_path, aside, wide, floor):
    views, _ = rendered(tmp_path, drum(aside, wide, floor), 40, 500)
    hull = hull_of(aside)
    twice = [known(aside), known(aside)]
    (found,) = counterbored(Images.of(views, 0.0), hull.scene(), hull.spacing, twice)
    bottom = found.middle - found.depth * found.lattice.normal
    assert found.lattice.normal == pytest.approx(WAY, abs=0.01)
    assert np.sqrt(found.area / np.pi) == pytest.approx(wide / SIZE, abs=0.004)
    assert bottom[0] == pytest.approx(0.5 + aside / SIZE, abs=0.004)
    assert bottom[1] == pytest.approx(0.5 - floor / SIZE, abs=0.008)


def test_a_hole_as_wide_all_along_has_none(tmp_path):
    views, _ = rendered(tmp_path, drum(6.0, 0.0, 0.0), 40, 500)
    hull = hull_of(6.0)
    assert counterbored(Images.of(views, 0.0), hull.scene(), hull.spacing, [known(6.0)]) == []


def test_a_mouth_in_a_flat_face_is_left_to_others():
    """A flat on the drum's side in which the hole comes out, another one elsewhere, and one that is not known."""
    hull, side = hull_of(0.0), 0.5 - 0.9 * RADIUS / SIZE
    y = np.arange(CELLS + 1)[None, :, None] / CELLS
    flattened = replace(hull, field=np.minimum(hull.field, (y - side).astype(np.float32)))
    scene, near = flattened.scene(), 2 * hull.spacing
    flat = Plane(WAY, -side)
    ways = [[way for _, way in _mouths(known(0.0), scene, planes, near)] for planes in ([], [flat], [Plane(WAY, -0.3)])]
    assert [len(found) for found in ways] == [2, 1, 2]
    np.testing.assert_allclose(ways[1][0], -WAY)


@pytest.mark.parametrize("lean", [0.0, 30.0, 50.0])
def test_a_curved_face_is_told_square_to_itself_and_seen_along_a_hole(lean):
    """A lattice that leans has its heights on the face, which a polynomial over it could not follow."""
    hull, angle = hull_of(0.0), np.radians(lean)
    middle = np.array([0.5 + 0.5 * np.sin(angle), 0.5 - 0.5 * np.cos(angle), 0.5])
    turn = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    first, second = plane_axes(WAY)
    ring = middle + 0.09 * (np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * second)
    spot = spot_around(ring, hull.scene(), hull.spacing, 1 / 200, WAY)
    places = spot.lattice.centers() - spot.relief[..., None] * spot.lattice.normal
    near = np.linalg.norm((places - middle)[..., [0, 2]], axis=-1) < 0.09
    assert spot.lattice.normal == pytest.approx(WAY)
    assert np.abs(np.hypot(*np.moveaxis(places[near][:, :2] - 0.5, -1, 0)) - 0.5).max() < 0.003


@pytest.mark.parametrize("lean", [30.0, 45.0])
def test_an_oblong_mouth_tells_two_ways_that_its_hole_may_lean(lean):
    angle = np.radians(lean)
    turn, out = np.random.default_rng(3).uniform(0, 1, (2, 4000))
    disc = np.sqrt(out)[:, None] * np.column_stack([np.cos(2 * np.pi * turn), np.sin(2 * np.pi * turn)])
    mouth = np.column_stack([disc[:, 0] / np.cos(angle), disc[:, 1], np.zeros(4000)])
    ways = leaning_ways(mouth, np.array([0, 0, 1.0]))
    for sign in (1, -1):
        true = np.array([sign * np.sin(angle), 0, np.cos(angle)])
        assert max(float(true @ way) for way in ways) > np.cos(np.radians(2.0))
    assert leaning_ways(np.column_stack([disc, np.zeros(4000)]), np.array([0, 0, 1.0])) == []
    assert leaning_ways(np.column_stack([4 * disc[:, 0], disc[:, 1], np.zeros(4000)]), np.array([0, 0, 1.0])) == []


@pytest.mark.parametrize(
    ("way", "snapped"),
    [((0.06, 0.998, 0.0), (0, 1, 0)), ((0.03, 0.02, -0.999), (0, 0, -1)), ((0.7, 0.71, 0.06), (0.702, 0.712, 0))],
)
def test_ways_are_square_to_faces_or_along_them_where_they_nearly_are(way, snapped):
    planes = [Plane(np.array([0, 0, 1.0]), 0.5), Plane(np.array([1.0, 0, 0]), 0.5)]
    assert find._snapped(np.array(way), planes) == pytest.approx(snapped, abs=0.001)


@pytest.mark.parametrize(("error", "leans"), [(0.04, True), (0.1, False)])
def test_a_hole_leans_if_far_fewer_rays_contradict_it(error, leans):
    def told(value):
        return [(replace(known(0.0), error=value), np.zeros((3, 3)))]

    straight, leaning = told(0.12), told(error)
    assert find._told_best(straight, [[], told(0.11), leaning]) is (leaning if leans else straight)
    assert find._told_best([], [leaning]) is leaning
    assert find._told_best(straight, []) is straight


def test_what_silhouettes_have_dug_below_a_spot_does_not_draw_its_face_down():
    """A drum with a pit in its side, deeper than it is wide: the pit's floor is not beside the spot."""
    x, y, z = np.moveaxis(
        np.stack(np.meshgrid(*[np.arange(CELLS + 1) / CELLS] * 3, indexing="ij"), axis=-1) - 0.5, -1, 0
    )
    drum_field = np.minimum(0.5 - 0.02 - np.hypot(x, y), 0.3 - np.abs(z))
    pit = np.minimum(0.07 - np.hypot(x, z), -0.34 - y)
    hull = Volume(np.minimum(drum_field, -pit).astype(np.float32), np.zeros(3), 1 / CELLS)
    turn = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    mouth = np.array([0.5, 0.02, 0.5]) + 0.08 * np.column_stack([np.cos(turn), 0 * turn, np.sin(turn)])
    spot = spot_around(mouth, hull.scene(), hull.spacing, 1 / 200)
    places = spot.lattice.centers() - spot.relief[..., None] * spot.lattice.normal
    over = np.linalg.norm((places - [0.5, 0.02, 0.5])[..., [0, 2]], axis=-1) < 0.09
    assert np.abs(np.hypot(*np.moveaxis(places[over][:, :2] - 0.5, -1, 0)) - 0.48).max() < 0.004


def test_a_hole_in_a_face_that_tapers_may_run_square_to_its_axis():
    top, side = Plane(np.array([0, 0, 1.0]), 0.8), Plane(np.array([0, 1.0, 0]), 0.9)
    tapered = np.array([np.cos(0.1), 0, np.sin(0.1)])
    (way,) = find._across(tapered, [top, side])
    assert way == pytest.approx([1, 0, 0])
    assert find._across(np.array([1.0, 0, 0]), [top, side]) == []
    assert find._across(np.array([0.8, 0, 0.6]), [top, side]) == []


@pytest.mark.parametrize(("errors", "best"), [((0.04, 0.03), 0.03), ((0.04, 0.06), 0.04), ((0.04,), 0.04)])
def test_fewer_rays_tell_which_way_a_hole_runs(errors, best):
    lid = np.zeros((0, 3))
    found = [[(replace(known(0.0), error=error), lid)] for error in errors]
    assert find._least_against([*found, []])[0][0].error == best
    assert find._least_against([[]]) == []
