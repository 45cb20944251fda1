"""Bundled parts bent or turned from rod, wire and thin sheet: hooks, links, U bolts, rings, funnels, tees of pipe."""

from math import radians, tan

from build123d import (
    Axis,
    Box,
    Circle,
    Cylinder,
    Part,
    Plane,
    Pos,
    RectangleRounded,
    Rot,
    Sphere,
    Torus,
    chamfer,
    extrude,
    revolve,
)

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM, hexagon
from brepgaussian.views.parts.sizes import Sizes
from brepgaussian.views.parts.turned import turn


def bow(bend: float, rod: float, angle: float) -> Part:
    """A bent round rod: a circle at (bend, 0) in the xz plane, revolved by `angle` degrees about z."""
    return revolve(Plane.XZ * Pos(bend, 0) * Circle(rod), Axis.Z, angle)


def j_hook(s: Sizes) -> Part:
    """A round rod bent to a J, with a ball for its tip and a threaded end that is thinner."""
    rod, bend, long, thin, stud = s(5, 0.1), s(18), s(34), s(3.6, 0.08), s(16)
    body = Pos(bend, 0, 0) * Cylinder(rod, long, align=BOTTOM) + Rot(-90, 0, 0) * bow(bend, rod, 180)
    body += Pos(-bend, 0, 0) * Sphere(rod)
    return body + Pos(bend, 0, long) * Cylinder(thin, stud, align=BOTTOM)


def u_bolt(s: Sizes) -> Part:
    """A U of round rod with chamfered ends."""
    rod, bend, long, edge = s(5, 0.1), s(20), s(38), s(1.2)
    body = Rot(90, 0, 0) * bow(bend, rod, 180)
    for x in (-1, 1):
        leg = Pos(x * bend, 0, -long) * Cylinder(rod, long, align=BOTTOM)
        body += chamfer(leg.faces().sort_by(Axis.Z)[0].edges(), edge)
    return body


def chain_link(s: Sizes) -> Part:
    """A link of a chain: two half rings of round rod and two straight rods between."""
    rod, bend, long = s(5.5, 0.1), s(14), s(30)
    body = Part()
    for k in (0, 1):
        body += Rot(0, 0, 180 * k) * Pos(0, long / 2, 0) * bow(bend, rod, 180)
        body += Pos((2 * k - 1) * bend, 0, 0) * Rot(90, 0, 0) * Cylinder(rod, long)
    return body


def tee_handle(s: Sizes) -> Part:
    """A cross bar with round ends on a stem with a hexagonal foot."""
    bar, half, stem, long, foot = s(7, 0.1), s(26), s(5.5, 0.06), s(44), s(9, 0.06)
    low = s(12)
    body = Rot(0, 90, 0) * Cylinder(bar, 2 * half)
    for x in (-1, 1):
        body += Pos(x * half, 0, 0) * Sphere(bar)
    body += Pos(0, 0, -long) * Cylinder(stem, long, align=BOTTOM)
    return body + Pos(0, 0, -long - low) * hexagon(foot, low)


def dumb_bell(s: Sizes) -> Part:
    """Two unequal balls on a bar, each with a flat at its end."""
    bar, a, b, span, flat = s(6), s(15), s(12), s(52), s(0.85, 0.06)
    body = Rot(0, 90, 0) * Cylinder(bar, span)
    for x, r in ((-1, a), (1, b)):
        ball = Pos(x * span / 2, 0, 0) * Sphere(r)
        body += ball - Pos(x * (span / 2 + r * flat + 100), 0, 0) * Box(200, 200, 200)
    return body


def hand_wheel(s: Sizes) -> Part:
    """A ring of round rod, three flat spokes, a bored hub."""
    ring, rod, hub, high, bore, wide, thick = s(34), s(5.5), s(10), s(18), s(5), s(9), s(5)
    body = Torus(ring, rod) + Cylinder(hub, high)
    for k in range(3):
        body += Rot(0, 0, 120 * k) * Pos(ring / 2, 0, 0) * Box(ring, wide, thick)
    return body - Cylinder(bore, BEYOND)


