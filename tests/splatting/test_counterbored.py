"""Counterbores in curved faces, about the mouths of holes that are known."""

import numpy as np
import pytest
from brepgaussian.splatting.concave import Images
from brepgaussian.splatting.concave.counterbored import counterbored
from brepgaussian.splatting.concave.curved import spot_around
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
    (found,) = counterbored(Images.of(views, 0.0), hull.scene(), hull.spacing, [known(aside)])
    bottom = found.middle - found.depth * found.lattice.normal
    assert found.lattice.normal == pytest.approx(WAY, abs=0.01)
    assert np.sqrt(found.area / np.pi) == pytest.approx(wide / SIZE, abs=0.004)
    assert bottom[0] == pytest.approx(0.5 + aside / SIZE, abs=0.004)
    assert bottom[1] == pytest.approx(0.5 - floor / SIZE, abs=0.008)


def test_a_hole_as_wide_all_along_has_none(tmp_path):
    views, _ = rendered(tmp_path, drum(6.0, 0.0, 0.0), 40, 500)
    hull = hull_of(6.0)
    assert counterbored(Images.of(views, 0.0), hull.scene(), hull.spacing, [known(6.0)]) == []


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
