"""Bundled parts made of surfaces of revolution: shafts, rings, flanges, nuts, fittings."""

from math import acos, cos, pi, radians, sin, tan

from build123d import (
    Axis,
    Box,
    CenterArc,
    Circle,
    Cone,
    Cylinder,
    Line,
    Part,
    Plane,
    Polygon,
    Pos,
    RegularPolygon,
    Rot,
    Sphere,
    Torus,
    extrude,
    fillet,
    make_face,
    revolve,
)

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM, hexagon
from brepgaussian.views.parts.sizes import Sizes


def turn(*points: tuple[float, float]) -> Part:
    """A polygon of (radius, height) points revolved about z."""
    return revolve(Plane.XZ * Polygon(*points, align=None), Axis.Z)


def adapter_stud(s: Sizes) -> Part:
    """A hexagon on a round collar between two studs of different widths, the wider one bored, chamfered ends."""
    apothem, wide, collar, thick = s(14, 0.06), s(9, 0.08), s(17, 0.06), s(4, 0.1)
    below, above, stud, edge = s(20, 0.08), s(24, 0.08), s(7, 0.06), s(1.4)
    low, top = -below, thick + wide + above
    body = hexagon(apothem, wide + thick)
    body += turn((0, 0), (collar, 0), (collar, thick), (0, thick))
    body += turn((0, low), (stud + 2 - edge, low), (stud + 2, low + edge), (stud + 2, 0), (0, 0))
    body += turn((0, thick), (stud, thick), (stud, top - edge), (stud - edge, top), (0, top))
    return body - Pos(0, 0, low) * Cylinder(s(4.5, 0.08), s(12, 0.08), align=BOTTOM)


def valve_stem(s: Sizes) -> Part:
    """A stem with a conical head, a groove around it, a cross hole and two flats at its end."""
    stem, head, edge, low = s(9, 0.08), s(17, 0.06), s(4, 0.1), s(9, 0.1)
    long, groove, deep = s(58, 0.06), s(5, 0.08), s(2, 0.1)
    at = edge + low + long * 0.5
    body = turn(
        (0, 0), (head, 0), (head, edge), (stem, edge + low),
        (stem, at), (stem - deep, at), (stem - deep, at + groove), (stem, at + groove),
        (stem, edge + low + long), (0, edge + low + long),
    )  # fmt: skip
    body -= Pos(0, 0, edge + low + long * 0.25) * Rot(90, 0, 0) * Cylinder(s(3, 0.1), BEYOND)
    flat, top = s(0.6, 0.06) * stem, edge + low + long
    for side in (-1, 1):
        body -= Pos(side * (flat + stem), 0, top) * Box(2 * stem, 4 * stem, s(22, 0.08))
    return body


def hex_nut(s: Sizes) -> Part:
    """A hexagon whose ends are chamfered by cones, bored, the bore chamfered."""
    apothem, height, bore, edge = s(24), s(20), s(12), s(2)
    corner = apothem / cos(pi / 6)
    body = extrude(RegularPolygon(corner, 6), height)
    flat = apothem * s(0.94, 0.04)  # radius of the flat end
    drop = (corner * 1.2 - flat) * tan(radians(30))
    limit = corner * 1.2
    body &= turn((0, 0), (flat, 0), (limit, drop), (limit, height - drop), (flat, height), (0, height))
    body -= Cylinder(bore, BEYOND)
    body -= Cone(bore + edge, bore, edge, align=BOTTOM)
    return body - Pos(0, 0, height - edge) * Cone(bore, bore + edge, edge, align=BOTTOM)


def flange(s: Sizes) -> Part:
    """A disc with a hub, a bore and a bolt circle."""
    radius, thick, hub, high, bolts = s(38, 0.08), s(11), s(18), s(28), s.count(6, 4, 8)
    body = Cylinder(radius, thick, align=BOTTOM) + Cylinder(hub, high, align=BOTTOM)
    body -= Cylinder(s(10.5), BEYOND)
    hole = s(4)
    for i in range(bolts):
        body -= Rot(0, 0, 360 * i / bolts) * Pos((radius + hub) / 2, 0, 0) * Cylinder(hole, BEYOND)
    return body


def stepped_shaft(s: Sizes) -> Part:
    """Three diameters, a chamfered end and a rounded shoulder."""
    a, b, c = s(9), s(14), s(20)
    la, lb, lc, edge = s(24), s(26), s(16), s(2.5)
    body = turn(
        (0, 0), (c, 0), (c, lc), (b, lc), (b, lc + lb), (a, lc + lb), (a, lc + lb + la - edge),
        (a - edge, lc + lb + la), (0, lc + lb + la),
    )  # fmt: skip
    shoulder = [e for e in body.edges() if abs(e.center().Z - lc) < 1e-6 and abs(e.radius - b) < 1e-6]
    return fillet(shoulder, (c - b) * 0.6)


def ball_pin(s: Sizes) -> Part:
    """A pin with a spherical end and a collar."""
    pin, ball, length, collar = s(8), s(15), s(42), s(16)
    body = Cylinder(pin, length, align=BOTTOM) + Cylinder(collar, s(9), align=BOTTOM)
    return body + Pos(0, 0, length) * Sphere(ball)


def ring_groove(s: Sizes) -> Part:
    """A ring with a toroidal groove around it."""
    outer, height = s(30), s(26)
    body = Cylinder(outer, height) - Cylinder(s(16), BEYOND)
    return body - Torus(outer, s(6.5))


