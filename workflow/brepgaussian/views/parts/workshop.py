"""Bundled parts of an ordinary machine: wheels, braces, bodies and rails, made for scoring only."""

from build123d import (
    Axis,
    Box,
    Circle,
    Cone,
    Cylinder,
    Part,
    Pos,
    Rot,
    SlotOverall,
    chamfer,
    extrude,
    fillet,
)

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM, hexagon, profile
from brepgaussian.views.parts.sizes import Sizes
from brepgaussian.views.parts.turned import turn


def gear_blank(s: Sizes) -> Part:
    """A wheel with a hub on one side, recessed around it, lightened by holes; its bore is keyed."""
    rim, thick, hub, high = s(32), s(14), s(12), s(22)
    recess, web = s(25), s(6)
    body = turn((0, 0), (rim, 0), (rim, thick), (recess, thick), (recess, web), (hub, web), (hub, high), (0, high))
    bore, around = s(6.5), (recess + hub) / 2
    body -= extrude(Circle(bore), BEYOND, both=True)
    body -= Pos(bore, 0, 0) * Box(s(5), s(4), BEYOND)
    count, hole = s.count(5, 4, 6), s(3.2, 0.0)
    for k in range(count):
        body -= Rot(0, 0, 360 * k / count) * Pos(around, 0, 0) * Cylinder(hole, BEYOND)
    return body


def swivel_eye(s: Sizes) -> Part:
    """A bored eye on a shank with a collar and a chamfered end."""
    eye, wide, bore = s(15), s(14), s(7)
    collar, shank, long, tip = s(12), s(8), s(30), s(1.2)
    body = Rot(90, 0, 0) * Cylinder(eye, wide)
    foot = -eye - s(3)
    neck, under, end = s(6.4, 0.02), foot - s(5), foot - long
    body += turn((0, 0), (neck, 0), (neck, foot), (collar, foot), (collar, under), (shank, under),
                 (shank, end + tip), (shank - tip, end), (0, end))  # fmt: skip
    return body - Rot(90, 0, 0) * Cylinder(bore, BEYOND)


def corner_brace(s: Sizes) -> Part:
    """An angle with a triangular web at either end, a slot in one leg and two holes in the other."""
    long, leg, high, thick, web = s(60), s(34), s(40), s(7), s(6)
    body = profile((0, 0), (leg, 0), (leg, thick), (thick, thick), (thick, high), (0, high), depth=long)
    side = profile((0, 0), (leg * 0.85, 0), (0, high * 0.85), depth=web)
    box, piece = body.bounding_box(), side.bounding_box()
    for y in (box.min.Y, box.max.Y - web):
        body += Pos(box.min.X - piece.min.X, y - piece.min.Y, box.min.Z - piece.min.Z) * side
    slot = extrude(SlotOverall(s(20), s(6)), BEYOND, both=True)
    body -= Pos(box.min.X + (leg + thick) * 0.55, 0, 0) * Rot(0, 0, 90) * slot
    for y in (-1, 1):
        body -= Pos(0, y * long * 0.22, box.min.Z + high * 0.68) * Rot(0, 90, 0) * Cylinder(s(3), BEYOND)
    return body


def valve_body(s: Sizes) -> Part:
    """A block with rounded corners under a round boss, a stepped bore from above, ports from two sides."""
    length, width, high = s(46), s(40), s(28)
    body = Box(length, width, high, align=BOTTOM)
    body = fillet(body.edges().filter_by(Axis.Z), s(6))
    boss, up = s(15), s(10)
    body += Pos(0, 0, high) * Cylinder(boss, up, align=BOTTOM)
    wide, bore, sunk = s(10), s(6), s(12)
    body -= Pos(0, 0, high + up - sunk) * Cylinder(wide, BEYOND, align=BOTTOM)
    body -= Cylinder(bore, BEYOND)
    body -= Pos(0, 0, high * 0.45) * Rot(0, 90, 0) * Cylinder(s(4.5), BEYOND, align=BOTTOM)
    return body - Pos(0, 0, high * 0.45) * Rot(90, 0, 0) * Cylinder(s(3.5), BEYOND, align=BOTTOM)


def slide_rail(s: Sizes) -> Part:
    """A rail with a V groove along its top, a ledge on either side and counterbored holes."""
    long, foot, neck, low, high, half = s(90), s(17), s(11), s(8), s(22), s(6)
    right = [(foot, 0), (foot, low), (neck, low), (neck, high), (half, high)]
    body = profile(*right, (0, high - half), *[(-x, z) for x, z in reversed(right)], depth=long)
    box = body.bounding_box()
    hole, wide, sunk = s(2.3), s(4.2), s(4)
    for y in (-1, 1):
        at = Pos(0, y * long * 0.32, box.min.Z)
        body -= at * Cylinder(hole, BEYOND)
        body -= at * Pos(0, 0, sunk) * Rot(180, 0, 0) * Cylinder(wide, BEYOND, align=BOTTOM)
    return body


def end_stop(s: Sizes) -> Part:
    """A block with a slanting front, a notch behind, a counterbored hole from above, chamfered below."""
    length, width, high, front = s(44), s(30), s(32), s(14)
    body = profile((0, 0), (length, 0), (length, front), (length * 0.55, high), (0, high), depth=width)
    box = body.bounding_box()
    body = chamfer(body.faces().sort_by(Axis.Z)[0].edges().filter_by(Axis.Y), s(2.5))
    body -= Pos(box.min.X, 0, box.min.Z + high * 0.5) * Box(s(16), BEYOND, s(9))
    at = Pos(box.min.X + length * 0.33, 0, 0)
    body -= at * Cylinder(s(3.4), BEYOND)
    return body - at * Pos(0, 0, box.max.Z - s(5)) * Cylinder(s(6), BEYOND, align=BOTTOM)


