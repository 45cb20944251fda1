"""Bundled parts as fixtures and housings have them: keyways, sockets, elbows, seats, drilled blind holes."""

from math import cos, pi, radians, tan

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
    Pos,
    Rectangle,
    RegularPolygon,
    Rot,
    SlotOverall,
    Sphere,
    Wire,
    chamfer,
    extrude,
    fillet,
    sweep,
)

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM, profile
from brepgaussian.views.parts.sizes import Sizes
from brepgaussian.views.parts.turned import turn

_DRILL_TIP = 59.0  # degrees between axis and cone of a twist drill's tip (118 degrees in all)


def drill(radius: float, depth: float) -> Part:
    """A blind drilled hole as a tool: downwards from the origin, `depth` mm of cylinder, then the drill's cone."""
    tip = radius / tan(radians(_DRILL_TIP))
    return turn((0, -depth - tip), (radius, -depth), (radius, 0), (0, 0))


def keyed_shaft(s: Sizes) -> Part:
    """A shaft with a collar: a blind keyway with round ends on one side, a retaining-ring groove on the other."""
    seat, collar, journal, edge = s(12.5, 0.1), s(19, 0.08), s(11, 0.1), s(1.6)
    long, thick, short = s(38, 0.08), s(9), s(32, 0.06)
    groove, deep, land = s(5, 0.08), s(2.4, 0.1), s(7, 0.1)
    total = long + thick + short
    low = total - land - groove
    body = turn(
        (0, 0), (seat - edge, 0), (seat, edge), (seat, long), (collar, long), (collar, long + thick),
        (journal, long + thick), (journal, low), (journal - deep, low), (journal - deep, low + groove),
        (journal, low + groove), (journal, total - edge), (journal - edge, total), (0, total),
    )  # fmt: skip
    key = extrude(SlotOverall(long * s(0.62, 0.05), s(7, 0.1)), BEYOND)
    return body - Pos(seat - s(4.5, 0.1), 0, (long + edge) / 2) * Rot(0, 90, 0) * key


def tube_connector(s: Sizes) -> Part:
    """A square tube with rounded edges, a square socket that ends at a shoulder, two pairs of cross holes."""
    outer, wall, shoulder, length = s(46, 0.06), s(6, 0.1), s(4.8, 0.08), s(72, 0.08)
    depth = length * s(0.55, 0.08)
    body = Box(outer, outer, length, align=BOTTOM)
    body = fillet(body.edges().filter_by(Axis.Z), s(5))
    socket = outer - 2 * wall
    body -= Pos(0, 0, length - depth) * Box(socket, socket, BEYOND, align=BOTTOM)
    body -= Box(socket - 2 * shoulder, socket - 2 * shoulder, BEYOND)
    body -= Pos(0, 0, length - depth / 2) * Rot(90, 0, 0) * Cylinder(s(6), BEYOND)
    return body - Pos(0, 0, (length - depth) / 2) * Rot(0, 90, 0) * Cylinder(s(5), BEYOND)


def pipe_elbow(s: Sizes) -> Part:
    """A pipe bent by a right angle: a square flange with four holes at one end, a chamfered spigot at the other."""
    bore, wall, bend, lead, reach = s(10, 0.1), s(5.2, 0.08), s(30, 0.08), s(15, 0.1), s(15, 0.1)
    outer, thick, edge = bore + wall, s(7, 0.1), s(1.4, 0.1)
    up, end = (0, 0, lead), (bend, 0, lead + bend)
    pieces = (
        Line((0, 0, 0), up),
        Plane.XZ * CenterArc((bend, lead), bend, 180, -90),
        Line(end, (bend + reach, 0, lead + bend)),
    )
    path = Wire([e for piece in pieces for e in piece.edges()])
    pipe = sweep(Circle(outer), path)
    pipe = chamfer(pipe.faces().sort_by(Axis.X)[-1].edges(), edge)
    half = outer + s(9.5, 0.05)
    flange = Box(2 * half, 2 * half, thick, align=BOTTOM)
    flange = fillet(flange.edges().filter_by(Axis.Z), s(6))
    inset, hole = half - s(7.4, 0.04), s(2.8, 0.08)
    for x in (-inset, inset):
        for y in (-inset, inset):
            flange -= Pos(x, y, 0) * Cylinder(hole, BEYOND)
    return flange + pipe - sweep(Circle(bore), path)


def shoulder_screw(s: Sizes) -> Part:
    """A shoulder screw blank: a round head with a hexagonal socket and a rounded rim, two diameters, a chamfer."""
    head, high, shoulder, long, tip, edge = s(18, 0.08), s(15, 0.1), s(12, 0.1), s(28), s(18), s(1.8)
    thread, total = shoulder * s(0.68, 0.06), high + long + tip
    body = turn(
        (0, 0), (head, 0), (head, high), (shoulder, high), (shoulder, high + long), (thread, high + long),
        (thread, total - edge), (thread - edge, total), (0, total),
    )  # fmt: skip
    rim = [e for e in body.edges() if abs(e.center().Z) < 1e-6 and e.length > 2 * pi * thread]
    body = fillet(rim, s(3))
    socket = RegularPolygon(s(8, 0.1) / cos(pi / 6), 6)
    return body - extrude(socket, s(8.5, 0.1))


