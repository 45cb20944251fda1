"""Bundled parts with wheels' hubs, or with most of their edges rounded."""

from build123d import Axis, Box, Cylinder, Part, Pos, RectangleRounded, Rot, SlotOverall, extrude, fillet

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM, bends, profile
from brepgaussian.views.parts.sizes import Sizes


def spoked_wheel(s: Sizes) -> Part:
    """A rim, a bored hub that stands out of it on both sides, and spokes."""
    rim, inner, wide = s(40, 0.05), s(32, 0.05), s(15)
    hub, long, bore = s(12, 0.1), s(20, 0.08), s(5)
    spokes, thick, high = 5, s(7), s(10, 0.08)
    body = Cylinder(rim, wide) - Cylinder(inner, BEYOND) + Cylinder(hub, long)
    reach = (hub + inner) / 2
    for k in range(spokes):
        body += Rot(0, 0, 360 * k / spokes) * Pos(reach, 0, 0) * Box(inner - hub + bore, thick, high)
    return body - Cylinder(bore, BEYOND)


def rounded_case(s: Sizes) -> Part:
    """A block with all its edges rounded, and a bore."""
    body = Box(s(60), s(40), s(25, 0.1))
    return fillet(body.edges(), s(6, 0.2)) - Cylinder(s(8), BEYOND)


def rounded_angle(s: Sizes) -> Part:
    """An angle whose base and wall are rounded on top, with a fillet between them and two holes."""
    long, wide, thick, high = s(56), s(36), s(11), s(42)
    body = Box(long, wide, thick, align=BOTTOM) + Pos(-long / 2 + thick / 2, 0, 0) * Box(
        thick, wide, high, align=BOTTOM
    )
    inner = body.edges().filter_by(Axis.Y).filter_by(lambda e: thick / 2 < e.center().Z < high / 2)
    body = fillet(inner.sort_by(Axis.X)[0:1], s(5))
    body = fillet(body.faces().sort_by(Axis.Z)[-1].edges(), s(3))
    body = fillet(body.edges().filter_by(Axis.Z).sort_by(Axis.X)[-2:], s(7))
    for y in (-wide / 4, wide / 4):
        body -= Pos(long / 4, y, 0) * Cylinder(s(3.2), BEYOND)
    return body


def hat_bracket(s: Sizes) -> Part:
    """A folded strip, a channel with two flanges, rounded at its inner bends, with holes and a window on top."""
    top, foot, high, thick, depth = s(34, 0.1), s(20, 0.1), s(28), s(5, 0.05), s(36, 0.1)
    half, outer = top / 2, top / 2 + foot
    points = [(-outer, 0), (-half + thick, 0), (-half + thick, high - thick), (half - thick, high - thick),
              (half - thick, 0), (outer, 0), (outer, thick), (half, thick), (half, high), (-half, high),
              (-half, thick), (-outer, thick)]  # fmt: skip
    body = profile(*points, depth=depth)
    inner = [place for side in (-1, 1) for place in ((side * half, thick), (side * (half - thick), high - thick))]
    body = fillet(bends(body, *inner), s(3.5, 0.05))
    for x in (-1, 1):
        body -= Pos(x * (half + foot * 0.58), 0, 0) * Cylinder(s(3.6, 0.05), BEYOND)
    return body - extrude(RectangleRounded(top * 14 / 34, s(18), s(3)), BEYOND)


def offset_sheet(s: Sizes) -> Part:
    """A thin sheet folded twice, rounded inside and outside, two holes in either leg and a slot in the web."""
    low, high, rise, thick, depth = s(26, 0.1), s(31, 0.1), s(25, 0.1), s(3, 0.1), s(30, 0.1)
    back, inside = low - thick, s(2, 0.1)
    points = [(0, 0), (low, 0), (low, rise - thick), (low + high, rise - thick), (low + high, rise), (back, rise),
              (back, thick), (0, thick)]  # fmt: skip
    body = profile(*points, depth=depth)
    body = fillet(bends(body, (low, rise - thick), (back, thick)), inside)
    body = fillet(bends(body, (low, 0), (back, rise)), inside + thick)
    hole = s(2.6, 0.1)
    for x in (low * 0.42, low + high * 0.55):
        for y in (-1, 1):
            body -= Pos(x, y * depth * 0.27, 0) * Cylinder(hole, BEYOND)
    slot = extrude(SlotOverall(s(14, 0.1), s(5, 0.1)), 4 * thick, both=True)
    return body - Pos(low, 0, rise / 2) * Rot(0, 90, 0) * Rot(0, 0, 90) * slot
