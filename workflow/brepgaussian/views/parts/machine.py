"""Bundled parts as machines have them: several features at once, turned and prismatic ones mixed."""

from math import cos, pi, radians, tan

from build123d import (
    Axis,
    Box,
    Circle,
    Cone,
    Cylinder,
    Part,
    Plane,
    Pos,
    RegularPolygon,
    Rot,
    SlotOverall,
    extrude,
    fillet,
)

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM, profile
from brepgaussian.views.parts.sizes import Sizes
from brepgaussian.views.parts.turned import turn


def step_bracket(s: Sizes) -> Part:
    """Two steps, a slot with round ends through the low one, a blind hole in the high one, rounded corners."""
    length, width, low, high = s(72, 0.08), s(44), s(12), s(30)
    step = length * s(0.42, 0.08)
    body = profile((0, 0), (length, 0), (length, low), (step, low), (step, high), (0, high), depth=width)
    body = fillet(body.edges().filter_by(Axis.Z).sort_by(Axis.X)[-2:], s(9))
    slot = Rot(0, 0, 90) * SlotOverall(s(24), s(8))
    body -= Pos((length + step) / 2, 0, -1) * extrude(slot, BEYOND)
    return body - Pos(step / 2, 0, high - s(17)) * Cylinder(s(6), BEYOND, align=BOTTOM)


def v_pulley(s: Sizes) -> Part:
    """A rim with a V groove, a thin web recessed on both sides, a bored hub longer than the rim."""
    rim, root, inside, hub, bore = s(36, 0.06), s(28, 0.05), s(23, 0.05), s(13), s(7)
    width, web, mouth, floor, reach = s(22), s(6), s(14, 0.1), s(5, 0.1), s(29, 0.06)
    w, t, m, f, h = width / 2, web / 2, mouth / 2, floor / 2, reach / 2
    return turn(
        (bore, -h), (hub, -h), (hub, -t), (inside, -t), (inside, -w), (rim, -w), (rim, -m), (root, -f),
        (root, f), (rim, m), (rim, w), (inside, w), (inside, t), (hub, t), (hub, h), (bore, h),
    )  # fmt: skip


def hinge_leaf(s: Sizes) -> Part:
    """A thin leaf on a bored barrel, cut away at one end, with two countersunk holes."""
    length, width, thick, barrel = s(64, 0.08), s(40), s(6), s(8)
    body = Pos(width / 2, 0, 0) * Box(width, length, thick, align=BOTTOM)
    body += Pos(0, 0, barrel) * Rot(90, 0, 0) * Cylinder(barrel, length)
    gap = length * s(0.3)
    reach = barrel * 1.25
    body -= Pos(reach - BEYOND / 2, length / 2 - gap + BEYOND / 2, 0) * Box(BEYOND, BEYOND, BEYOND)
    body -= Pos(0, 0, barrel) * Rot(90, 0, 0) * Cylinder(s(4), BEYOND)
    bore, sink = s(3), s(6)
    for y in (-1, 1):
        at = Pos(width * 0.68, y * length * 0.29, thick - (sink - bore))
        body -= Pos(width * 0.68, y * length * 0.29, 0) * Cylinder(bore, BEYOND)
        body -= at * Cone(bore, sink, sink - bore, align=BOTTOM)
    return body


def bearing_cap(s: Sizes) -> Part:
    """Half a bearing seat: an arch with a half bore and an inner groove between two bolted feet."""
    bore, wall, width, foot, length = s(18), s(8), s(26), s(12), s(86, 0.06)
    arch = extrude(Plane.XZ * Circle(bore + wall), width / 2, both=True)
    body = arch + Box(length, width, foot, align=BOTTOM)
    body -= Box(BEYOND, BEYOND, BEYOND, align=BOTTOM).mirror(Plane.XY)
    body -= Rot(90, 0, 0) * Cylinder(bore, BEYOND)
    body -= Rot(90, 0, 0) * Cylinder(bore + wall * s(0.4), width * s(0.35))
    for x in (-1, 1):
        body -= Pos(x * (length / 4 + (bore + wall) / 2), 0, 0) * Cylinder(s(3.6), BEYOND)
    return body


