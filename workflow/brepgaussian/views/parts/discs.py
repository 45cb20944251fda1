"""Bundled parts that are round or made of arcs: sockets, curved slots, ring and oil grooves, teeth, link plates."""

from math import cos, pi, sin

from build123d import (
    Axis,
    Box,
    CenterArc,
    Cylinder,
    Part,
    Polygon,
    Pos,
    Rot,
    SlotArc,
    SlotOverall,
    Sphere,
    chamfer,
    extrude,
)

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM, hexagon
from brepgaussian.views.parts.sizes import Sizes
from brepgaussian.views.parts.turned import turn


def socket_screw(s: Sizes) -> Part:
    """A screw with a round chamfered head and a hexagonal socket in it."""
    head, high, stem, long, edge = s(14, 0.06), s(15), s(8.5, 0.06), s(32), s(1.6)
    body = turn((0, 0), (head, 0), (head, high - edge), (head - edge, high), (0, high))
    body += Pos(0, 0, -long) * Cylinder(stem, long, align=BOTTOM)
    body = chamfer(body.faces().sort_by(Axis.Z)[0].edges(), s(1.4))
    deep = s(8)
    return body - Pos(0, 0, high - deep) * hexagon(s(6.5, 0.08), deep)


def arc_disc(s: Sizes) -> Part:
    """A disc with two curved slots around a bored boss, and a stop pin."""
    rim, thick, hub, high, bore = s(36, 0.06), s(8), s(12, 0.08), s(18), s(6)
    body = Cylinder(rim, thick, align=BOTTOM) + Cylinder(hub, high, align=BOTTOM) - Cylinder(bore, BEYOND)
    mid, wide, sweep = (rim + hub) / 2, s(8), s(70, 0.1)
    for turned_by in (0, 180):
        arc = SlotArc(CenterArc((0, 0), mid, turned_by - sweep / 2, sweep), wide)
        body -= extrude(arc, BEYOND, both=True)
    return body + Pos(0, mid, thick) * Cylinder(s(4), s(7), align=BOTTOM)


def piston(s: Sizes) -> Part:
    """A piston: two ring grooves, hollow from below, a cross hole for its pin, a chamfered crown."""
    r, high, wall, deep, edge = s(24, 0.06), s(42), s(5), s(30, 0.05), s(2)
    body = turn((0, 0), (r, 0), (r, high - edge), (r - edge, high), (0, high))
    for k in (0, 1):
        z = high - s(6, 0) - k * s(6, 0)
        body -= turn((r - 2, z), (r + 1, z), (r + 1, z - 2.6), (r - 2, z - 2.6))
    body -= Cylinder(r - wall, deep, align=BOTTOM)
    return body - Pos(0, 0, s(14)) * Rot(90, 0, 0) * Cylinder(s(6.5), BEYOND)


def oil_washer(s: Sizes) -> Part:
    """A thrust washer with four radial oil grooves on top, chamfered outside."""
    rim, bore, thick, edge = s(32, 0.06), s(15), s(9), s(1.8)
    body = turn((bore, 0), (rim, 0), (rim, thick - edge), (rim - edge, thick), (bore, thick))
    for k in range(4):
        body -= Rot(0, 0, 90 * k) * Pos(rim / 2 + bore / 2, 0, thick) * Box(rim, s(5, 0), s(5, 0))
    return body


def ratchet_wheel(s: Sizes) -> Part:
    """A ratchet wheel with twelve saw teeth, a keyed bore."""
    rim, depth, thick, bore, n = s(34, 0.06), s(6), s(12), s(9), 12
    points: list[tuple[float, float]] = []
    for k in range(n):
        turned = 2 * pi * k / n
        points += [(r * cos(turned), r * sin(turned)) for r in (rim, rim - depth)]
    body = extrude(Polygon(*points, align=None), thick, dir=(0, 0, 1)) - Cylinder(bore, BEYOND)
    return body - Pos(bore, 0, 0) * Box(s(5), s(5), BEYOND)


def chain_plate(s: Sizes) -> Part:
    """A link plate like an eight, waisted by two round cuts, two bores."""
    span, r, thick, bore, waist = s(46), s(17), s(8), s(7), s(22)
    body = extrude(SlotOverall(span + 2 * r, 2 * r), thick)
    for y in (-1, 1):
        body -= Pos(0, y * (waist + r * 0.62), 0) * Cylinder(waist, BEYOND)
    for x in (-1, 1):
        body -= Pos(x * span / 2, 0, 0) * Cylinder(bore, BEYOND)
    return body


def bearing_cover(s: Sizes) -> Part:
    """A cover with a spigot, a recess for a seal below, a bore and six holes."""
    rim, thick, spigot, deep, bore = s(36, 0.05), s(9), s(24, 0.05), s(8), s(9)
    body = Cylinder(rim, thick, align=BOTTOM) + Pos(0, 0, -deep) * Cylinder(spigot, deep, align=BOTTOM)
    body -= Cylinder(bore, BEYOND)
    body -= Pos(0, 0, -deep) * Cylinder(s(15, 0.05), s(6), align=BOTTOM)
    for k in range(6):
        body -= Rot(0, 0, 60 * k + 15) * Pos((rim + spigot) / 2, 0, 0) * Cylinder(s(2.8, 0), BEYOND)
    return body


def cap_nut(s: Sizes) -> Part:
    """A hexagon under a hemisphere, a blind bore below."""
    apothem, high, dome = s(14, 0.05), s(12), s(12, 0.05)
    cap = Pos(0, 0, high) * (Sphere(dome) & Box(BEYOND, BEYOND, BEYOND, align=BOTTOM))
    return hexagon(apothem, high) + cap - Cylinder(s(6), s(15, 0.05), align=BOTTOM)


def thumb_knob(s: Sizes) -> Part:
    """A knob with six round scallops above a hub, bored."""
    rim, thick, hub, high, scallop = s(28, 0.05), s(13), s(12, 0.08), s(12), s(8)
    body = Cylinder(rim, thick, align=BOTTOM) + Pos(0, 0, -high) * Cylinder(hub, high, align=BOTTOM)
    for k in range(6):
        body -= Rot(0, 0, 60 * k) * Pos(rim + scallop * 0.45, 0, 0) * Cylinder(scallop, BEYOND)
    return body - Cylinder(s(5), BEYOND)


def step_cone(s: Sizes) -> Part:
    """A cone between two cylinders, a cross hole, a bore that steps."""
    a, b, long, mid, end = s(12, 0.06), s(20, 0.06), s(22), s(20), s(16)
    body = turn((0, 0), (a, 0), (a, long), (b, long + mid), (b, long + mid + end), (0, long + mid + end))
    body -= Cylinder(s(5), BEYOND)
    body -= Pos(0, 0, long + mid + end - s(14)) * Cylinder(s(11), BEYOND, align=BOTTOM)
    return body - Pos(0, 0, long * 0.5) * Rot(90, 0, 0) * Cylinder(s(3.5), BEYOND)


def spider(s: Sizes) -> Part:
    """A cube with two long and two short pins, bored along the third axis."""
    side, pin, long, short = s(26, 0.06), s(8), s(16), s(11)
    body = Box(side, side, side)
    for k, reach in enumerate((long, short, long, short)):
        body += Rot(0, 0, 90 * k) * Pos(side / 2, 0, 0) * Rot(0, 90, 0) * Cylinder(pin, reach, align=BOTTOM)
    return body - Cylinder(s(8), BEYOND)
