"""Bundled parts made of flat walls: blocks, plates, channels, brackets."""

from math import cos, pi

from build123d import (
    Align,
    Axis,
    Box,
    Circle,
    Cone,
    Cylinder,
    Edge,
    Part,
    Plane,
    Polygon,
    Pos,
    RegularPolygon,
    Rot,
    SlotOverall,
    extrude,
    fillet,
)

from brepgaussian.views.parts.sizes import Sizes

BOTTOM = (Align.CENTER, Align.CENTER, Align.MIN)
BEYOND = 200.0  # mm: a cutting tool that passes through everything


def profile(*points: tuple[float, float], depth: float) -> Part:
    """A polygon in the xz plane, given as it is, pulled to +-depth/2 along y."""
    sketch = Plane.XZ * Polygon(*points, align=None)
    return extrude(sketch, depth / 2, both=True)


def hexagon(apothem: float, high: float) -> Part:
    """A hexagonal prism on the ground, `apothem` from its axis to its sides."""
    return extrude(RegularPolygon(apothem / cos(pi / 6), 6), high)


def bends(body: Part, *places: tuple[float, float]) -> list[Edge]:
    """The edges along y of a profile's body that lie at places (x, z)."""
    lines = [(edge, edge.center()) for edge in body.edges().filter_by(Axis.Y)]
    return [e for e, at in lines if any(abs(at.X - x) + abs(at.Z - z) < 1e-3 for x, z in places)]


def block_hole(s: Sizes) -> Part:
    """A block with one through hole."""
    return Box(s(60), s(40), s(30)) - Pos(s(6), s(3), 0) * Cylinder(s(10), BEYOND)


def l_bracket(s: Sizes) -> Part:
    """Two legs, a hole in each."""
    length, width, height, wall = s(60), s(40), s(45), s(10)
    body = profile((0, 0), (length, 0), (length, wall), (wall, wall), (wall, height), (0, height), depth=width)
    body -= Pos(length * 0.62, 0, 0) * Cylinder(s(7), BEYOND)
    return body - Pos(0, 0, height * 0.62) * Rot(0, 90, 0) * Cylinder(s(5.5), BEYOND)


def pocket_plate(s: Sizes) -> Part:
    """A plate with three blind pockets: rectangular, square, round."""
    length, width, height = s(80, 0.08), s(50, 0.08), s(16)
    depth = height * 0.6
    body = Box(length, width, height, align=BOTTOM)
    top = height - depth
    body -= Pos(-length * 0.27, 0, top) * Box(s(22), s(32), depth, align=BOTTOM)
    body -= Pos(length * 0.22, width * 0.22, top) * Box(s(26), s(14), depth, align=BOTTOM)
    return body - Pos(length * 0.22, -width * 0.22, top) * Cylinder(s(8), depth, align=BOTTOM)


def u_channel(s: Sizes) -> Part:
    """A channel with a step on its floor."""
    w, h, wall, floor, step = s(50), s(40), s(8), s(8), s(9)
    x = w / 2 - wall
    shelf = -x + (2 * x) * s(0.45)
    return profile(
        (-w / 2, 0), (w / 2, 0), (w / 2, h), (x, h), (x, floor), (shelf, floor), (shelf, floor + step),
        (-x, floor + step), (-x, h), (-w / 2, h), depth=s(70),
    )  # fmt: skip


def counterbore(s: Sizes) -> Part:
    """A block with a counterbored hole that ends blind."""
    height = s(34)
    body = Box(s(50), s(44), height, align=BOTTOM)
    body -= Pos(0, 0, height - s(11)) * Cylinder(s(14), height, align=BOTTOM)
    return body - Pos(0, 0, height - s(24)) * Cylinder(s(7.5), height, align=BOTTOM)


def fillet_bracket(s: Sizes) -> Part:
    """An L whose inner and outer bends are tangent cylinders, with rounded ends of the foot."""
    length, width, height, wall = s(60), s(40), s(45), s(9)
    body = profile((0, 0), (length, 0), (length, wall), (wall, wall), (wall, height), (0, height), depth=width)
    inner, radius = s(10), s(8)
    corner = body.edges().filter_by(Axis.Y).sort_by_distance((wall, 0, wall))[0]
    body = fillet(corner, inner)
    outside = body.edges().filter_by(Axis.Y).sort_by_distance((0, 0, 0))[0]
    body = fillet(outside, inner + wall * 0.9)
    foot = body.edges().filter_by(Axis.Z).sort_by(Axis.X)[-2:]
    return fillet(foot, radius)