def pocket_housing(s: Sizes) -> Part:
    """A block with a pocket of rounded corners, a port through one wall, two blind holes in the thick rims."""
    length, width, high, floor = s(80, 0.06), s(54, 0.08), s(32, 0.06), s(8, 0.1)
    rim, wall = s(16, 0.06), s(8, 0.1)
    pocket = Rectangle(length - 2 * rim, width - 2 * wall)
    pocket = fillet(pocket.vertices(), s(7))
    body = Box(length, width, high, align=BOTTOM) - Pos(0, 0, floor) * extrude(pocket, BEYOND)
    hole = drill(s(3.1, 0.08), s(13))
    for x in (-1, 1):
        body -= Pos(x * (length - rim) / 2, 0, high) * hole
    port = Rot(90, 0, 0) * Cylinder(s(5.5, 0.1), BEYOND, align=BOTTOM)
    return body - Pos(0, 0, (floor + high) / 2) * port


def ball_lever(s: Sizes) -> Part:
    """A flanged hub with a chamfered bore and a set-screw hole, an inclined tapered arm, a ball at its end."""
    bore, flange, high, low, edge = s(7, 0.08), s(19, 0.06), s(31, 0.06), s(7, 0.1), s(1.5)
    hub = bore + s(6.8, 0.08)
    reach, rise = s(60, 0.06), s(20, 0.1)
    body = turn((0, 0), (flange, 0), (flange, low), (hub, low), (hub, high), (0, high))
    arm = Cone(s(6, 0.06), s(4.5, 0.06), reach, align=BOTTOM) + Pos(0, 0, reach) * Sphere(s(9.5, 0.1))
    body += Pos(0, 0, high * 0.47) * Rot(0, 90 - rise, 0) * arm
    body -= turn(
        (0, 0), (bore + edge, 0), (bore, edge), (bore, high - edge), (bore + edge, high), (0, high)
    )  # fmt: skip
    screw = Rot(0, -90, 0) * Cylinder(s(2.8, 0.1), BEYOND, align=BOTTOM)
    return body - Pos(0, 0, (low + high) / 2) * screw


def cock_plug(s: Sizes) -> Part:
    """The plug of a cock: a tapered body with a cross port, a stem with a square end, a drilled hole below."""
    small, large, body_high, stem = s(13, 0.06), s(18, 0.06), s(46, 0.08), s(10.5, 0.1)
    neck = s(10)
    shoulder = body_high + neck
    body = turn((0, 0), (small, 0), (large, body_high), (stem, body_high), (stem, shoulder), (0, shoulder))
    side = stem * s(1.2, 0.05)
    body += Pos(0, 0, shoulder) * Box(side, side, s(12), align=BOTTOM)
    body -= Pos(0, 0, body_high * 0.58) * Rot(90, 0, 0) * Cylinder(s(6.2, 0.1), BEYOND)
    return body - Rot(180, 0, 0) * drill(s(4), s(8))


def cover_lid(s: Sizes) -> Part:
    """A rectangular cover with rounded corners and four countersunk holes, a bored round spigot underneath."""
    length, width, thick, inset = s(80, 0.06), s(58, 0.06), s(9, 0.1), s(11.5, 0.04)
    lid = Box(length, width, thick, align=BOTTOM)
    lid = fillet(lid.edges().filter_by(Axis.Z), s(9))
    bore, sink = s(3.2, 0.08), s(2.8, 0.1)
    hole = Cylinder(bore, BEYOND) + Pos(0, 0, thick - sink) * Cone(bore, bore + sink, sink, align=BOTTOM)
    for x in (-1, 1):
        for y in (-1, 1):
            lid -= Pos(x * (length / 2 - inset), y * (width / 2 - inset), 0) * hole
    spigot, deep, edge = s(16.5, 0.08), s(8), s(1.6)
    lid += turn((0, 0), (spigot, 0), (spigot, edge - deep), (spigot - edge, -deep), (0, -deep))
    return lid - Cylinder(s(7.5, 0.1), BEYOND)


def seat_block(s: Sizes) -> Part:
    """A block on two bored ledges with a spherical seat, whose mouth is chamfered and whose floor is drained."""
    ball, rim, ledge, low, high = s(19, 0.06), s(8.5, 0.08), s(17, 0.04), s(10, 0.1), s(36, 0.05)
    half = ball + rim
    foot = half + ledge
    body = profile(
        (-foot, 0), (foot, 0), (foot, low), (half, low), (half, high), (-half, high), (-half, low), (-foot, low),
        depth=2 * half,
    )  # fmt: skip
    above, edge = ball * 0.2, s(1.8, 0.1)  # the ball's centre lies above the block, so that the ball comes out
    mouth = (ball**2 - above**2) ** 0.5
    body -= Pos(0, 0, high + above) * Sphere(ball)
    body -= Pos(0, 0, high - 2 * edge) * Cone(mouth - edge, mouth + edge, 2 * edge, align=BOTTOM)
    body -= Cylinder(s(4.5, 0.1), BEYOND)
    hole = s(3.3, 0.05)
    for x in (-1, 1):
        body -= Pos(x * (half + ledge / 2), 0, 0) * Cylinder(hole, BEYOND)
    return body
