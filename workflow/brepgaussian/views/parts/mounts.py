"""Bundled parts that hold others: plates, collars, cradles, made for scoring only."""

from build123d import (
    Axis,
    Box,
    Circle,
    Cylinder,
    Part,
    Plane,
    Polygon,
    Pos,
    RectangleRounded,
    RegularPolygon,
    Rot,
    SlotOverall,
    extrude,
    fillet,
)

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM
from brepgaussian.views.parts.sizes import Sizes
from brepgaussian.views.parts.turned import turn


def motor_mount(s: Sizes) -> Part:
    """A square plate with a raised ring around its bore and four diagonal slots with round ends."""
    side, thick, ring, high, bore = s(64), s(9), s(14), s(5), s(9)
    body = Box(side, side, thick, align=BOTTOM) + Pos(0, 0, thick) * Cylinder(ring, high, align=BOTTOM)
    body -= Cylinder(bore, BEYOND)
    slot = extrude(SlotOverall(s(13), s(5)), BEYOND, both=True)
    for k in range(4):
        body -= Rot(0, 0, 45 + 90 * k) * Pos(side * 0.48, 0, 0) * slot
    return body


def spindle_nose(s: Sizes) -> Part:
    """A flange with three holes, a taper, and a bored shank with two flats."""
    rim, thick, foot, long = s(28), s(9), s(17), s(18)
    top, shank, reach = foot - s(3), s(9), s(20)
    cone, end = thick + long, thick + long + reach
    body = turn((0, 0), (rim, 0), (rim, thick), (foot, thick), (top, cone), (shank, cone), (shank, end), (0, end))
    body -= extrude(Circle(s(4.5)), BEYOND, both=True)
    flat, hole = s(7, 0.05), s(2.5)
    for k in range(2):
        body -= Rot(0, 0, 180 * k) * Pos(flat + rim, 0, end - 0.6 * reach) * Box(2 * rim, BEYOND, BEYOND, align=BOTTOM)
    for k in range(3):
        body -= Rot(0, 0, 120 * k) * Pos((rim + foot) / 2, 0, 0) * Cylinder(hole, BEYOND)
    return body


def lock_plate(s: Sizes) -> Part:
    """An angular plate with one rounded corner, a notch in one end, a counterbored hole in either leg."""
    long, leg, high, thick = s(60), s(22), s(56), s(10)
    plan = Polygon((0, 0), (long, 0), (long, leg), (leg, leg), (leg, high), (0, high), align=None)
    body = extrude(plan, thick)
    body = fillet(body.edges().filter_by(Axis.Z).sort_by(lambda e: e.center().X + e.center().Y)[:1], s(9))
    body -= Pos(leg / 2, high, 0) * Box(s(7), 2 * s(9), BEYOND)
    hole, head, deep = s(3.2), s(6), s(5)
    for x, y in ((leg / 2, 0.6 * high), (0.8 * long, leg / 2)):
        body -= Pos(x, y, 0) * Cylinder(hole, BEYOND)
        body -= Pos(x, y, thick - deep) * Cylinder(head, BEYOND, align=BOTTOM)
    return body


def stop_collar(s: Sizes) -> Part:
    """A chamfered ring with a slit, and a counterbored hole for its screw across the slit."""
    rim, bore, wide, edge = s(22, 0.05), s(11, 0.05), s(16), s(1.5)
    body = turn((bore, 0), (rim - edge, 0), (rim, edge), (rim, wide - edge), (rim - edge, wide), (bore, wide))
    body -= Pos(rim, 0, 0) * Box(2 * (rim - bore / 2), s(3), BEYOND)
    at = Pos((rim + bore) / 2, 0, wide / 2) * Rot(-90, 0, 0)
    body -= at * Cylinder(s(1.9), BEYOND)
    return body - at * Pos(0, 0, s(8)) * Cylinder(s(3.4), BEYOND, align=BOTTOM)


def cradle_block(s: Sizes) -> Part:
    """A block with a round cradle across its top, a groove along either side, and two holes."""
    wide, deep, high, round_ = s(60), s(34), s(30), s(12)
    body = Box(wide, deep, high, align=BOTTOM)
    body -= Pos(0, 0, high + s(2)) * Rot(90, 0, 0) * Cylinder(round_, BEYOND)
    groove, into, hole = s(6), s(2.6), s(3)
    for side in (-1, 1):
        body -= Pos(side * wide / 2, 0, high / 3) * Box(2 * into, BEYOND, groove)
        body -= Pos(side * (wide / 2 - 7.5), 0, 0) * Cylinder(hole, BEYOND)
    return body


