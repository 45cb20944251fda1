"""Bundled parts whose holes meet each other: set screws, ports, vents."""

from build123d import Axis, Box, Cone, Cylinder, Part, Pos, Rot, SlotOverall, chamfer, extrude

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM
from brepgaussian.views.parts.sizes import Sizes
from brepgaussian.views.parts.turned import turn


def shaft_collar(s: Sizes) -> Part:
    """A ring, chamfered outside on both sides, with two set-screw holes a quarter turn apart."""
    outer, bore, wide, edge = s(22), s(10, 0.1), s(18), s(1.5)
    body = turn((bore, 0), (outer - edge, 0), (outer, edge), (outer, wide - edge), (outer - edge, wide), (bore, wide))
    for angle in (0, 90):
        body -= Rot(0, 0, angle) * Pos(0, 0, wide / 2) * Rot(0, 90, 0) * Cylinder(s(3), BEYOND, align=BOTTOM)
    return body


def manifold_block(s: Sizes) -> Part:
    """A chamfered block with a blind bore along it, which two ports from above meet; one port is counterbored."""
    length, width, high, bore = s(70), s(32), s(34), s(6, 0.1)
    body = Box(length, width, high, align=BOTTOM)
    body = chamfer(body.faces().sort_by(Axis.Z)[-1].edges().filter_by(Axis.X), s(3))
    body -= Pos(length / 2, 0, high * 0.4) * Rot(0, -90, 0) * Cylinder(bore, length * 0.8, align=BOTTOM)
    for x, radius in ((-0.18, s(4, 0.1)), (0.22, s(3.2, 0.1))):
        body -= Pos(x * length, 0, high * 0.4) * Cylinder(radius, BEYOND, align=BOTTOM)
    return body - Pos(-0.18 * length, 0, high - s(6)) * Cylinder(s(8, 0.1), BEYOND, align=BOTTOM)


def hub_flange(s: Sizes) -> Part:
    """A flange with four holes and a tapered hub, in which a set-screw hole meets the bore."""
    radius, thick, hub, tall, bore = s(36), s(9), s(16, 0.1), s(22), s(8, 0.1)
    body = Cylinder(radius, thick, align=BOTTOM)
    body += Pos(0, 0, thick) * Cone(hub, hub * 0.85, tall, align=BOTTOM)
    for k in range(4):
        body -= Rot(0, 0, 45 + 90 * k) * Pos(radius * 0.73, 0, 0) * Cylinder(s(3.5, 0.0), BEYOND)
    body -= Pos(0, 0, thick + tall * 0.55) * Rot(0, 90, 0) * Cylinder(s(2.8), BEYOND, align=BOTTOM)
    return body - Cylinder(bore, BEYOND)


def vise_stop(s: Sizes) -> Part:
    """A stepped stop with a long slot through its foot, and a thumb-screw hole that crosses a pin's blind bore."""
    length, width, foot, high, deep = s(64), s(30), s(11), s(36), s(20)
    body = Box(length, width, foot, align=BOTTOM)
    body += Pos(-length / 2 + deep / 2, 0, 0) * Box(deep, width, high, align=BOTTOM)
    body -= Pos(deep / 2, 0, 0) * extrude(SlotOverall(s(26), s(8, 0.1)), BEYOND, both=True)
    at = Pos(-length / 2 + deep / 2, 0, high - s(9, 0.1))
    body -= at * Rot(90, 0, 0) * Pos(0, 0, -width / 2) * Cylinder(s(4.5, 0.1), width * 0.75, align=BOTTOM)
    return body - at * Rot(0, -90, 0) * Cylinder(s(2.6, 0.1), BEYOND, align=BOTTOM)


