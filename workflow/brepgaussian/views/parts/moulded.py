"""Bundled parts that are moulded or milled all over: bricks, clips, impellers, jigs, knobs, boxes."""

from build123d import (
    Align,
    Axis,
    Box,
    Circle,
    Cylinder,
    Part,
    Polygon,
    Pos,
    Rectangle,
    RectangleRounded,
    Rot,
    SlotOverall,
    Sphere,
    chamfer,
    extrude,
    fillet,
)

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM, profile
from brepgaussian.views.parts.sizes import Sizes


def stud_brick(s: Sizes) -> Part:
    """A brick with six studs, hollow below, two tubes in the hollow."""
    pitch, high, wall, stud, up, top = s(16), s(19), s(3, 0.1), s(4.8), s(4), s(4)
    body = Box(3 * pitch, 2 * pitch, high, align=BOTTOM)
    body -= Box(3 * pitch - 2 * wall, 2 * pitch - 2 * wall, high - top, align=BOTTOM)
    for x in (-1.0, 0.0, 1.0):
        for y in (-0.5, 0.5):
            body += Pos(x * pitch, y * pitch, high) * Cylinder(stud, up, align=BOTTOM)
    for x in (-0.5, 0.5):
        tube = Cylinder(pitch * 0.4, high - top, align=BOTTOM) - Cylinder(pitch * 0.28, high - top, align=BOTTOM)
        body += Pos(x * pitch, 0, 0) * tube
    return body


def vane_disc(s: Sizes) -> Part:
    """An impeller: a disc with six straight vanes and a bored hub."""
    rim, thick, hub, high, vane, wide = s(36, 0.05), s(5), s(11), s(20, 0.05), s(13, 0.05), s(3.6, 0.1)
    body = Cylinder(rim, thick, align=BOTTOM) + Cylinder(hub, high, align=BOTTOM)
    for k in range(6):
        blade = Box(rim * 0.94, wide, thick + vane, align=(Align.MIN, Align.CENTER, Align.MIN))
        body += Rot(0, 0, 60 * k) * blade
    return body - Cylinder(s(5), BEYOND)


def cable_clip(s: Sizes) -> Part:
    """A C that is open above, on a foot with a hole on each side."""
    bore, wall, wide, foot, thick, gap = s(11), s(4), s(24), s(62), s(6), s(13)
    high = bore + wall + thick * 0.5
    body = Pos(0, 0, high) * Rot(90, 0, 0) * Cylinder(bore + wall, wide)
    body += Box(foot, wide, thick, align=BOTTOM)
    body -= Pos(0, 0, high) * Rot(90, 0, 0) * Cylinder(bore, BEYOND)
    body -= Pos(0, 0, high) * Box(gap, BEYOND, BEYOND, align=BOTTOM)
    for x in (-1, 1):
        body -= Pos(x * foot * 0.39, 0, 0) * Cylinder(s(3, 0), BEYOND)
    return body


def star_knob(s: Sizes) -> Part:
    """A knob of five round lobes around a disc, a hub below, a blind bore."""
    disc, thick, lobe, hub, low = s(22), s(14), s(8.5), s(11), s(12)
    body = Cylinder(disc, thick, align=BOTTOM) + Pos(0, 0, -low) * Cylinder(hub, low, align=BOTTOM)
    for k in range(5):
        body += Rot(0, 0, 72 * k) * Pos(disc, 0, 0) * Cylinder(lobe, thick, align=BOTTOM)
    return body - Pos(0, 0, -low) * Cylinder(s(5), s(16), align=BOTTOM)


def split_block(s: Sizes) -> Part:
    """A bearing block with a seat of half the width, two bolt ears lower than its middle."""
    length, width, high, ear, bore = s(76, 0.06), s(30), s(34, 0.04), s(14, 0.04), s(12, 0.04)
    mid = length - 2 * s(20)
    body = Box(length, width, ear, align=BOTTOM) + Box(mid, width, high, align=BOTTOM)
    at = Pos(0, 0, high * 0.55) * Rot(90, 0, 0)
    body -= at * Cylinder(bore, BEYOND)
    body -= at * Pos(0, 0, width / 2) * Cylinder(bore + 3, width * 0.4 * 2)
    for x in (-1, 1):
        body -= Pos(x * (length / 2 + mid / 2) / 2, 0, 0) * Cylinder(s(4, 0), BEYOND)
    return chamfer(body.edges().filter_by(Axis.Y).sort_by(Axis.Z)[-2:], s(4))


def drill_jig(s: Sizes) -> Part:
    """A plate with two bushings that stand out on top, one of them leaning, and two dowel holes."""
    length, width, thick, out, hole, up = s(76), s(36), s(12), s(9), s(4.5), s(8)
    body = Box(length, width, thick, align=BOTTOM)
    places = (Pos(-length * 0.24, 0, thick / 2), Pos(length * 0.2, 0, thick / 2) * Rot(0, s(18), 0))
    for at in places:
        body += at * Cylinder(out, thick / 2 + up, align=BOTTOM)
    for at in places:
        body -= at * Cylinder(hole, BEYOND)
    for x in (-1, 1):
        body -= Pos(x * length * 0.43, x * width * 0.34, 0) * Cylinder(s(2.6, 0), BEYOND)
    return body


def disc_key(s: Sizes) -> Part:
    """A Woodruff key: a disc cut flat a little above its middle, thick, chamfered on its flat."""
    r, thick, up = s(26), s(12), s(5)
    body = Rot(90, 0, 0) * Cylinder(r, thick) - Pos(0, 0, up) * Box(BEYOND, BEYOND, BEYOND, align=BOTTOM)
    return chamfer(body.faces().sort_by(Axis.Z)[-1].edges().filter_by(Axis.X), s(1.8))


