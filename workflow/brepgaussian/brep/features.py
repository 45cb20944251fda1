"""Chamfers that the points round off, proposed where the images refuse a sharp edge.

A chamfer narrower than a few point spacings melts into its neighbours. The images show it: the sharp edge that the
solid has in its place lies pixels off. Chamfers of some widths are proposed there; the refinement finds the rest.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.brep.patches import Patch, next_number
from brepgaussian.brep.shown import edge_rows
from brepgaussian.brep.simplify import Change
from brepgaussian.brep.structure import CONVEX, Edge, Structure
from brepgaussian.geometry.chains import resample
from brepgaussian.geometry.surfaces import Surface, cone, plane

Array = NDArray[np.float64]
Maker = Callable[[tuple[Surface, Surface], Edge], tuple[Surface, Array] | None]

WIDTHS = (0.03, 0.015, 0.06)  # of the legs, unit frame: the refinement's windows reach from one to the next
_BAD_PX = 0.2  # median silhouette residual of an edge that lies elsewhere: faces lean to come near a fillet
_SHARE_OF_WORST = 0.25  # and of the worst edge's: one wrong edge draws others with it
# Sine between a plane's normal and the axis of a cylinder whose circle is chamfered: a refused edge turns either.
_PARALLEL = 0.05
_ACROSS = 0.9  # |cosine| between planes whose edge is too blunt or too sharp for a chamfer
SPACING = 0.006  # of the points that stand for a chamfer, unit frame
_MARGIN = 0.05  # of a narrow face's width without made points, at either end
_REACH = 2.0  # spacings
_LEAST_LEFT = 0.3  # of a neighbour's points that must remain
_LEAST_LENGTH = 2.0  # widths: length of an edge that is worth it
_ONE = 0.25  # widths by which two edges' faces differ that are pieces of one


def chamfers(
    structure: Structure, surfaces: Sequence[Surface], patches: Sequence[Patch], edges: Sequence[Mapping[str, Any]]
) -> list[Change]:
    """One change for every width: chamfers on all convex edges that the images place elsewhere.

    Args:
        structure: of the solid that the images judged.
        surfaces: that it names; the first ones belong to `patches`.
        patches: that it was built from.
        edges: the acceptance test's table.
    """
    bad = bad_edges(structure, edges)
    result = []
    for width in WIDTHS:
        change = _chamfered([structure.edges[k] for k in bad], surfaces, patches, width)
        if change is not None:
            result.append(change)
    return result


def bad_edges(structure: Structure, edges: Sequence[Mapping[str, Any]]) -> list[int]:
    """Indices of convex edges far from where the images show them."""
    px: dict[int, float] = {}
    for index, row in edge_rows(edges):
        if isinstance(row["silhouette_px"], float):
            px[index] = row["silhouette_px"]
    limit = max(_BAD_PX, _SHARE_OF_WORST * max(px.values(), default=0.0))
    return [k for k in sorted(px) if px[k] > limit and structure.edges[k].convexity == CONVEX]


def apart(structure: Structure, edges: Sequence[Mapping[str, Any]]) -> list[list[Mapping[str, Any]]]:
    """The acceptance test's table for the refused edges of one pair of faces each, worst first; none if it is one pair.

    A chamfer that belongs on one of them and not on the next makes no better solid with both.
    """
    rows = {str(row["name"]): row for row in edges}
    found: dict[tuple[int, ...], list[Mapping[str, Any]]] = {}
    for k in bad_edges(structure, edges):
        found.setdefault(tuple(sorted(structure.edges[k].surfaces)), []).append(rows[f"edge {k}"])
    tables = sorted(found.values(), key=lambda table: -max(row["silhouette_px"] for row in table))
    return tables if len(tables) > 1 else []


def _chamfered(
    edges: Sequence[Edge], surfaces: Sequence[Surface], patches: Sequence[Patch], width: float
) -> Change | None:
    """Chamfers of one width on edges, with what remains of the neighbours' points."""
    return placed(edges, surfaces, patches, width, chamfer_of(width), f"chamfers {width:g} wide")


def chamfer_of(width: float) -> Maker:
    """What makes a chamfer of some width and points on it for an edge; None for edges too short for it."""

    def make(pair: tuple[Surface, Surface], edge: Edge) -> tuple[Surface, Array] | None:
        length = float(np.linalg.norm(np.diff(edge.polyline, axis=0), axis=1).sum())
        made = _surface(pair, edge.polyline, width)
        return None if made is None or length < _LEAST_LENGTH * width else (made, _band(made, pair, edge.polyline))

    return make


