"""Depths of blind holes along walls that were drawn, on blocks of sizes that nothing was tuned on."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.splatting.concave import Prism
from brepgaussian.splatting.concave.prism import Lattice
from brepgaussian.splatting.concave.sections import Rounded, Section
from brepgaussian.splatting.concave.sounded import finer, sounded
from brepgaussian.splatting.hull import carve
from build123d import Align, Box, Cylinder, Pos, Rot
from rendered import rendered

PITCH = 0.01


def hole() -> Prism:
    """A round hole of a radius of .082 in the plane z = .5, .2 deep."""
    section = Section((19.5, 14.5), 0.0, Rounded((8.2, 8.2), 8.2), at_rim=True)
    lattice = Lattice(np.array([0.3, 0.3, 0.5]), *np.eye(3), PITCH, (40, 30))
    outline = section.signed_distance(np.stack(np.indices((40, 30)), axis=-1)) < 0
    return Prism(lattice, outline, 0.2, False, 0.0, section=section)


def test_finer_cells_draw_the_same_section():
    prism = hole()
    fine, places, inside = finer(prism)
    np.testing.assert_allclose(prism.lattice.coordinates(fine.centers()[3, 5][None])[0][0], places[3, 5], atol=1e-9)
    assert abs(inside.sum() * fine.pitch**2 - np.pi * 0.082**2) < 0.02 * np.pi * 0.082**2
    middle = fine.centers()[inside].mean(axis=0)
    assert np.allclose(middle, prism.lattice.centers()[prism.outline].mean(axis=0), atol=1e-9)


@pytest.mark.parametrize(
    "other", [{"through": True}, {"domed": True}, {"section": None}, {"draft": 0.2}, {"tilt": (0.1, 0.0)}]
)
def test_only_flat_floors_between_straight_walls_are_sounded(other):
    prism = replace(hole(), **other)
    assert sounded(None, None, prism) is prism  # no image is asked


@pytest.mark.parametrize(("radius", "depth", "port"), [(6.5, 9.5, 8.0), (5.5, 9.0, 7.0)])
def test_floors_of_blind_holes_lie_where_they_are(tmp_path, radius, depth, port):
    """The walls of the first guess are two cells off; the depth that was right for them is not."""
    low = (Align.CENTER, Align.CENTER, Align.MIN)
    block = Box(56, 38, 31, align=low)
    block -= Pos(0, 19, 15) * Rot(90, 0, 0) * Cylinder(radius, depth, align=low)
    block -= Pos(3, -19, 14) * Rot(-90, 0, 0) * Cylinder(port, 7.5, align=low)
    views, _ = rendered(tmp_path, block, 50, 800)
    hull, _ = carve(views, 128, concavities=True)
    depths = {round(float(p.lattice.normal[1])): p.depth * 56 for p in hull.prisms}
    assert set(depths) == {1, -1}
    assert abs(depths[1] - depth) < 0.1
    assert abs(depths[-1] - 7.5) < 0.1


def test_holes_that_go_on_narrower_end_in_a_shoulder(tmp_path):
    """Into a bore across, so that nothing shows through."""
    low = (Align.CENTER, Align.CENTER, Align.MIN)
    block = Box(66, 34, 30, align=low) - Pos(0, 0, 14) * Rot(0, 90, 0) * Cylinder(6.5, 66)
    for x in (-17, 17):
        block -= Pos(x, 0, 14) * Cylinder(4.5, 16, align=low) + Pos(x, 0, 25) * Cylinder(7.5, 5, align=low)
    views, _ = rendered(tmp_path, block, 50, 800)
    hull, _ = carve(views, 128, concavities=True)
    above = [p for p in hull.prisms if p.lattice.normal[2] > 0.99]
    wide = [p for p in above if p.area * 66**2 > 140]
    narrow = [p for p in above if p.area * 66**2 < 80]
    assert len(wide) == len(narrow) == 2
    assert all(abs(p.depth * 66 - 5) < 0.25 for p in wide)
    assert all(abs(np.sqrt(p.area * 66**2 / np.pi) - 4.5) < 0.3 for p in narrow)
    assert all(p.depth * 66 > 5 for p in narrow)  # down to the bore, at least
