"""Bundled parts with bosses that stand in a pocket and end below its rim."""

from build123d import Axis, Box, Cylinder, Part, Pos, RectangleRounded, RegularPolygon, Rot, extrude, fillet

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM
from brepgaussian.views.parts.sizes import Sizes


def boss_tray(s: Sizes) -> Part:
    """A tray with a pad and a post of other heights on its floor."""
    length, width, high, floor, wall = s(90), s(60), s(24), s(6), s(6)
    body = Box(length, width, high, align=BOTTOM)
    body -= Pos(0, 0, floor) * Box(length - 2 * wall, width - 2 * wall, BEYOND, align=BOTTOM)
    body += Pos(-length / 5, 0, floor) * Box(s(16), s(22), s(9), align=BOTTOM)
    return body + Pos(length / 5, s(6), floor) * Cylinder(s(8), s(12), align=BOTTOM)


def board_case(s: Sizes) -> Part:
    """A case with rounded corners and four drilled bosses for a circuit board."""
    length, width, high, wall, corner = s(100, 0.1), s(70, 0.1), s(30), 4, s(8, 0.1)
    boss, hole, tall = s(6, 0.1), s(2.8, 0.05), s(14)
    body = extrude(RectangleRounded(length, width, corner), high)
    body -= Pos(0, 0, wall) * extrude(RectangleRounded(length - 2 * wall, width - 2 * wall, corner - wall), BEYOND)
    for x in (-1, 1):
        for y in (-1, 1):
            place = Pos(x * length * 0.33, y * width * 0.27, 0)
            body += place * Pos(0, 0, wall) * Cylinder(boss, tall, align=BOTTOM)
            body -= place * Cylinder(hole, BEYOND)
    return body


def post_pan(s: Sizes) -> Part:
    """A round pan with a bore and three posts around it."""
    radius, high, floor, wall = s(40, 0.1), s(22), s(6), s(6)
    body = Cylinder(radius, high, align=BOTTOM) - Pos(0, 0, floor) * Cylinder(radius - wall, BEYOND, align=BOTTOM)
    reach, post, tall = radius / 2, s(5.5, 0.1), s(8)
    for k in range(3):
        body += Rot(0, 0, 120 * k) * Pos(reach, 0, floor) * Cylinder(post, tall, align=BOTTOM)
    return body - Cylinder(s(6, 0.1), BEYOND)


def sensor_dish(s: Sizes) -> Part:
    """A block with a round pocket, in which a square post stands below the rim, between two bores."""
    side, high, floor, wide = s(60, 0.1), s(26), s(7), s(24, 0.08)
    body = Box(side, side, high, align=BOTTOM) - Pos(0, 0, floor) * Cylinder(wide, BEYOND, align=BOTTOM)
    body += Pos(0, 0, floor) * Rot(0, 0, 20) * Box(s(14), s(14), s(11), align=BOTTOM)
    for x in (-1, 1):
        body -= Pos(x * wide * 0.68, 0, 0) * Cylinder(s(3.5, 0.1), BEYOND)
    return body


def terminal_box(s: Sizes) -> Part:
    """A box with round inner corners, two long pads across its floor, and a notch in one wall."""
    length, width, high, floor, wall = s(80), s(56), s(28), s(6), s(6)
    body = Box(length, width, high, align=BOTTOM)
    body -= Pos(0, 0, floor) * extrude(RectangleRounded(length - 2 * wall, width - 2 * wall, s(7, 0.1)), BEYOND)
    long, wide, tall = s(26), s(9), s(10)
    for x in (-1, 1):
        body += Pos(x * length / 6, 0, floor) * Box(wide, long, tall, align=BOTTOM)
    return body - Pos(length / 2, 0, high - s(7)) * Box(3 * wall, s(16), BEYOND, align=BOTTOM)


def meter_box(s: Sizes) -> Part:
    """A box with round inner corners, a long pad and a round post on its floor, a notch in one wall, two drains."""
    length, width, high, floor, wall = s(74), s(60), s(26), s(5), s(6)
    body = Box(length, width, high, align=BOTTOM)
    body -= Pos(0, 0, floor) * extrude(RectangleRounded(length - 2 * wall, width - 2 * wall, s(9, 0.1)), BEYOND)
    body += Pos(-length * 0.16, 0, floor) * Box(s(10), s(24), s(8), align=BOTTOM)
    body += Pos(length * 0.17, width * 0.08, floor) * Cylinder(s(7, 0.1), s(11), align=BOTTOM)
    for y in (-1, 1):
        body -= Pos(length * 0.3, y * width * 0.27, 0) * Cylinder(s(2.5, 0.1), BEYOND)
    return body - Pos(-length / 2, 0, high * 0.7) * Box(3 * wall, s(18), BEYOND, align=BOTTOM)