def placed(
    edges: Sequence[Edge], surfaces: Sequence[Surface], patches: Sequence[Patch], width: float, make: Maker, what: str
) -> Change | None:
    """Narrow faces on edges, with what remains of the neighbours' points; None if there are none.

    Edges of a neighbour that would be left with too little stay as they are.

    Args:
        edges, surfaces, patches: of a solid.
        width: from an edge within which the neighbours lose their points, unit frame.
        make: a face and points (N, 3) on it for an edge's two surfaces and the edge; None if there is none.
        what: for the change's name.
    """
    bands = []
    for edge in edges:
        if max(edge.surfaces) < len(patches) and min(edge.surfaces) >= 0 and len(edge.polyline) >= 2:
            band = make((surfaces[edge.surfaces[0]], surfaces[edge.surfaces[1]]), edge)
            bands += [] if band is None else [(edge, band)]
    while bands:
        left = _trimmed(patches, [edge for edge, _ in bands], width)
        poor = {index for index, patch in left.items() if len(patch.xyz) < _LEAST_LEFT * len(patches[index].xyz)}
        if not poor:
            new = _numbered(_joined(bands, width), patches)
            beside = ", ".join(str(patches[index].primitive) for index in left)
            return Change(f"{len(new)} {what} beside patches {beside}", tuple(left), (*left.values(), *new))
        bands = [(edge, band) for edge, band in bands if poor.isdisjoint(edge.surfaces)]
    return None


def _joined(bands: Sequence[tuple[Edge, tuple[Surface, Array]]], width: float) -> list[tuple[Surface, Array]]:
    """One face for all edges of one pair of faces where the longest edge's face passes through the others', too."""
    result: list[tuple[tuple[int, ...], Surface, Array]] = []
    for edge, (surface, points) in sorted(bands, key=lambda b: -len(b[1][1])):
        pair = tuple(sorted(edge.surfaces))
        for k, (other, known, own) in enumerate(result):
            if other == pair and np.abs(known.signed_distance(points)).max() < _ONE * width:
                result[k] = other, known, np.concatenate([own, known.project(points)])
                break
        else:
            result.append((pair, surface, points))
    return [(surface, points) for _, surface, points in result]


def _trimmed(patches: Sequence[Patch], edges: Sequence[Edge], width: float) -> dict[int, Patch]:
    """The patches (by index) beside edges without their points within a width of these."""
    lines: dict[int, list[Array]] = {}
    for edge in edges:
        for s in edge.surfaces:
            lines.setdefault(s, []).append(edge.polyline)
    result = {}
    for index, near in sorted(lines.items()):
        patch = patches[index]
        away = cKDTree(np.concatenate(near)).query(patch.xyz)[0] > width
        result[index] = replace(patch, xyz=patch.xyz[away], normals=patch.normals[away])
    return result


def _numbered(bands: Sequence[tuple[Surface, Array]], patches: Sequence[Patch]) -> list[Patch]:
    """Patches of made surfaces and points (N, 3) on them, numbered after those that there are."""
    first = next_number(patches)
    return [
        Patch(made, first + k, points, made.normals(points).copy(), _REACH * SPACING, 0.0, made=True)
        for k, (made, points) in enumerate(bands)
    ]


def _surface(pair: tuple[Surface, Surface], polyline: Array, width: float) -> Surface | None:
    """The chamfer of a convex edge: a cone of 45 degrees between a plane and a cylinder, a plane between planes."""
    kinds = tuple(s.kind for s in pair)
    if kinds == ("plane", "plane"):
        first, second = pair[0].axis, pair[1].axis
        if abs(first @ second) > _ACROSS:
            return None
        middle = (first + second) / np.linalg.norm(first + second)
        down = width * np.sqrt(max(1 - float(first @ middle) ** 2, 0.0))  # legs of `width` on both planes
        return plane(polyline.mean(axis=0) - down * middle, middle)
    if sorted(kinds) != ["cylinder", "plane"]:
        return None
    flat, round_ = pair if kinds[0] == "plane" else pair[::-1]
    if np.linalg.norm(np.cross(flat.axis, round_.axis)) > _PARALLEL:
        return None
    offset = (polyline[0] - round_.origin) @ round_.axis
    center = round_.origin + offset * round_.axis
    if round_.flipped:  # a hole widens towards the plane
        return cone(center, flat.axis, round_.radius + width, np.pi / 4, flipped=True)
    return None if round_.radius <= width else cone(center, -flat.axis, round_.radius - width, np.pi / 4)


def _band(made: Surface, pair: tuple[Surface, Surface], polyline: Array) -> Array:
    """(N, 3) points on a chamfer between its two neighbours along an edge."""
    length = float(np.linalg.norm(np.diff(polyline, axis=0), axis=1).sum())
    spine = resample(polyline, max(int(length / SPACING), 2) - 1)
    return strip(made, [_slide(spine, made, neighbour) for neighbour in pair])


def strip(made: Surface, ends: Sequence[Array]) -> Array:
    """(N, 3) points on a narrow face between the two lines (M, 3) at which it ends."""
    count = max(int(np.linalg.norm(ends[1] - ends[0], axis=1).max() / SPACING), 3)
    share = np.linspace(_MARGIN, 1 - _MARGIN, count)[:, None, None]
    return made.project(((1 - share) * ends[0] + share * ends[1]).reshape(-1, 3))


def _slide(points: Array, made: Surface, neighbour: Surface) -> Array:
    """Points beside an edge moved onto the intersection of its chamfer with one neighbour (alternate projections)."""
    for _ in range(60):
        points = neighbour.project(made.project(points))
    return points