def drive_plate(s: Sizes) -> Part:
    """A disk with a flat on its rim, a boss with a hexagonal hole, three slots with round ends across the radius."""
    rim, thick, boss, high = s(38, 0.05), s(10), s(17, 0.08), s(9)
    body = turn((0, 0), (rim, 0), (rim, thick), (boss, thick), (boss, thick + high), (0, thick + high))
    body = Rot(0, 0, 180) * body  # the seam of the rim goes with the flat: it would split the face in two
    body -= extrude(RegularPolygon(s(9, 0.1), 6, major_radius=False), BEYOND, both=True)
    slot = extrude(SlotOverall(s(20), s(7)), BEYOND, both=True)
    for k in range(3):
        body -= Rot(0, 0, 60 + 120 * k) * Pos((rim + boss) / 2, 0, 0) * Rot(0, 0, 90) * slot
    return body - Pos(-rim - s(33, 0.02), 0, 0) * Box(2 * rim, BEYOND, BEYOND)


def split_hub(s: Sizes) -> Part:
    """A stepped hub with a slit through one side, a counterbored hole for its screw across that, and a keyway."""
    rim, step, bore, wide, high = s(25, 0.05), s(18, 0.05), s(9, 0.05), s(18), s(10)
    body = turn((bore, 0), (rim, 0), (rim, wide), (step, wide), (step, wide + high), (bore, wide + high))
    body -= Pos(rim, 0, 0) * Box(2 * (rim - bore / 2), s(3), BEYOND)
    body -= Pos(-bore, 0, 0) * Box(s(5), s(5), BEYOND)
    at, hole = Pos((rim + bore) / 2, 0, wide / 2), s(2.5, 0.1)
    body -= at * Rot(90, 0, 0) * Cylinder(hole, BEYOND)
    return body - at * Pos(0, -s(8), 0) * Rot(90, 0, 0) * Cylinder(1.8 * hole, BEYOND, align=BOTTOM)


def rail_carriage(s: Sizes) -> Part:
    """A block that runs on a rail: a groove with sloped sides below, four blind holes above, a hole for its grease."""
    long, wide, high, groove, deep = s(56), s(46), s(22), s(18), s(10)
    lean = s(4, 0.1)
    body = Box(long, wide, high, align=BOTTOM)
    sides = ((-groove / 2, -1), (groove / 2, -1), (groove / 2 + lean, deep), (-groove / 2 - lean, deep))
    body -= extrude(Plane.YZ * Polygon(*sides, align=None), BEYOND, both=True)
    for x in (-1, 1):
        for y in (-1, 1):
            body -= Pos(x * long * 0.32, y * wide * 0.34, high - s(8)) * Cylinder(s(2.6, 0.1), BEYOND, align=BOTTOM)
    return body - Pos(0, wide / 2, high * 0.75) * Rot(90, 0, 0) * Cylinder(s(2.2, 0.1), 2 * s(9))


def pillow_foot(s: Sizes) -> Part:
    """A wedge over a plate with two slots, a bore along the plate through its leaning face."""
    long, wide, thick, tall = s(64), s(30), s(8), s(26)
    body = Box(long, wide, thick, align=BOTTOM)
    wedge = ((-s(15), thick), (s(15), thick), (s(15), thick + tall), (s(3), thick + tall))
    body += extrude(Plane.XZ * Polygon(*wedge, align=None), wide / 2, both=True)
    body -= Pos(0, 0, thick + tall / 2) * Rot(0, 90, 0) * Cylinder(s(6, 0.1), BEYOND)
    for side in (-1, 1):
        body -= Pos(side * long * 0.38, 0, 0) * Rot(0, 0, 90) * extrude(SlotOverall(s(14), s(6)), BEYOND, both=True)
    return body