def notched_tray(s: Sizes) -> Part:
    """A tray with two pads on its floor and a notch through one wall, for a cable."""
    length, width, high, floor, wall = s(84), s(54), s(24), s(5), 5
    body = Box(length, width, high, align=BOTTOM)
    body -= Pos(0, 0, floor) * Box(length - 2 * wall, width - 2 * wall, BEYOND, align=BOTTOM)
    for side in (-1, 1):
        body += Pos(side * length * 0.26, side * width * 0.15, floor) * Box(s(12), s(14), s(9), align=BOTTOM)
    return body - Pos(s(10), width / 2, high * 0.58) * Box(s(16), 4 * wall, BEYOND, align=BOTTOM)


def notched_pan(s: Sizes) -> Part:
    """A round pan on a square foot, a post on its floor and a notch through its wall."""
    radius, high, floor, wall, foot = s(36, 0.1), s(26), s(6), s(6), s(86, 0.05)
    body = Cylinder(radius, high, align=BOTTOM) + Box(foot, foot, floor, align=BOTTOM)
    body -= Pos(0, 0, floor) * Cylinder(radius - wall, BEYOND, align=BOTTOM)
    body += Pos(-radius / 3, 0, floor) * Cylinder(s(7, 0.1), s(10), align=BOTTOM)
    for x in (-1, 1):
        for y in (-1, 1):
            body -= Pos(x * foot * 0.42, y * foot * 0.42, 0) * Cylinder(s(3, 0.1), BEYOND)
    return body - Pos(radius, 0, high * 0.6) * Box(radius, s(14), BEYOND, align=BOTTOM)


def relay_base(s: Sizes) -> Part:
    """A base with two eared holes, a round and a square post in its pocket, and a notch in the pocket's rim."""
    length, width, high, floor, wall = s(64, 0.1), s(48, 0.1), s(22), s(5), s(6)
    ears = length + s(30, 0.1)
    body = Box(ears, s(26), floor, align=BOTTOM) + Box(length, width, high, align=BOTTOM)
    body -= Pos(0, 0, floor) * Box(length - 2 * wall, width - 2 * wall, BEYOND, align=BOTTOM)
    body += Pos(-length * 0.2, width * 0.08, floor) * Cylinder(s(5, 0.1), s(9), align=BOTTOM)
    body += Pos(length * 0.18, -width * 0.06, floor) * Box(s(10), s(9), s(7), align=BOTTOM)
    for x in (-1, 1):
        body -= Pos(x * (length + ears) / 4, 0, 0) * Cylinder(s(3, 0.1), BEYOND)
    return body - Pos(0, -width / 2, high * 0.55) * Box(s(14), 4 * wall, BEYOND, align=BOTTOM)


def slotted_cup(s: Sizes) -> Part:
    """A round cup on a hexagon, with a slot in its wall and three holes through its floor."""
    radius, high, foot, floor, wall = s(26, 0.08), s(34), s(8, 0.1), s(10, 0.1), s(5, 0.1)
    body = extrude(RegularPolygon(s(36, 0.06), 6), foot) + Cylinder(radius, high, align=BOTTOM)
    body -= Pos(0, 0, floor) * Cylinder(radius - wall, BEYOND, align=BOTTOM)
    reach, hole = s(10, 0.1), s(2.5)
    for k in range(3):
        body -= Rot(0, 0, 120 * k) * Pos(reach, 0, 0) * Cylinder(hole, BEYOND)
    return body - Pos(0, radius, high * 0.6) * Box(s(11), radius, BEYOND, align=BOTTOM)


