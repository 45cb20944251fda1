"""Bundled parts cut from bar, tube and plate: sections with fillets, slots like a T, brackets with ears or ribs."""

from build123d import (
    Align,
    Axis,
    Box,
    Circle,
    Cylinder,
    Part,
    Plane,
    Polygon,
    Pos,
    Rectangle,
    RectangleRounded,
    Rot,
    SlotOverall,
    chamfer,
    extrude,
    fillet,
)

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM, bends, profile
from brepgaussian.views.parts.sizes import Sizes


def square_tube(s: Sizes) -> Part:
    """A length of square tube, rounded outside and inside, a hole through two walls."""
    side, long, wall, corner = s(32, 0.08), s(60), s(4, 0.1), s(6, 0.1)
    outer = extrude(RectangleRounded(side, side, corner), long)
    inner = extrude(RectangleRounded(side - 2 * wall, side - 2 * wall, corner - wall * 0.6), long)
    return outer - inner - Pos(0, 0, long * 0.3) * Rot(0, 90, 0) * Cylinder(s(6), BEYOND)


def i_beam(s: Sizes) -> Part:
    """A short I beam with fillets between web and flanges, two holes in its web."""
    high, wide, web, flange, long = s(48), s(34), s(6, 0.08), s(7, 0.08), s(56)
    body = (
        Box(wide, long, flange) + Pos(0, 0, high) * Box(wide, long, flange) + Pos(0, 0, high / 2) * Box(web, long, high)
    )
    inner = [e for e in body.edges().filter_by(Axis.Y) if abs(abs(e.center().X) - web / 2) < 1e-6]
    body = fillet(inner, s(4))
    for y in (-1, 1):
        body -= Pos(0, y * long * 0.24, high / 2) * Rot(0, 90, 0) * Cylinder(s(6, 0), BEYOND)
    return body


def t_slot_plate(s: Sizes) -> Part:
    """A plate with a T slot along it and two counterbored holes."""
    length, width, thick = s(64), s(50), s(22)
    neck, slot, deep, foot = s(9, 0.08), s(18, 0.08), s(13, 0.06), s(6, 0.08)
    body = Box(length, width, thick, align=BOTTOM)
    body -= Pos(0, 0, thick - deep) * Box(BEYOND, neck, BEYOND, align=BOTTOM)
    body -= Pos(0, 0, thick - deep) * Box(BEYOND, slot, foot, align=BOTTOM)
    for x in (-1, 1):
        at = Pos(x * length * 0.3, width * 0.34, 0)
        body -= at * Cylinder(s(2.8, 0), BEYOND)
        body -= at * Pos(0, 0, thick - s(5, 0)) * Cylinder(s(5, 0), BEYOND, align=BOTTOM)
    return body


def ear_bracket(s: Sizes) -> Part:
    """A base with two upright ears with round tops, a hole across both, four holes in the base."""
    length, width, thick, gap, ear, up = s(72), s(46), s(8), s(24), s(8), s(26)
    body = Box(length, width, thick, align=BOTTOM)
    r = width * 0.3
    for x in (-1, 1):
        plate = Plane.YZ * (Pos(0, thick + up / 2) * Rectangle(2 * r, up) + Pos(0, thick + up) * Circle(r))
        body += Pos(x * (gap + ear) / 2, 0, 0) * extrude(plate, ear / 2, both=True)
        for y in (-1, 1):
            body -= Pos(x * length * 0.42, y * width * 0.34, 0) * Cylinder(s(3, 0), BEYOND)
    return body - Pos(0, 0, thick + up) * Rot(0, 90, 0) * Cylinder(s(7), BEYOND)


def slotted_angle(s: Sizes) -> Part:
    """An angle bracket with two slots in its foot, two holes in its back, and a rib between."""
    width, foot, back, thick = s(60), s(46), s(44), s(7)
    body = profile((0, 0), (foot, 0), (foot, thick), (thick, thick), (thick, back), (0, back), depth=width)
    rib = Plane.XZ * Polygon((thick, thick), (thick + back * 0.6, thick), (thick, thick + back * 0.6), align=None)
    body += extrude(rib, s(6) / 2, both=True)
    for y in (-1, 1):
        body -= Pos(foot * 0.6, y * width * 0.3, 0) * extrude(SlotOverall(s(17, 0), s(7, 0)), BEYOND, both=True)
        body -= Pos(0, y * width * 0.3, back * 0.66) * Rot(0, 90, 0) * Cylinder(s(3.5, 0), BEYOND)
    return body


def fan_plate(s: Sizes) -> Part:
    """A square plate with rounded corners, a wide bore with a raised rim, four corner holes."""
    side, thick, bore, rim, high = s(64, 0.06), s(7), s(22), s(26, 0.04), s(7)
    body = extrude(RectangleRounded(side, side, s(8)), thick)
    body += Pos(0, 0, thick) * Cylinder(rim, high, align=BOTTOM)
    body -= Cylinder(bore, BEYOND)
    for x in (-1, 1):
        for y in (-1, 1):
            body -= Pos(x * side * 0.4, y * side * 0.4, 0) * Cylinder(s(3, 0), BEYOND)
    return body


def pulley_fork(s: Sizes) -> Part:
    """A U of thick walls with round ends, a pin hole through both, a hole in its back."""
    wide, gap, wall, deep, back = s(30), s(18), s(8), s(38), s(10)
    cheek = Plane.XZ * (Pos(deep / 2, 0) * Rectangle(deep, wide) + Pos(deep, 0) * Circle(wide / 2))
    body = extrude(cheek, gap / 2 + wall, both=True)
    body -= Pos(back, 0, 0) * Box(BEYOND, gap, BEYOND, align=(Align.MIN, Align.CENTER, Align.CENTER))
    body -= Pos(deep, 0, 0) * Rot(90, 0, 0) * Cylinder(s(6), BEYOND)
    return body - Rot(0, 90, 0) * Cylinder(s(4), BEYOND)


def gib_key(s: Sizes) -> Part:
    """A tapered key with a head that slopes, chamfered at its thin end."""
    long, wide, high, head, drop = s(72), s(20), s(16), s(18), s(5)
    back, up = s(5), s(9)
    top = high + up
    body = profile(
        (0, 0), (long, 0), (long, high - drop), (head, high), (head - back, top), (0, top), depth=wide
    )  # fmt: skip
    return chamfer(body.faces().sort_by(Axis.X)[-1].edges(), s(1.8))


def z_bracket(s: Sizes) -> Part:
    """A sheet bent to a Z, rounded inside and outside of its bends, a slot in one foot and a hole in the other."""
    foot, up, thick, wide, inner = s(30), s(34), s(6, 0.08), s(44), s(4)
    low, high, far, wall = thick, up - thick, 2 * foot - thick, foot - thick
    body = profile(
        (0, 0), (foot, 0), (foot, high), (far, high), (far, up), (wall, up), (wall, low), (0, low), depth=wide
    )  # fmt: skip
    for radius, places in ((inner, ((foot, high), (wall, low))), (inner + thick, ((foot, 0), (wall, up)))):
        body = fillet(bends(body, *places), radius)
    body -= Pos(foot * 0.4, 0, 0) * extrude(SlotOverall(s(20), s(8), rotation=90), 2 * thick, both=True)
    return body - Pos(foot * 1.5, 0, up) * Cylinder(s(5), 3 * thick)