def clevis_fork(s: Sizes) -> Part:
    """Two rounded cheeks with a cross bore on a round shank with a blind hole."""
    half, gap, cheek, floor, shank = s(15), s(13), s(30), s(9), s(10)
    long = s(26)
    body = Box(2 * half, 2 * half, floor + cheek, align=BOTTOM)
    body += Pos(0, 0, floor + cheek) * Rot(90, 0, 0) * Cylinder(half, 2 * half)
    body -= Pos(0, 0, floor) * Box(BEYOND, gap, BEYOND, align=BOTTOM)
    body -= Pos(0, 0, floor + cheek) * Rot(90, 0, 0) * Cylinder(s(6.5), BEYOND)
    body += Pos(0, 0, -long) * Cylinder(shank, long, align=BOTTOM)
    return body - Pos(0, 0, -long) * Cylinder(s(5.5), s(18), align=BOTTOM)


def t_nut(s: Sizes) -> Part:
    """A nut for a T slot: a neck over wide shoulders with bevelled lower edges, a chamfered bore."""
    wide, neck, low, high, bevel = s(21), s(11), s(12), s(24), s(4)
    bore, edge = s(6), s(1.8)
    body = profile(
        (-wide + bevel, 0), (wide - bevel, 0), (wide, bevel), (wide, low), (neck, low), (neck, high),
        (-neck, high), (-neck, low), (-wide, low), (-wide, bevel), depth=s(36),
    )  # fmt: skip
    body -= Cylinder(bore, BEYOND)
    return body - Pos(0, 0, high - edge) * Cone(bore, bore + edge, edge, align=BOTTOM)


def flanged_bushing(s: Sizes) -> Part:
    """A bush with a flange, a rounded shoulder, chamfers inside and outside, and a cross hole for oil."""
    bore, outer, flange, thick, high, edge = s(13, 0.1), s(20, 0.1), s(31, 0.1), s(8), s(40), s(2.5)
    body = turn(
        (bore + edge, 0), (flange - edge, 0), (flange, edge), (flange, thick), (outer, thick), (outer, high - edge),
        (outer - edge, high), (bore, high), (bore, edge),
    )  # fmt: skip
    shoulder = [e for e in body.edges() if abs(e.center().Z - thick) < 1e-6 and abs(e.radius - outer) < 1e-6]
    body = fillet(shoulder, s(3.5))
    return body - Pos(0, 0, high * 0.6) * Rot(0, 90, 0) * Cylinder(s(4), BEYOND, align=BOTTOM)


def ribbed_base(s: Sizes) -> Part:
    """A base plate with four holes and rounded corners, a blind bored boss held by two thin ribs."""
    length, width, base, boss, high, rib = s(80, 0.08), s(52, 0.08), s(9), s(14), s(36), s(6)
    plate = Box(length, width, base, align=BOTTOM)
    plate = fillet(plate.edges().filter_by(Axis.Z), s(8))
    hole = s(3.6)
    for x in (-1, 1):
        for y in (-1, 1):
            plate -= Pos(x * length * 0.39, y * width * 0.34, 0) * Cylinder(hole, BEYOND)
    reach, top = length * s(0.42, 0.05), high * s(0.85, 0.08)
    ribs = profile((-reach, base), (reach, base), (boss * 0.8, top), (-boss * 0.8, top), depth=rib)
    body = plate + ribs + Cylinder(boss, high, align=BOTTOM)
    return body - Pos(0, 0, high - s(20)) * Cylinder(s(8), BEYOND, align=BOTTOM)


def hex_bolt(s: Sizes) -> Part:
    """A bolt blank: a hexagonal head chamfered by a cone, a shoulder, a thinner end with a chamfered tip."""
    apothem, head, shank, long = s(18), s(13), s(10), s(26)
    end, tip, edge = shank * s(0.8, 0.06), s(20), s(2)
    corner = apothem / cos(pi / 6)
    body = extrude(RegularPolygon(corner, 6), head)
    flat, limit = apothem * s(0.94, 0.04), corner * 1.2
    drop = (limit - flat) * tan(radians(30))
    body &= turn((0, 0), (flat, 0), (limit, drop), (limit, head), (0, head))
    total = head + long + tip
    return body + turn(
        (0, 0),
        (shank, 0),
        (shank, head + long),
        (end, head + long),
        (end, total - edge),
        (end - edge, total),
        (0, total),
    )