def round_box(s: Sizes) -> Part:
    """An open box: rounded corners outside and inside, a rounded foot, a step around its rim."""
    length, width, high, wall, corner, foot = s(70), s(46), s(26), s(4.5), s(10), s(4)
    body = extrude(RectangleRounded(length, width, corner), high)
    body = fillet(body.faces().sort_by(Axis.Z)[0].edges(), foot)
    inner = extrude(RectangleRounded(length - 2 * wall, width - 2 * wall, corner - wall), BEYOND)
    body -= Pos(0, 0, wall * 1.2) * inner
    step = extrude(RectangleRounded(length - wall, width - wall, corner - wall / 2), BEYOND)
    return body - Pos(0, 0, high - s(3)) * step


def dimple_cube(s: Sizes) -> Part:
    """A cube with chamfered upright edges and spherical hollows in three faces."""
    side, cut, ball = s(40, 0.08), s(4), s(13)
    body = chamfer(Box(side, side * 0.9, side * 0.8).edges().filter_by(Axis.Z), cut)
    for at in ((side / 2, 0, 0), (0, side * 0.45, 0), (0, 0, side * 0.4)):
        body -= Pos(*(c * (1 + 0.35 * ball / (side / 2)) for c in at)) * Sphere(ball)
    return body


def step_pyramid(s: Sizes) -> Part:
    """Four square steps, each turned by some degrees, bored through."""
    side, step, turned = s(56), s(8), s(9)
    body = Part()
    for k in range(4):
        wide = side * (1 - 0.22 * k)
        body += Pos(0, 0, k * step) * Rot(0, 0, k * turned) * Box(wide, wide, step, align=BOTTOM)
    return body - Cylinder(s(6), BEYOND)


def hinge_knuckle(s: Sizes) -> Part:
    """A leaf with three knuckles in a row, gaps between, a pin hole through all, two slots."""
    wide, leaf, thick, knuckle, pin = s(66), s(38), s(5), s(7.5), s(3.5)
    body = Box(wide, leaf, thick, align=(Align.CENTER, Align.MAX, Align.MIN))
    body += Pos(0, 0, knuckle) * Rot(0, 90, 0) * Cylinder(knuckle, wide)
    gap = wide / 5
    for x in (-1, 1):
        body -= Pos(x * gap, 0, 0) * Box(gap, 2 * (knuckle + 1), BEYOND)
        slot = extrude(SlotOverall(s(14, 0), s(6, 0)), BEYOND, both=True)
        body -= Pos(x * wide * 0.28, -leaf * 0.62, 0) * slot
    return body - Pos(0, 0, knuckle) * Rot(0, 90, 0) * Cylinder(pin, BEYOND)


def louver_panel(s: Sizes) -> Part:
    """A thin panel with two ribs of a triangle's section across it and a bent lip."""
    length, width, thick, lip, rib = s(78), s(50), s(4, 0.1), s(14), s(9)
    body = profile((0, 0), (length, 0), (length, thick), (thick, thick), (thick, lip), (0, lip), depth=width)
    for k in (1, 2):
        at = length * k / 3
        body += profile((at, thick), (at + rib * 1.4, thick), (at, thick + rib), depth=width * 0.8)
    for y in (-1, 1):
        body -= Pos(length * 0.9, y * width * 0.36, 0) * Cylinder(s(3, 0), BEYOND)
    return body


def motor_plate(s: Sizes) -> Part:
    """A plate that tapers to a round end, a wide bore, four small holes around it, a slot that leans."""
    side, r, long, thick, bore = s(52), s(13), s(44), s(8), s(15)
    tail = Polygon((side / 2, -side / 2), (side / 2 + long, -r), (side / 2 + long, r), (side / 2, side / 2), align=None)
    body = extrude(Rectangle(side, side) + tail + Pos(side / 2 + long, 0) * Circle(r), thick)
    body -= Cylinder(bore, BEYOND)
    for k in range(4):
        body -= Rot(0, 0, 45 + 90 * k) * Pos(bore + s(8, 0), 0, 0) * Cylinder(s(2.6, 0), BEYOND)
    slot = extrude(SlotOverall(s(24), s(8), rotation=s(30)), BEYOND, both=True)
    return body - Pos(side / 2 + long * 0.7, 0, 0) * slot


def tool_tray(s: Sizes) -> Part:
    """A block with three round-ended troughs of different depths across its top."""
    length, width, high = s(76, 0.05), s(44, 0), s(24)
    body = Box(length, width, high, align=BOTTOM)
    for k, r in ((-1, s(7, 0)), (0, s(9, 0)), (1, s(5.5, 0.05))):
        trough = Rot(90, 0, 0) * Cylinder(r, width * 0.7) + Pos(0, width * 0.35, 0) * Sphere(r)
        trough += Pos(0, -width * 0.35, 0) * Sphere(r)
        body -= Pos(k * length * 0.31, 0, high) * trough
    return body


def profile_end(s: Sizes) -> Part:
    """An end cap: a rounded plate, a rounded square plug below, a slot across the plug, a hole."""
    side, thick, corner, plug, low = s(44, 0.06), s(7), s(7), s(32, 0.06), s(16)
    body = extrude(RectangleRounded(side, side, corner), thick)
    body += Pos(0, 0, -low) * extrude(Rectangle(plug, plug), low)
    body -= Pos(0, 0, -low) * Box(BEYOND, s(12, 0.06), s(11), align=BOTTOM)
    return body - Cylinder(s(5, 0.06), BEYOND)