def spout_pot(s: Sizes) -> Part:
    """A thin-walled round pot on a flange with four holes, a square spout cut into its wall."""
    radius, high, flange, thick, wall = s(24, 0.08), s(30), s(36, 0.05), s(6), s(3.5, 0.1)
    body = Cylinder(flange, thick, align=BOTTOM) + Cylinder(radius, high, align=BOTTOM)
    body -= Pos(0, 0, thick + s(3)) * Cylinder(radius - wall, BEYOND, align=BOTTOM)
    reach, hole = (radius + flange) / 2, s(2.2)
    for k in range(4):
        body -= Rot(0, 0, 45 + 90 * k) * Pos(reach, 0, 0) * Cylinder(hole, BEYOND)
    return body - Pos(-radius, 0, high * 0.65) * Box(radius, s(13), BEYOND, align=BOTTOM)


def drain_cup(s: Sizes) -> Part:
    """A round cup on a square foot, two slots of different depths in its rim, holes through its floor."""
    radius, high, wall, foot, thick = s(21, 0.08), s(27), s(3.5, 0.1), s(60, 0.05), s(5)
    body = Box(foot, foot, thick, align=BOTTOM) + Cylinder(radius, high, align=BOTTOM)
    body -= Pos(0, 0, thick + s(2)) * Cylinder(radius - wall, BEYOND, align=BOTTOM)
    for turn, deep in ((20, s(9)), (160, s(14))):
        slot = Pos(radius, 0, high - deep) * Box(radius, s(8, 0.1), BEYOND, align=BOTTOM)
        body -= Rot(0, 0, turn) * slot
    for k in range(3):
        body -= Rot(0, 0, 120 * k + 90) * Pos(radius * 0.45, 0, 0) * Cylinder(s(2.5, 0.1), BEYOND)
    return body


def battery_case(s: Sizes) -> Part:
    """A case whose floor a low wall divides, with two notches of different widths in one of its walls."""
    length, width, high, floor, wall = s(84), s(52), s(24), s(5), s(4.5, 0.1)
    body = Box(length, width, high, align=BOTTOM)
    body -= Pos(0, 0, floor) * Box(length - 2 * wall, width - 2 * wall, BEYOND, align=BOTTOM)
    body += Pos(length * 0.12, 0, floor) * Box(s(4, 0.1), width - wall, s(11), align=BOTTOM)
    for x, wide in ((-0.25, s(9)), (0.3, s(14))):
        body -= Pos(x * length, width / 2, high - s(6)) * Box(wide, 3 * wall, BEYOND, align=BOTTOM)
    return body


def relay_tray(s: Sizes) -> Part:
    """A tray that two low walls of different heights divide, a notch in each of two walls, a hole in its floor."""
    length, width, high, floor, wall = s(80), s(48), s(20), s(4), s(4.5, 0.1)
    body = Box(length, width, high, align=BOTTOM)
    body -= Pos(0, 0, floor) * Box(length - 2 * wall, width - 2 * wall, BEYOND, align=BOTTOM)
    for x, tall in ((-0.2, s(7)), (0.18, s(10))):
        body += Pos(x * length, 0, floor) * Box(s(3.5, 0.1), width - wall, tall, align=BOTTOM)
    body -= Pos(length / 2, s(4), high - s(7)) * Box(3 * wall, s(12), BEYOND, align=BOTTOM)
    body -= Pos(-length * 0.3, -width / 2, high - s(5)) * Box(s(10), 3 * wall, BEYOND, align=BOTTOM)
    return body - Pos(length * 0.34, 0, 0) * Cylinder(s(4, 0.1), BEYOND)


def screw_case(s: Sizes) -> Part:
    """A thin case with rounded upright edges, a drilled boss in each corner."""
    length, width, high, wall, round_ = s(72, 0.1), s(52, 0.1), s(24), s(4), s(9)
    body = fillet(Box(length, width, high, align=BOTTOM).edges().filter_by(Axis.Z), round_)
    inside = Box(length - 2 * wall, width - 2 * wall, high, align=BOTTOM)
    body -= Pos(0, 0, wall) * fillet(inside.edges().filter_by(Axis.Z), round_ - wall)
    boss, tall = s(5, 0.1), high - s(6)
    for x in (-1, 1):
        for y in (-1, 1):
            at = Pos(x * (length / 2 - wall - boss * 1.6), y * (width / 2 - wall - boss * 1.6), wall)
            body += at * Cylinder(boss, tall - wall, align=BOTTOM)
            body -= at * Pos(0, 0, tall * 0.3) * Cylinder(boss * 0.5, BEYOND, align=BOTTOM)
    return body
