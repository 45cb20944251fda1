"""Bundled parts that hold others: flanges, nuts, jaws, feet and bent plates, made for scoring only."""

from build123d import (
    Axis,
    Box,
    Circle,
    Cylinder,
    Part,
    Pos,
    RectangleRounded,
    Rot,
    SlotOverall,
    chamfer,
    extrude,
    fillet,
)

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM, bends, hexagon, profile
from brepgaussian.views.parts.sizes import Sizes
from brepgaussian.views.parts.turned import turn


def neck_flange(s: Sizes) -> Part:
    """A square flange with rounded corners, a raised face below, a conical neck above, four holes."""
    side, thick, corner, face, proud = s(52), s(8), s(8), s(17), s(2)
    body = extrude(RectangleRounded(side, side, corner), thick)
    body += Pos(0, 0, -proud) * Cylinder(face, proud, align=BOTTOM)
    wide, narrow, slope, tube, bore = s(15), s(11), s(9), s(10), s(8)
    top = thick + slope + tube
    body += turn((0, thick / 2), (wide, thick / 2), (wide, thick), (narrow, thick + slope), (narrow, top), (0, top))
    body -= extrude(Circle(bore), BEYOND, both=True)
    hole, away = s(3), side / 2 - corner
    for x in (-1, 1):
        for y in (-1, 1):
            body -= Pos(x * away, y * away, 0) * Cylinder(hole, BEYOND)
    return body


def castle_nut(s: Sizes) -> Part:
    """A hexagon under a round crown with three slots across, chamfered below, bored."""
    apothem, high, crown, up = s(16), s(13), s(13), s(9)
    body = hexagon(apothem, high)
    flat = apothem * 0.95
    body &= turn((0, 0), (flat, 0), (flat + 8, 4), (flat + 8, high), (0, high))
    body += Pos(0, 0, high / 2) * Cylinder(crown, high / 2 + up, align=BOTTOM)
    body -= extrude(Circle(s(8)), BEYOND, both=True)
    slot = s(4)
    for k in range(3):
        body -= Rot(0, 0, 60 * k) * Pos(0, 0, high + up * 0.3) * Box(BEYOND, slot, BEYOND, align=BOTTOM)
    return body


def soft_jaw(s: Sizes) -> Part:
    """A block with a step along its front, two counterbored slots across and a groove below."""
    length, width, high = s(72), s(28), s(30)
    body = Box(length, width, high, align=BOTTOM)
    body -= Pos(0, width / 2, high) * Box(BEYOND, s(14), s(12))
    body -= Pos(0, -s(3), 0) * Box(BEYOND, s(9), s(8))
    slot, wide, deep = s(6), s(10), s(6)
    for x in (-1, 1):
        at = Pos(x * length * 0.27, -width * 0.22, 0)
        body -= at * Rot(0, 0, 90) * extrude(SlotOverall(s(12, 0.05) + slot * 0.3, slot), BEYOND, both=True)
        body -= at * Pos(0, 0, high - deep) * Cylinder(wide * 0.62, BEYOND, align=BOTTOM)
    return body


def stand_foot(s: Sizes) -> Part:
    """A cone on a round foot with three lugs, a blind hole from above, a shallow recess below."""
    foot, thick, base, top, high = s(24), s(6), s(16), s(10), s(30)
    body = turn((0, 0), (foot, 0), (foot, thick), (base, thick), (top, high), (0, high))
    around, lug, hole = foot * 1.12, s(7), s(3)
    for k in range(3):
        body += Rot(0, 0, 120 * k) * Pos(around, 0, 0) * Cylinder(lug, thick, align=BOTTOM)
    for k in range(3):
        body -= Rot(0, 0, 120 * k) * Pos(around, 0, 0) * Cylinder(hole, BEYOND)
    body -= Pos(0, 0, high - s(16)) * Cylinder(s(5), BEYOND, align=BOTTOM)
    return body - Pos(0, 0, s(2)) * Rot(180, 0, 0) * Cylinder(s(15), BEYOND, align=BOTTOM)


def bent_plate(s: Sizes) -> Part:
    """A plate bent twice, rounded at its inner corners, with two holes above and a slot below."""
    low, high, rise, thick, depth = s(30), s(26), s(24), s(6), s(40)
    points = [(0, 0), (low, 0), (low, rise - thick), (low + high, rise - thick), (low + high, rise),
              (low - thick, rise), (low - thick, thick), (0, thick)]  # fmt: skip
    body = profile(*points, depth=depth)
    box = body.bounding_box()
    body = fillet(bends(body, (low, rise - thick), (low - thick, thick)), s(3))
    for y in (-1, 1):
        body -= Pos(box.max.X - high * 0.45, y * depth * 0.26, 0) * Cylinder(s(3.2), BEYOND)
    return body - Pos(box.min.X + low * 0.38, 0, 0) * Rot(0, 0, 90) * extrude(
        SlotOverall(s(18), s(6)), BEYOND, both=True
    )


def tee_lever(s: Sizes) -> Part:
    """A T-shaped lever with a bored boss at the crossing, a pad on one arm and chamfered edges above."""
    long, wide, thick, stem, narrow = s(64), s(14), s(8), s(40), s(12)
    body = Box(long, wide, thick, align=BOTTOM) + Pos(0, -stem / 2, 0) * Box(narrow, stem, thick, align=BOTTOM)
    body += Pos(0, -stem, 0) * Cylinder(narrow / 2, thick, align=BOTTOM)
    body = chamfer(body.faces().sort_by(Axis.Z)[-1].edges(), s(1.2))
    boss, up = s(10), s(8)
    body += Cylinder(boss, thick + up, align=BOTTOM)
    pad = s(9)
    body += Pos(long * 0.36, 0, 0) * Box(pad, pad, thick + s(4), align=BOTTOM)
    body -= Cylinder(s(5.5), BEYOND)
    body -= Pos(0, -stem, 0) * Cylinder(s(3), BEYOND)
    return body - Pos(-long * 0.38, 0, 0) * Cylinder(s(2.8), BEYOND)


def union_nut(s: Sizes) -> Part:
    """A hexagon under a round neck, bored in two widths with a conical seat between them, chamfered above."""
    apothem, wide, neck, tall, edge = s(17, 0.06), s(12), s(15, 0.05), s(14), s(1.5)
    bore, narrow, deep, seat = s(10, 0.06), s(6, 0.06), s(15), s(3)
    body = hexagon(apothem, wide)
    top = wide + tall
    body += turn((0, 0), (neck, 0), (neck, top - edge), (neck - edge, top), (0, top))
    return body - turn(
        (0, -1), (narrow, -1), (narrow, top - deep - seat), (bore, top - deep), (bore, top + 1), (0, top + 1)
    )