def valve_block(s: Sizes) -> Part:
    """A block with two blind bores side by side, which a hole from its end joins."""
    length, width, high, bore = s(66), s(40), s(30), s(5, 0.1)
    body = Box(length, width, high, align=BOTTOM)
    for x in (-1, 1):
        at = Pos(x * length * 0.22, -width / 2, high / 2)
        body -= at * Rot(-90, 0, 0) * Cylinder(bore, width * 0.7, align=BOTTOM)
    end = Pos(length / 2, -width * 0.2, high / 2) * Rot(0, -90, 0)
    return body - end * Cylinder(s(3, 0.1), length * 0.72, align=BOTTOM)


def union_cross(s: Sizes) -> Part:
    """A block with two bores that cross, and a port from above into them."""
    length, width, high = s(44), s(40), s(36)
    body = Box(length, width, high, align=BOTTOM)
    body -= Pos(0, 0, high / 2) * Rot(0, 90, 0) * Cylinder(s(7, 0.05), BEYOND)
    body -= Pos(0, 0, high / 2) * Rot(90, 0, 0) * Cylinder(s(5.5, 0.05), BEYOND)
    return body - Pos(0, 0, high / 2) * Cylinder(s(4, 0.05), BEYOND, align=BOTTOM)


def set_knob(s: Sizes) -> Part:
    """A chamfered knob with a tapered hub, a blind bore in it, and a set-screw hole into that."""
    radius, thick, hub, tall, edge = s(20), s(14), s(13, 0.1), s(18), s(2)
    body = turn((0, 0), (radius - edge, 0), (radius, edge), (radius, thick), (0, thick))
    body += Pos(0, 0, thick) * Cone(hub, hub * 0.85, tall, align=BOTTOM)
    body -= Pos(0, 0, thick + tall - s(22, 0.1)) * Cylinder(s(5, 0.1), BEYOND, align=BOTTOM)
    return body - Pos(0, 0, thick + tall * 0.45) * Rot(0, 90, 0) * Cylinder(s(2), BEYOND, align=BOTTOM)


def guide_rail(s: Sizes) -> Part:
    """A rail with a chamfered ridge, through which three counterbored holes go."""
    length, width, foot, ridge, high = s(90), s(26), s(10), s(15, 0.1), s(8)
    body = Box(length, ridge, foot + high, align=BOTTOM)
    body = chamfer(body.faces().sort_by(Axis.Z)[-1].edges().filter_by(Axis.X), s(1.5))
    body += Box(length, width, foot, align=BOTTOM)
    hole, wide, deep = s(2.3, 0.05), s(4.2, 0.05), s(5)
    for x in (-1, 0, 1):
        body -= Pos(x * length * 0.33, 0, 0) * Cylinder(hole, BEYOND)
        body -= Pos(x * length * 0.33, 0, foot + high - deep) * Cylinder(wide, BEYOND, align=BOTTOM)
    return body


def tool_post(s: Sizes) -> Part:
    """A block with a bore, a slot in its side, and three screw holes from above into the slot."""
    side, high, deep, wide = s(50, 0.05), s(40), s(15, 0.05), s(12)
    body = Box(side, side, high, align=BOTTOM) - Cylinder(s(8, 0.05), BEYOND)
    body -= Pos(0, side / 2, high * 0.5) * Box(BEYOND, 2 * deep, wide)
    for x in (-1, 0, 1):
        body -= Pos(x * side * 0.3, side / 2 - deep / 2, high * 0.5) * Cylinder(s(3, 0.05), BEYOND, align=BOTTOM)
    return body


def index_plate(s: Sizes) -> Part:
    """A disc with a boss, a bore, and six holes around it."""
    radius, thick, boss, tall = s(34), s(10), s(14, 0.1), s(8)
    body = Cylinder(radius, thick, align=BOTTOM) + Cylinder(boss, thick + tall, align=BOTTOM) - Cylinder(s(7), BEYOND)
    hole = s(3, 0.1)
    for k in range(6):
        body -= Rot(0, 0, 60 * k) * Pos(radius * 0.72, 0, 0) * Cylinder(hole, BEYOND)
    return body