def slotted_ring(s: Sizes) -> Part:
    """A ring cut open by a radial slot."""
    outer, height = s(32), s(18)
    body = Cylinder(outer, height) - Cylinder(s(20), BEYOND)
    return body - Pos(outer, 0, 0) * Box(2 * outer, s(11), BEYOND)


def cross_tee(s: Sizes) -> Part:
    """Two pipes of different diameters that cross, both bored."""
    long, side, reach = s(17), s(13), s(38)
    body = Rot(0, 90, 0) * Cylinder(long, s(76)) + Cylinder(side, reach, align=BOTTOM)
    return body - Rot(0, 90, 0) * Cylinder(s(10), BEYOND) - Cylinder(s(7), BEYOND, align=BOTTOM)


def keyed_hub(s: Sizes) -> Part:
    """A hub with a keyway in its bore."""
    radius, thick, hub, bore, key = s(32), s(13), s(20), s(11), s(6.5)
    body = Cylinder(radius, thick, align=BOTTOM) + Cylinder(hub, s(30), align=BOTTOM)
    body -= Cylinder(bore, BEYOND)
    return body - Pos(bore * 0.7, 0, 0) * Box(bore * 1.1, key, BEYOND)


def o_ring_gland(s: Sizes) -> Part:
    """A cap with a rectangular groove in its face and one around its rim."""
    radius, height, deep = s(34), s(26), s(4.5)
    inner, outer = s(17, 0.08), s(23, 0.05)
    face = turn((inner, height - deep), (outer, height - deep), (outer, 99), (inner, 99))
    rim = turn((radius - deep, height * 0.35), (99, height * 0.35), (99, height * 0.62), (radius - deep, height * 0.62))
    return Cylinder(radius, height, align=BOTTOM) - face - rim


def cup(s: Sizes) -> Part:
    """A conical cup, hollow, with a flat foot."""
    foot, top, height, wall = s(18), s(29), s(46), s(4)
    outside = Cone(foot, top, height, align=BOTTOM)
    inside = Cone(foot - wall, top - wall, height, align=BOTTOM)
    return outside - Pos(0, 0, wall * 1.5) * inside - Pos(0, 0, height) * Cylinder(top, 20, align=BOTTOM)


def bearing_race(s: Sizes) -> Part:
    """An inner bearing race: bore, shoulders, a shallow ball track, chamfers."""
    outer, bore, width, ball = s(30), s(19), s(24), s(8)
    edge = s(1.8)
    body = turn(
        (bore, 0), (outer - edge, 0), (outer, edge), (outer, width - edge), (outer - edge, width), (bore, width)
    )
    return body - Pos(0, 0, width / 2) * Torus(outer + ball * 0.4, ball)


def d_shaft(s: Sizes) -> Part:
    """A shaft with a flat, a chamfer and a cross hole."""
    radius, length, flat, edge = s(15), s(64), s(28), s(2)
    body = turn((0, 0), (radius, 0), (radius, length - edge), (radius - edge, length), (0, length))
    body -= Pos(radius * 1.55, 0, length - flat / 2) * Box(2 * radius, 2 * radius, flat + 0.02)
    return body - Pos(0, 0, s(15)) * Rot(90, 0, 0) * Cylinder(s(5), BEYOND)


def link_rod(s: Sizes) -> Part:
    """Two bored eyes joined by walls tangent to both."""
    span, big, small, thick = s(52), s(19), s(11), s(15)
    lean = (big - small) / span  # cosine of the tangent points' angle
    angle = acos(lean)
    p = (big * cos(angle), big * sin(angle))
    q = (span + small * cos(angle), small * sin(angle))
    turned = angle * 180 / pi
    outline = [
        CenterArc((0, 0), big, turned, 360 - 2 * turned),
        Line((p[0], -p[1]), (q[0], -q[1])),
        CenterArc((span, 0), small, -turned, 2 * turned),
        Line(q, p),
    ]
    body = extrude(make_face(outline), thick)
    body -= Cylinder(s(10), BEYOND)
    return body - Pos(span, 0, 0) * Cylinder(s(5.5), BEYOND)


def knob(s: Sizes) -> Part:
    """A spherical cap on a cone with a blind hole."""
    ball, cut, neck = s(24), s(15), s(10)
    body = Sphere(ball) - Pos(0, 0, -cut) * Box(BEYOND, BEYOND, BEYOND, align=BOTTOM).mirror(Plane.XY)
    base = (ball**2 - cut**2) ** 0.5
    stem = s(22)
    body += Pos(0, 0, -cut - stem) * Cone(neck, base * 0.85, stem, align=BOTTOM)
    return body - Pos(0, 0, -cut - stem) * extrude(Circle(s(5)), s(16))


def jet_body(s: Sizes) -> Part:
    """A stepped body with a conical tip, flats on its head, a blind bore from behind and two ports into it."""
    head, high, body_r, long, tip = s(15, 0.06), s(10), s(10, 0.06), s(26), s(8)
    body = turn(
        (0, 0),
        (head, 0),
        (head, high),
        (body_r, high),
        (body_r, high + long),
        (s(4), high + long + tip),
        (0, high + long + tip),
    )
    body -= Cylinder(s(5, 0.08), 2 * (high + s(16)))
    body -= Pos(0, 0, high + s(9)) * Rot(90, 0, 0) * Cylinder(s(2.2, 0.08), BEYOND)
    for side in (-1, 1):
        body -= Pos(side * (head * 0.8 + head), 0, 0) * Box(2 * head, 4 * head, 2 * high)
    return body