def polyhedron(s: Sizes) -> Part:
    """A block with five oblique cuts: planes in general position."""
    body = Part() + Box(s(50), s(44), s(40))
    cuts = ((38, 20, 23), (-31, 40, 21.5), (145, -28, 22), (215, 25, 24.5), (-75, -42, 20))
    for azimuth, elevation, distance in cuts:
        tool = Pos(s(distance, 0.06) + BEYOND / 2, 0, 0) * Box(BEYOND, BEYOND, BEYOND)
        body -= Rot(0, 0, azimuth if s.nominal else s(azimuth, 0.1)) * Rot(0, -s(elevation), 0) * tool
    return body


def oblique_hole(s: Sizes) -> Part:
    """A block with a hole that is oblique to every face."""
    tilt = Rot(0, s(28), 0) if s.nominal else Rot(0, s(28), 0) * Rot(s(6), 0, 0)
    return Box(s(56), s(44), s(32)) - tilt * Cylinder(s(9), BEYOND)


def v_block(s: Sizes) -> Part:
    """A block with a V groove and a relief slot under it."""
    w, h, half = s(56), s(42), s(19)
    slot, deep = s(3.5), s(26)
    return profile(
        (-w / 2, 0), (w / 2, 0), (w / 2, h), (half, h), (slot, h - half + slot), (slot, h - deep),
        (-slot, h - deep), (-slot, h - half + slot), (-half, h), (-w / 2, h), depth=s(48),
    )  # fmt: skip


def dovetail(s: Sizes) -> Part:
    """A slide with an undercut dovetail groove."""
    w, h, deep, neck, foot = s(60), s(32), s(14), s(12), s(19)
    return profile(
        (-w / 2, 0), (w / 2, 0), (w / 2, h), (neck, h), (foot, h - deep), (-foot, h - deep), (-neck, h), (-w / 2, h),
        depth=s(50),
    )  # fmt: skip


def heat_sink(s: Sizes) -> Part:
    """A base with a row of thin fins."""
    fins, pitch, thick, base, high = s.count(5, 4, 7), s(12), s(4.5), s(9), s(32)
    half = (fins - 1) * pitch / 2 + thick / 2
    points: list[tuple[float, float]] = [(-half, 0), (half, 0)]
    for i in reversed(range(fins)):
        x = i * pitch - (fins - 1) * pitch / 2
        points += [(x + thick / 2, high), (x - thick / 2, high)]
        if i:
            points += [(x - thick / 2, base), (x - pitch + thick / 2, base)]
    return profile(*points, depth=s(52))


def wedge_clamp(s: Sizes) -> Part:
    """A wedge with a slot that is open to the front."""
    length, height, nose, width = s(66), s(34), s(9), s(38)
    body = profile((0, 0), (length, 0), (length, nose), (length * 0.3, height), (0, height), depth=width)
    slot = SlotOverall(s(40), s(13))
    return body - Pos(length * 0.62, 0, -1) * extrude(slot, BEYOND)


def gusset(s: Sizes) -> Part:
    """A base plate and an upright joined by a triangular rib."""
    length, width, height, wall, rib = s(58), s(44), s(46), s(8), s(9)
    body = profile((0, 0), (length, 0), (length, wall), (wall, wall), (wall, height), (0, height), depth=width)
    return body + profile((wall, wall), (length * 0.8, wall), (wall, height * 0.8), depth=rib)


def countersink_plate(s: Sizes) -> Part:
    """A plate with two countersunk holes and one plain slot."""
    length, width, height = s(76, 0.08), s(42), s(13)
    body = Box(length, width, height, align=BOTTOM)
    bore, sink = s(4.5), s(9.5)
    for x in (-length * 0.3, length * 0.3):
        body -= Pos(x, 0, 0) * Cylinder(bore, BEYOND)
        body -= Pos(x, 0, height - (sink - bore)) * Cone(bore, sink, sink - bore, align=BOTTOM)
    slot = Rot(0, 0, 90) * SlotOverall(s(24), s(9))
    return body - Pos(0, 0, -1) * extrude(slot, BEYOND)


def pillow_block(s: Sizes) -> Part:
    """A bearing seat: a tangent arch on a foot with two bolt holes."""
    length, width, foot, center, outer = s(80, 0.08), s(28), s(11), s(30), s(19)
    body = Box(length, width, foot, align=BOTTOM) + Pos(0, 0, center / 2) * Box(2 * outer, width, center)
    arch = Plane.XZ * Circle(outer)
    body += Pos(0, 0, center) * extrude(arch, width / 2, both=True)
    body -= Pos(0, 0, center) * Rot(90, 0, 0) * Cylinder(s(11), BEYOND)
    for x in (-1, 1):
        body -= Pos(x * length * 0.38, 0, 0) * Cylinder(s(4.2), BEYOND)
    return body
