"""Planes that go on in cones: chamfers along rounded outlines, drafted pockets with rounded corners."""

import pytest
from brepgaussian.brep.benchmark import Case, run_case, truth_of
from brepgaussian.brep.worker import Worker
from brepgaussian.settings.brep import BrepSettings
from build123d import (
    Align,
    Axis,
    Box,
    Cone,
    Cylinder,
    GeomType,
    Pos,
    RectangleRounded,
    SlotOverall,
    chamfer,
    extrude,
    fillet,
)

LOW = (Align.CENTER, Align.CENTER, Align.MIN)


def chamfered_plate():
    plate = extrude(RectangleRounded(50, 34, 8), 9)
    return chamfer(plate.edges().group_by(Axis.Z)[-1], 1.5)


def drafted_pocket():
    return Box(50, 40, 16, align=LOW) - Pos(0, 0, 16) * extrude(RectangleRounded(36, 26, 6), -10, taper=8)


def tapered_boss():
    """With a fillet at its foot, a torus that touches the cone and the plate."""
    part = Box(40, 40, 6, align=LOW) + Pos(0, 0, 6) * Cone(12, 9, 16, align=LOW)
    return fillet(part.edges().filter_by(GeomType.CIRCLE).sort_by(Axis.Z)[0], 3)


def chamfered_link():
    """No end tells the chamfers' direction: it is that of the line between the cones."""
    link = extrude(SlotOverall(44, 14), 8)
    return chamfer(link.edges().group_by(Axis.Z)[-1], 1.2) - Pos(15, 0) * Cylinder(3, 50)


@pytest.mark.parametrize(
    ("draw", "sigma"),
    [(chamfered_plate, 0.003), (drafted_pocket, 0.005), (tapered_boss, 0.005), (chamfered_link, 0.003)],
)
def test_noise_tears_no_face_from_the_cones_beside_it(draw, sigma):
    """A plane off its cone by a thousandth leaves a slit, or lines that miss each other's corners."""
    truth, views = truth_of(draw().solid().wrapped, "drawn")
    with Worker() as worker:
        case = Case("drawn", sigma, 0.03, "none", 7)
        row = run_case(case, truth, views, worker, BrepSettings(), "drawn")
    assert row["reason"] == ""
    assert row["rung"] == "support"
    assert row["topology_match"]
    assert row["volume_iou"] > 0.99