def step_pulley(s: Sizes) -> Part:
    """Two belt steps and a hub, chamfered, with a bore and a set-screw hole; one step is hollow from below."""
    large, small, hub = s(28), s(19), s(11)
    first, second, third, edge = s(12), s(12), s(9), s(1.2)
    high, top = first + second, first + second + third
    body = turn((0, 0), (large - edge, 0), (large, edge), (large, first), (small, first), (small, high),
                (hub, high), (hub, top - edge), (hub - edge, top), (0, top))  # fmt: skip
    hollow, deep = s(20), s(5)
    body -= Pos(0, 0, deep) * Rot(180, 0, 0) * Cylinder(hollow, BEYOND, align=BOTTOM)
    body -= Cylinder(s(5), BEYOND)
    return body - Pos(0, 0, high + third * 0.5) * Rot(0, 90, 0) * Cylinder(s(2), BEYOND, align=BOTTOM)


def crank_web(s: Sizes) -> Part:
    """Two hubs of unequal height on a web that tapers between them, hollowed on one side."""
    apart, large, small, thick = s(52), s(17), s(11), s(10)
    up, pin, bore, hole = s(12), s(20), s(8), s(4.5)
    body = Cylinder(large, thick, align=BOTTOM) + Pos(apart, 0, 0) * Cylinder(small, thick, align=BOTTOM)
    web = s(0.7, 0.05)
    outline = [(0, -large * web), (apart, -small * web), (apart, small * web), (0, large * web)]
    plate = Rot(-90, 0, 0) * profile(*outline, depth=thick)
    box = plate.bounding_box()
    body += Pos(-box.min.X, -(box.min.Y + box.max.Y) / 2, -box.min.Z) * plate
    body += Pos(0, 0, thick) * Cylinder(large * 0.8, up, align=BOTTOM)
    body += Pos(apart, 0, thick) * Cylinder(small * 0.7, pin, align=BOTTOM)
    pocket = extrude(SlotOverall(apart - large - small - s(2), s(8)), BEYOND)
    body -= Pos((apart + large - small) / 2, 0, thick - s(4)) * pocket
    body -= Cylinder(bore, BEYOND)
    return body - Pos(apart, 0, 0) * Cylinder(hole, BEYOND)


def shelf_bracket(s: Sizes) -> Part:
    """An angle with two triangular ribs away from its ends, holes between and beside them."""
    long, leg, high, thick, rib = s(64), s(38), s(42), s(6), s(5)
    body = profile((0, 0), (leg, 0), (leg, thick), (thick, thick), (thick, high), (0, high), depth=long)
    inner = thick * 0.8
    side = profile((inner, inner), (leg * 0.9, inner), (inner, high * 0.8), depth=rib)
    away, hole = long * 0.22, s(2.8)
    low, foot = body.bounding_box().min, side.bounding_box().min
    for y in (-away, away):
        body += Pos(low.X + inner - foot.X, y, low.Z + inner - foot.Z) * side
    for y in (-0.38 * long, 0.0, 0.38 * long):
        body -= Pos(low.X + leg * 0.6, y, 0) * Cylinder(hole, BEYOND)
    return body - Pos(0, 0, low.Z + high * 0.65) * Rot(0, 90, 0) * Cylinder(s(5), BEYOND)


def pipe_saddle(s: Sizes) -> Part:
    """Half a ring between two ears with a hole each, its inner edges chamfered."""
    outer, wall, width, ear, thick = s(21), s(5), s(22), s(14), s(6)
    edge = s(1.2)
    body = Cylinder(outer, width) + Pos(0, thick / 2, 0) * Box(2 * (outer + ear), thick, width)
    body -= Pos(0, -BEYOND / 2, 0) * Box(BEYOND, BEYOND, BEYOND)
    inner, half = outer - wall, width / 2
    body -= Cylinder(inner, BEYOND)
    for turned in (0, 180):
        body -= Rot(turned, 0, 0) * Pos(0, 0, half - edge / 2) * Cone(inner, inner + edge, edge)
    for x in (-1, 1):
        body -= Pos(x * (outer + ear * 0.55), 0, 0) * Rot(90, 0, 0) * Cylinder(s(3.2, 0.0), BEYOND)
    return body


def bleed_screw(s: Sizes) -> Part:
    """A hexagonal head, a shank with a relief and a conical point, a blind bore that a radial hole meets."""
    apothem, head, shank, long, point = s(11), s(9), s(8), s(34), s(7)
    relief, groove = s(6), s(5)
    body = hexagon(apothem, head)
    end = -long
    neck = (relief, head / 2), (relief, -groove), (shank, -groove)
    body += turn((0, head / 2), *neck, (shank, end + point), (relief / 2, end), (0, end))
    deep = head + long * 0.5
    body -= Pos(0, 0, head - deep) * Cylinder(s(3), BEYOND, align=BOTTOM)
    return body - Pos(0, 0, head - deep * 0.85) * Rot(0, 90, 0) * Cylinder(s(1.9), BEYOND, align=BOTTOM)
