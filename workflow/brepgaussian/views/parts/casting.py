"""Bundled parts as castings and mountings have them: lugs, racks, yokes, frames, nozzles, bosses on ribs."""

from build123d import (
    Axis,
    Box,
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


def pump_cover(s: Sizes) -> Part:
    """A round cover with three drilled lugs, a bored boss above and a recess below."""
    radius, thick, boss, high = s(27, 0.06), s(9, 0.08), s(12, 0.08), s(14, 0.1)
    edge = s(1.5, 0.1)
    body = turn((0, 0), (radius, 0), (radius, thick), (boss, thick), (boss, high + thick - edge),
                (boss - edge, high + thick), (0, high + thick))  # fmt: skip
    lug, hole, out = s(7.5, 0.06), s(3.4, 0.08), radius + s(4.5, 0.08)
    holes = Part()
    for k in range(3):
        turned = Rot(0, 0, 120 * k)
        body += turned * Pos(out, 0, 0) * Cylinder(lug, thick, align=BOTTOM)
        holes += turned * Pos(out, 0, 0) * Cylinder(hole, BEYOND)
    recess = Cylinder(s(18, 0.08), s(4, 0.1), align=BOTTOM)
    return body - holes - recess - Cylinder(s(6, 0.1), BEYOND)


def rack_bar(s: Sizes) -> Part:
    """A bar with trapezoidal teeth and two counterbored holes across it."""
    teeth, pitch, deep = s.count(5, 4, 6), s(9, 0.06), s(5, 0.08)
    top, flank = pitch * 0.35, pitch * 0.13
    high, end, width = s(20, 0.08), s(14, 0.08), s(15, 0.08)
    points = [(0.0, 0.0), (2 * end + teeth * pitch, 0.0), (2 * end + teeth * pitch, high)]
    for k in reversed(range(teeth)):
        left = end + k * pitch
        gap = pitch - top - 2 * flank
        points += [
            (left + top + 2 * flank + gap, high), (left + top + flank + gap, high - deep),
            (left + top + flank, high - deep), (left + top, high),
        ]  # fmt: skip
    points.append((0.0, high))
    body = profile(*points, depth=width)
    box = body.bounding_box()
    bore, wide, sunk = s(2.8, 0.08), s(4.8, 0.06), s(4, 0.1)
    hole = Cylinder(bore, BEYOND) + Pos(0, 0, -BEYOND / 2 + sunk) * Cylinder(wide, BEYOND)
    middle = (box.min.Z + box.max.Z) / 2 - deep / 2
    for x in (box.min.X + end / 2, box.max.X - end / 2):
        body -= Pos(x, box.min.Y, middle) * Rot(-90, 0, 0) * hole
    return body


def yoke_end(s: Sizes) -> Part:
    """A yoke with rounded ears and a pin bore on a square block, a stepped shank behind."""
    width, ear, gap = s(30, 0.06), s(7.5, 0.08), s(26, 0.06)
    block, long, pin = s(12, 0.08), s(22, 0.08), s(5, 0.1)
    thick = gap * 0.6 + ear
    body = Box(width, thick + ear, block, align=BOTTOM)
    for y in (-1, 1):
        side = Box(width, ear, long, align=BOTTOM) + Pos(0, 0, long) * Rot(90, 0, 0) * Cylinder(width / 2, ear)
        body += Pos(0, y * thick / 2, block) * side
    body -= Pos(0, 0, block + long) * Rot(90, 0, 0) * Cylinder(pin, BEYOND)
    neck, shank = s(9, 0.08), s(6.5, 0.06)
    first, second = s(8, 0.1), s(18, 0.08)
    body += turn((0, 1), (neck, 1), (neck, -first), (shank, -first), (shank, -first - second + 1),
                 (shank - 1, -first - second), (0, -first - second))  # fmt: skip
    return body


def cam_disk(s: Sizes) -> Part:
    """A disk about an eccentric hub with a keyed bore and two unequal lightening holes."""
    radius, thick, off, hub = s(30, 0.06), s(9, 0.08), s(9, 0.08), s(11, 0.06)
    body = Pos(off, 0, 0) * Cylinder(radius, thick, align=BOTTOM) + Cylinder(hub, thick + s(10, 0.1), align=BOTTOM)
    bore = s(6, 0.08)
    body -= Cylinder(bore, BEYOND)
    key = Box(2 * (bore + s(2.2, 0.1)), s(3.6, 0.08), BEYOND)
    body -= key & Pos(BEYOND / 2, 0, 0) * Box(BEYOND, BEYOND, BEYOND)  # on one side only
    for y, size in ((1, s(5.5, 0.1)), (-1, s(4, 0.1))):
        body -= Pos(off + radius * 0.35, y * radius * 0.48, 0) * Cylinder(size, BEYOND)
    return body


def window_frame(s: Sizes) -> Part:
    """A rectangular frame with a stepped window of rounded corners, chamfered outside, slots in its long sides."""
    length, width, thick = s(84, 0.05), s(60, 0.06), s(12, 0.08)
    body = Box(length, width, thick, align=BOTTOM)
    body = chamfer(body.edges().filter_by(Axis.Z), s(6, 0.1))
    rim, ledge, sunk, corner = s(13, 0.06), s(4.5, 0.08), s(5, 0.1), s(5, 0.08)
    outer = Box(length - 2 * rim, width - 2 * rim, BEYOND, align=BOTTOM)
    outer = fillet(outer.edges().filter_by(Axis.Z), corner)
    inner = Box(length - 2 * rim - 2 * ledge, width - 2 * rim - 2 * ledge, BEYOND)
    body = body - Pos(0, 0, thick - sunk) * outer - inner
    slot = extrude(SlotOverall(s(18, 0.08), s(5, 0.08)), BEYOND)
    for y in (-1, 1):
        body -= Pos(0, y * (width - rim) / 2, -BEYOND / 2) * slot
    return body


def spray_nozzle(s: Sizes) -> Part:
    """A hexagon between a threaded end and a cone, a stepped bore that ends in a small orifice."""
    across, wide, stem, below = s(26, 0.06), s(9, 0.08), s(8, 0.08), s(16, 0.08)
    body = hexagon(across / 2, wide)
    mouth, tip, nose = s(9.5, 0.06), s(4.5, 0.08), s(22, 0.08)
    body += turn((0, wide / 2), (mouth, wide / 2), (mouth, wide + 3), (tip, wide + 3 + nose), (0, wide + 3 + nose))
    body += turn((0, wide / 2), (stem, wide / 2), (stem, 1.2 - below), (stem - 1.2, -below), (0, -below))
    bore, depth, orifice = s(4.6, 0.08), s(26, 0.08), s(1.9, 0.06)
    body -= Pos(0, 0, -below) * Cylinder(bore, depth, align=BOTTOM)
    return body - Cylinder(orifice, BEYOND)