def clamp_pad(s: Sizes) -> Part:
    """A block, chamfered above, with a V below and a blind socket in its top."""
    length, width, high, vee = s(44), s(36), s(26), s(14, 0.1)
    body = Box(length, width, high, align=BOTTOM)
    body = chamfer(body.faces().sort_by(Axis.Z)[-1].edges().filter_by(Axis.X), s(3))
    body -= Rot(45, 0, 0) * Box(BEYOND, vee, vee)
    return body - Pos(0, 0, high - s(9)) * Cylinder(s(7, 0.1), BEYOND, align=BOTTOM)


def tube_clamp(s: Sizes) -> Part:
    """A block with a bore that a slit opens to the side, and a counterbored screw hole across the slit."""
    length, width, high, bore = s(60, 0.1), s(26), s(40, 0.1), s(11, 0.1)
    body = Box(length, width, high, align=BOTTOM)
    body -= Pos(-length * 0.17, 0, high / 2) * Rot(90, 0, 0) * Cylinder(bore, BEYOND)
    body -= Pos(BEYOND / 2 - length * 0.17, 0, high / 2) * Box(BEYOND, BEYOND, s(3, 0.1))
    body -= Pos(length * 0.32, 0, 0) * Cylinder(s(3.2, 0.1), BEYOND)
    return body - Pos(length * 0.32, 0, high - s(6)) * Cylinder(s(5.6, 0.1), BEYOND, align=BOTTOM)


def wheel_hub(s: Sizes) -> Part:
    """A stepped hub with a flange, a counterbore from below, five holes, and a notch across its top."""
    flange, thick, neck, tall, bore = s(34, 0.1), s(8), s(17, 0.1), s(24), s(8, 0.1)
    body = Cylinder(flange, thick, align=BOTTOM) + Cylinder(neck, thick + tall, align=BOTTOM)
    body -= Cylinder(bore, BEYOND)
    body -= Cylinder(s(12, 0.1), s(7), align=BOTTOM)
    for k in range(5):
        body -= Rot(0, 0, 72 * k) * Pos(flange * 0.76, 0, 0) * Cylinder(s(3.2, 0.0), BEYOND)
    return body - Pos(0, 0, thick + tall - s(6)) * Box(BEYOND, s(7), BEYOND, align=BOTTOM)


def rod_end(s: Sizes) -> Part:
    """An eye between two flats, on a shank with a blind bore and a chamfered end."""
    eye, wide, pin, shank, long, edge = s(18, 0.1), s(16, 0.1), s(9, 0.1), s(9, 0.1), s(46), s(1.5)
    body = Rot(0, 90, 0) * Cylinder(eye, wide)
    body += turn((0, -long), (shank - edge, -long), (shank, edge - long), (shank, 0), (0, 0))
    body -= Rot(0, 90, 0) * Cylinder(pin, BEYOND)
    return body - Pos(0, 0, -long) * Cylinder(shank * 0.5, s(14, 0.1), align=BOTTOM)


def ring_housing(s: Sizes) -> Part:
    """A block with a bore, and a groove for a ring around that."""
    length, width, high, bore = s(50), s(44), s(22), s(13)
    body = Box(length, width, high, align=BOTTOM) - Cylinder(bore, BEYOND)
    groove, deep = s(4), s(2.4)
    return body - Pos(0, 0, high * 0.6) * Cylinder(bore + deep, groove, align=BOTTOM)


def seal_carrier(s: Sizes) -> Part:
    """A flange with four holes and a chamfered neck, a groove for a seal around its bore."""
    rim, thick, neck, top, bore, edge = s(26), s(7), s(18), s(20), s(12, 0.05), s(1.5)
    body = turn((bore, 0), (rim, 0), (rim, thick), (neck, thick), (neck, top - edge), (neck - edge, top), (bore, top))
    for k in range(4):
        body -= Rot(0, 0, 90 * k) * Pos((rim + neck) / 2, 0, 0) * Cylinder(s(2, 0.0), BEYOND)
    return body - Pos(0, 0, top * 0.6) * Cylinder(bore + s(2.2, 0.1), s(4), align=BOTTOM)
