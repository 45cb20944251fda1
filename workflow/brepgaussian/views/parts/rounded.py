"""Bundled parts with wheels' hubs, or with most of their edges rounded."""

from build123d import Axis, Box, Cylinder, Part, Pos, Rot, fillet

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM
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