def funnel(s: Sizes) -> Part:
    """A thin cone over a thin tube, with a brim."""
    tube, mouth, wall, long, high, brim, lip = s(7), s(30), s(2.6, 0.1), s(22), s(26), s(5), s(3)
    slope = wall * 1.3
    return turn(
        (tube - wall, 0), (tube, 0), (tube, long), (mouth, long + high), (mouth + brim, long + high),
        (mouth + brim, long + high + lip), (mouth - slope, long + high + lip), (tube - wall, long + lip),
    )  # fmt: skip


def spring_washer(s: Sizes) -> Part:
    """A conical washer: two cones of one angle, two flat ends, slots from its bore."""
    bore, rim, thick, rise = s(12), s(30), s(3.5, 0.1), s(8)
    body = turn((bore, rise), (rim, 0), (rim, thick), (bore, rise + thick))
    for k in range(4):
        body -= Rot(0, 0, 90 * k) * Pos(bore, 0, 0) * Box(s(14, 0), s(5, 0), BEYOND)
    return body


def pipe_tee(s: Sizes) -> Part:
    """A pipe with a branch of less width, flanged at the branch, beaded at both ends."""
    out, wall, half, branch, reach = s(14, 0.06), s(3.5), s(34), s(10, 0.06), s(30)
    bead, wide, rim, thick = s(2.5), s(7), s(19, 0.05), s(6)
    body = Rot(0, 90, 0) * Cylinder(out, 2 * half) + Cylinder(branch, reach, align=BOTTOM)
    for x in (-1, 1):
        body += Pos(x * (half - wide / 2), 0, 0) * Rot(0, 90, 0) * Cylinder(out + bead, wide)
    body += Pos(0, 0, reach) * Cylinder(rim, thick, align=BOTTOM)
    body -= Rot(0, 90, 0) * Cylinder(out - wall, BEYOND)
    return body - Cylinder(branch - wall, BEYOND, align=BOTTOM)


def bent_rod(s: Sizes) -> Part:
    """A flat-ended rod with one bend of a right angle and an eye forged at one end."""
    rod, bend, a, b = s(6, 0.1), s(16), s(26), s(34)
    eye, hole, thick = s(13, 0.08), s(6), s(9, 0.1)
    body = Pos(bend, 0, 0) * Rot(0, 90, 0) * Cylinder(rod, a, align=BOTTOM)
    body += Pos(bend, 0, bend) * Rot(90, 0, 0) * Rot(0, 0, 180) * bow(bend, rod, 90)
    body += Pos(0, 0, bend) * Cylinder(rod, b, align=BOTTOM)
    at = Pos(bend + a + eye * 0.6, 0, 0) * Rot(90, 0, 0)
    return body + at * Cylinder(eye, thick) - at * Cylinder(hole, BEYOND)


def wedge_pin(s: Sizes) -> Part:
    """A taper pin with a ball end and a slot across its wide end."""
    thin, long, slant = s(7), s(60), s(4)
    wide = thin + long * tan(radians(slant))
    body = turn((0, 0), (thin, 0), (wide, long), (0, long)) + Sphere(thin)
    return body - Pos(0, 0, long) * Box(s(4), BEYOND, s(10))


def ring_bolt(s: Sizes) -> Part:
    """An eye of round rod on a collar and a stud."""
    ring, rod, collar, low, stud, long = s(16), s(5), s(11), s(5), s(6), s(26)
    body = Rot(90, 0, 0) * Torus(ring, rod)
    body += Pos(0, 0, -ring - rod * 0.6 - low) * Cylinder(collar, low + rod * 0.6, align=BOTTOM)
    return body + Pos(0, 0, -ring - rod * 0.6 - low - long) * Cylinder(stud, long, align=BOTTOM)


def cable_gland(s: Sizes) -> Part:
    """A rounded-square body between a hexagon and a spigot, bored through in two widths."""
    side, high, corner, apothem, up = s(30, 0.06), s(14), s(6, 0.08), s(12, 0.05), s(9)
    body = extrude(RectangleRounded(side, side, corner), high) + Pos(0, 0, high) * hexagon(apothem, up)
    spigot = s(14)
    body += Pos(0, 0, -spigot) * Cylinder(s(10.5, 0.05), spigot, align=BOTTOM)
    body -= Cylinder(s(5, 0.1), BEYOND)
    return body - Pos(0, 0, high + up - s(12)) * Cylinder(s(8, 0.08), BEYOND, align=BOTTOM)
