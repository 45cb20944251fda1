"""Bundled parts around one axis that are not turned alone: splines, wings, hexagons, eccentrics, a bowl."""

from build123d import (
    Align,
    Axis,
    Box,
    Cone,
    Cylinder,
    Part,
    Plane,
    Pos,
    Rot,
    SlotOverall,
    Sphere,
    chamfer,
    extrude,
)

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM, hexagon
from brepgaussian.views.parts.sizes import Sizes


def spline_hub(s: Sizes) -> Part:
    """A flanged hub whose bore has six grooves, four holes in the flange."""
    hub, high, rim, thick, bore = s(20, 0.06), s(26), s(32, 0.06), s(7), s(9)
    body = Cylinder(hub, high, align=BOTTOM) + Cylinder(rim, thick, align=BOTTOM) - Cylinder(bore, BEYOND)
    for k in range(6):
        body -= Rot(0, 0, 60 * k) * Pos(bore, 0, 0) * Box(s(5, 0), s(4.5, 0), BEYOND)
    for k in range(4):
        body -= Rot(0, 0, 45 + 90 * k) * Pos((hub + rim) / 2, 0, 0) * Cylinder(s(2.6, 0), BEYOND)
    return body


def wing_nut(s: Sizes) -> Part:
    """A bored hub that tapers, between two wings with round ends."""
    foot, top, high, bore, reach, thick = s(11, 0.06), s(9, 0.06), s(15), s(5), s(26), s(5)
    wings = Pos(0, 0, high * 0.75) * extrude(Plane.XZ * SlotOverall(2 * reach, s(16)), thick / 2, both=True)
    return Cone(foot, top, high, align=BOTTOM) + wings - Cylinder(bore, BEYOND)


def gland_nut(s: Sizes) -> Part:
    """A hexagon over a spigot with a groove, a conical seat above a bore."""
    apothem, high, spigot, long, groove = s(15), s(11), s(11, 0.1), s(20), s(9, 0.05)
    wide, bore, seat, deep = s(3.5), s(5.5), s(9), s(6)
    body = hexagon(apothem, high) + Pos(0, 0, -long) * Cylinder(spigot, long, align=BOTTOM)
    ring = Cylinder(spigot + 1, wide, align=BOTTOM) - Cylinder(groove, wide, align=BOTTOM)
    body = body - Pos(0, 0, -wide) * ring - Cylinder(bore, BEYOND)
    return body - Pos(0, 0, high - deep) * Cone(bore, seat, deep, align=BOTTOM)


def hex_standoff(s: Sizes) -> Part:
    """A hexagonal standoff, a chamfered stud on one end, a blind bore in the other."""
    apothem, high, stud, long, bore, deep = s(12), s(40), s(6), s(16), s(5.5), s(18)
    body = hexagon(apothem, high) + Pos(0, 0, high) * Cylinder(stud, long, align=BOTTOM)
    body = chamfer(body.faces().sort_by(Axis.Z)[-1].edges(), s(1.5))
    return body - Cylinder(bore, deep, align=BOTTOM)


def eccentric_shaft(s: Sizes) -> Part:
    """A shaft with an eccentric journal between two collars, a keyway with round ends."""
    shaft, first, collar, thick = s(9, 0.06), s(22, 0.06), s(15, 0.06), s(5)
    aside, journal, long = s(3.5), s(10, 0.06), s(14)
    body = Cylinder(shaft, first, align=BOTTOM)
    body += Pos(0, 0, first) * Cylinder(collar, thick, align=BOTTOM)
    body += Pos(aside, 0, first + thick) * Cylinder(journal, long, align=BOTTOM)
    body += Pos(0, 0, first + thick + long) * Cylinder(collar, thick, align=BOTTOM)
    body += Pos(0, 0, first + 2 * thick + long) * Cylinder(shaft, s(12), align=BOTTOM)
    key = extrude(Plane.YZ * SlotOverall(s(14, 0.05), s(4.5), rotation=90), shaft * 2)
    return body - Pos(shaft - s(3), 0, first * 0.45) * key


def bowl_flange(s: Sizes) -> Part:
    """A spherical bowl below a flange with three holes, open at its lowest."""
    inner, wall, rim, thick = s(24, 0.03), s(4, 0.05), s(34, 0.03), s(6, 0.1)
    body = Sphere(inner + wall) - Box(BEYOND, BEYOND, BEYOND, align=BOTTOM)
    body += Pos(0, 0, -thick) * Cylinder(rim, thick, align=BOTTOM)
    body -= Sphere(inner)
    for k in range(3):
        body -= Rot(0, 0, 120 * k) * Pos((rim + inner + wall) / 2, 0, 0) * Cylinder(s(1.9, 0), BEYOND)
    low = (Align.CENTER, Align.CENTER, Align.MAX)
    return body - Pos(0, 0, -inner - s(1, 0)) * Box(BEYOND, BEYOND, BEYOND, align=low)