def cam_plate(s: Sizes) -> Part:
    """A plate with an eccentric disk, a slot beside it, and counterbored holes at three of its corners."""
    long, wide, thick, disk, tall = s(70), s(46), s(9), s(14, 0.06), s(11)
    body = Box(long, wide, thick, align=BOTTOM)
    body += Pos(-long * 0.12, s(2), thick) * Cylinder(disk, tall, align=BOTTOM)
    body -= Pos(-long * 0.12 + s(4), s(2), 0) * Cylinder(s(5, 0.1), BEYOND)
    body -= Pos(long * 0.32, 0, 0) * Rot(0, 0, 90) * extrude(SlotOverall(s(24), s(7)), BEYOND, both=True)
    for x, y in ((-1, -1), (-1, 1), (1, -1)):
        at = Pos(x * long * 0.42, y * wide * 0.38, 0)
        body -= at * Cylinder(s(1.9, 0.05), BEYOND) + at * Pos(0, 0, thick - s(3)) * Cylinder(3.4, BEYOND, align=BOTTOM)
    return body


def gib_block(s: Sizes) -> Part:
    """A block with a step, a slot along it from below, a blind hole in its end and two bolt holes across."""
    long, wide, high = s(60), s(34), s(30)
    body = Box(long, wide, high, align=BOTTOM)
    body -= Pos(0, wide / 2, high - s(10)) * Box(BEYOND, s(24), BEYOND, align=BOTTOM)
    body -= Pos(0, -wide * 0.12, 0) * Box(BEYOND, s(9), 2 * s(8))
    body -= Pos(long / 2, -wide * 0.2, high * 0.72) * Rot(0, 90, 0) * Cylinder(s(4, 0.1), 2 * s(9))
    for x in (-1, 1):
        body -= Pos(x * long * 0.3, wide * 0.28, 0) * Cylinder(s(2.8, 0.1), BEYOND)
    return body


def latch_arm(s: Sizes) -> Part:
    """An arm with a round end and a bore, a hook with a sloped nose, a rib between them."""
    long, wide, thick = s(64), s(16), s(8)
    body = Box(long, wide, thick, align=BOTTOM) + Pos(-long / 2, 0, 0) * Cylinder(wide / 2, thick, align=BOTTOM)
    body -= Pos(-long / 2, 0, 0) * Cylinder(s(4, 0.1), BEYOND)
    nose = ((long / 2 - s(12), thick), (long / 2, thick), (long / 2, thick + s(5)), (long / 2 - s(9), thick + s(13)))
    body += extrude(Plane.XZ * Polygon(*nose, align=None), wide / 2, both=True)
    return body + Pos(-s(3), 0, thick) * Box(s(30), s(5, 0.1), s(6), align=BOTTOM)


def set_pin(s: Sizes) -> Part:
    """A headed pin with a flat for a set screw between its ends, and a cross hole near its tip."""
    head, thick, shank, long = s(16), s(8), s(10), s(58)
    body = turn((0, 0), (head, 0), (head, thick), (shank, thick), (shank, long), (0, long))
    flat, start, run = s(7.5, 0.05), thick + s(12), s(18)
    body -= Pos(flat + head, 0, start + run / 2) * Box(2 * head, BEYOND, run)
    return body - Pos(0, 0, long - s(9)) * Rot(90, 0, 0) * Cylinder(s(3), BEYOND)


def port_cover(s: Sizes) -> Part:
    """A round cover with a bored boss underneath, off its middle, and two screw holes."""
    rim, thick, boss, low, bore = s(32), s(8), s(13), s(10), s(8)
    body = Cylinder(rim, thick, align=BOTTOM)
    at = Pos(s(6), s(4), 0)
    body += at * Rot(180, 0, 0) * Cylinder(boss, low, align=BOTTOM)
    body -= at * Cylinder(bore, BEYOND)
    for k in range(2):
        body -= Rot(0, 0, 90 + 180 * k) * Pos(rim - s(7), 0, 0) * Cylinder(s(3), BEYOND)
    return body


def machine_foot(s: Sizes) -> Part:
    """A square foot with rounded corners on a low round pad, a chamfered stud above, off its middle."""
    side, thick, corner, pad, low = s(50), s(9), s(7), s(18), s(1.8)
    stud, high, edge = s(7), s(34), s(1.5)
    body = extrude(RectangleRounded(side, side, corner), thick)
    body += Pos(s(2), 0, -low) * Cylinder(pad, 2 * low, align=BOTTOM)
    top = thick + high
    return body + Pos(-s(5), s(3), 0) * turn((0, 0), (stud, 0), (stud, top - edge), (stud - edge, top), (0, top))
