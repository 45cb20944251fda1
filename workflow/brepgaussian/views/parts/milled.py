"""Bundled parts as a milling machine leaves them: keyways, slots and pockets with round ends and corners, chamfers."""

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
)

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM
from brepgaussian.views.parts.sizes import Sizes
from brepgaussian.views.parts.turned import turn


def chamfered_plate(s: Sizes) -> Part:
    """A plate, chamfered all around its top, with a slot, two holes through it and two blind ones."""
    length, width, thick, edge = s(70), s(44), s(12), s(2)
    body = Box(length, width, thick, align=BOTTOM)
    body = chamfer(body.faces().sort_by(Axis.Z)[-1].edges(), edge)
    body -= extrude(SlotOverall(s(30), s(10)), BEYOND, both=True)
    hole, blind, deep = s(3.2), s(4), s(7)
    for x in (-1, 1):
        body -= Pos(x * length * 0.38, width * 0.3, 0) * Cylinder(hole, BEYOND)
        body -= Pos(x * length * 0.38, -width * 0.3, thick - deep) * Cylinder(blind, BEYOND, align=BOTTOM)
    return body


def keyway_journal(s: Sizes) -> Part:
    """A stepped shaft with chamfered ends and a keyway with round ends."""
    wide, narrow, long, end = s(14), s(10), s(34), s(28)
    edge, tip = s(1.5), s(1.2)
    body = turn((0, 0), (wide - edge, 0), (wide, edge), (wide, long), (narrow, long), (narrow, long + end - tip),
                (narrow - tip, long + end), (0, long + end))  # fmt: skip
    deep = s(4)
    key = extrude(SlotOverall(s(18), s(6)), BEYOND)
    return body - Pos(wide - deep, 0, long / 2) * Rot(0, 90, 0) * key


def milled_cover(s: Sizes) -> Part:
    """A plate with rounded corners, a pocket with rounded corners and four holes."""
    length, width, thick, floor = s(64), s(48), s(14), s(5)
    body = extrude(RectangleRounded(length, width, s(8)), thick)
    body -= Pos(0, 0, floor) * extrude(RectangleRounded(length - s(22), width - s(20), s(6)), BEYOND)
    inset, hole = s(6), s(2.6)
    for x in (-1, 1):
        for y in (-1, 1):
            body -= Pos(x * (length / 2 - inset), y * (width / 2 - inset), 0) * Cylinder(hole, BEYOND)
    return body


def guide_block(s: Sizes) -> Part:
    """A block with a stepped slot along its top, a slot with round ends below, a cross bore, two chamfers."""
    length, width, high = s(60), s(36), s(34)
    body = Box(length, width, high, align=BOTTOM)
    body = chamfer(body.faces().sort_by(Axis.Z)[-1].edges().filter_by(Axis.X), s(4))
    body -= Pos(0, 0, high - s(12)) * Box(BEYOND, s(10), BEYOND, align=BOTTOM)
    body -= Pos(0, 0, high - s(5)) * Box(BEYOND, s(18), BEYOND, align=BOTTOM)
    body -= Pos(length * 0.27, 0, 0) * extrude(SlotOverall(s(18), s(6.5)), BEYOND, both=True)
    return body - Pos(-length * 0.27, 0, high * 0.36) * Rot(90, 0, 0) * Cylinder(s(5), BEYOND)


def coupling_hub(s: Sizes) -> Part:
    """A flange with four holes on a chamfered hub, a keyed bore, a set-screw hole and a slot in the rim."""
    rim, thick, hub, long, edge = s(30), s(8), s(16), s(26), s(1.5)
    body = turn((0, 0), (rim, 0), (rim, thick), (hub, thick), (hub, long - edge), (hub - edge, long), (0, long))
    body = Rot(0, 0, 180) * body  # the seam of the rim goes with the slot: it would split the face in two
    bore = s(8)
    body -= extrude(Circle(bore), BEYOND, both=True)
    body -= Pos(bore, 0, 0) * Box(s(6), s(5), BEYOND)
    around, hole = (rim + hub) / 2, s(2.7)
    for k in range(4):
        body -= Rot(0, 0, 45 + 90 * k) * Pos(around, 0, 0) * Cylinder(hole, BEYOND)
    body -= Pos(0, 0, (thick + long) / 2) * Rot(90, 0, 0) * Cylinder(s(2.4), BEYOND, align=BOTTOM)
    return body - Pos(-rim, 0, 0) * Box(s(9), s(6), BEYOND)
