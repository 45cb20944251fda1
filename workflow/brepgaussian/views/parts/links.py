"""Bundled parts that link, stop, hold and feed: webs, levers, blocks rounded on top, barbs, grids of holes."""

from math import atan, radians, sin, sqrt, tan

from build123d import (
    Axis,
    Box,
    Cone,
    Cylinder,
    Part,
    Polygon,
    Pos,
    SlotOverall,
    extrude,
    fillet,
)

from brepgaussian.views.parts.prismatic import BEYOND, BOTTOM, hexagon, profile
from brepgaussian.views.parts.sizes import Sizes
from brepgaussian.views.parts.turned import turn


def rocker_arm(s: Sizes) -> Part:
    """Two bored bosses of unlike height and width on a web that is tangent to both."""
    span, web = s(52), s(9)
    big, small, high, low = s(17), s(11), s(28), s(18)
    ahead = (big - small) / span  # cosine between the axis and the normals of the web's sides
    up = sqrt(1 - ahead**2)
    places = [(x + r * ahead, way * r * up) for way in (1, -1) for x, r in ((-span / 2, big), (span / 2, small))[::way]]
    body = extrude(Polygon(*places, align=None), web, dir=(0, 0, 1))
    body += Pos(-span / 2, 0, 0) * Cylinder(big, high, align=BOTTOM)
    body += Pos(span / 2, 0, 0) * Cylinder(small, low, align=BOTTOM)
    body -= Pos(-span / 2, 0, 0) * Cylinder(s(9), BEYOND)
    return body - Pos(span / 2, 0, 0) * Cylinder(s(5), BEYOND)


def stop_block(s: Sizes) -> Part:
    """A block rounded on its upright edges and all around its top, a blind hole below, a hole across."""
    length, width, high = s(54), s(36), s(26)
    body = Box(length, width, high, align=BOTTOM)
    body = fillet(body.edges().filter_by(Axis.Z), s(9))
    body = fillet(body.faces().sort_by(Axis.Z)[-1].edges(), s(3.5))
    body -= Pos(-length * 0.2, 0, 0) * Cylinder(s(7), s(13), align=BOTTOM)
    return body - Pos(length * 0.24, 0, high * 0.45) * Box(s(8), BEYOND, s(9))


def hose_barb(s: Sizes) -> Part:
    """A hexagon between a spigot and a tail with two barbs, bored through."""
    apothem, high, bore = s(13), s(10), s(4.5)
    root, barb, pitch, tail = s(7, 0.06), s(9.5, 0.06), s(11), s(6)
    neck, spigot = s(8.5, 0.06), s(14)
    body = hexagon(apothem, high)
    points = [(0, high), (root, high), (root, high + tail)]
    z = high + tail
    for _ in range(2):
        points += [(barb, z), (root, z + pitch)]
        z += pitch
    body += turn(*points, (0, z))
    body += turn((0, -spigot), (neck, -spigot), (neck, 0), (0, 0))
    return body - Cylinder(bore, BEYOND)


def nozzle_plate(s: Sizes) -> Part:
    """A plate with rounded corners, a grid of holes, and two countersunk ones at its ends."""
    length, width, thick, pitch, hole = s(78), s(44), s(10), s(12, 0.08), s(3.2)
    body = Box(length, width, thick, align=BOTTOM)
    body = fillet(body.edges().filter_by(Axis.Z), s(6))
    for i in (-1, 0, 1):
        for j in (-1, 0, 1):
            body -= Pos(i * pitch, j * pitch, 0) * Cylinder(hole, BEYOND)
    bore, sink = s(3), s(5.5)
    for x in (-1, 1):
        at = Pos(x * length * 0.4, 0, thick - (sink - bore))
        body -= Pos(x * length * 0.4, 0, 0) * Cylinder(bore, BEYOND)
        body -= at * Cone(bore, sink, sink - bore, align=BOTTOM)
    return body


def bar_handle(s: Sizes) -> Part:
    """A bar with round ends, counterbored from below at both, rounded all around its top."""
    length, width, high = s(80, 0.1), s(22, 0.1), s(14)
    body = extrude(SlotOverall(length, width), high)
    body = fillet(body.faces().sort_by(Axis.Z)[-1].edges(), s(3))
    for x in (-1, 1):
        body -= Pos(x * (length - width) / 2, 0, 0) * Cylinder(s(3), BEYOND)
        body -= Pos(x * (length - width) / 2, 0, 0) * Cylinder(s(6), s(5), align=BOTTOM)
    return body


def hub_lever(s: Sizes) -> Part:
    """A bored hub with an arm that tapers, a fillet around the hub's foot, a hole in the arm's round end."""
    hub, high, thick, reach, end = s(16, 0.06), s(26), s(9), s(58), s(9, 0.06)
    body = Pos(reach, 0, 0) * Cylinder(end, thick, align=BOTTOM)
    arm = Polygon((0, -hub * 0.8), (reach, -end * 0.95), (reach, end * 0.95), (0, hub * 0.8), align=None)
    body += extrude(arm, thick, dir=(0, 0, 1))
    body += Cylinder(hub, high, align=BOTTOM)
    circles = [e for e in body.edges() if abs(e.center().Z - thick) < 1e-6 and e.geom_type.name == "CIRCLE"]
    body = fillet([e for e in circles if abs(e.radius - hub) < 1e-6], s(3))
    return body - Cylinder(s(8), BEYOND) - Pos(reach, 0, 0) * Cylinder(s(4.5), BEYOND)


def desk_stand(s: Sizes) -> Part:
    """A sloping plate on a base, rounded where they meet, with a lip and a slot."""
    base, thick, high, depth, slope = s(60, 0.06), s(5), s(46), s(40), tan(radians(s(70, 0.05)))
    across = thick / sin(atan(slope))
    body = profile(
        (0, 0), (base, 0), (base, thick), (across + thick / slope, thick), (across + high / slope, high),
        (high / slope, high), depth=depth,
    )  # fmt: skip
    inner = [e for e in body.edges().filter_by(Axis.Y) if abs(e.center().Z - thick) < 1e-6 and base / 2 > e.center().X]
    body = fillet(inner, s(6))
    body += Pos(base - thick / 2, 0, thick) * Box(thick, depth, s(7), align=BOTTOM)
    return body - Pos(base * 0.62, 0, 0) * extrude(SlotOverall(s(18), s(8)), BEYOND, both=True)
