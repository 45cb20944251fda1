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
from brepgaussian.brep.simplify import Change
from brepgaussian.brep.structure import CONVEX, Edge, Structure
from brepgaussian.geometry.chains import resample
from brepgaussian.geometry.surfaces import Surface, cone, plane

Array = NDArray[np.float64]
Maker = Callable[[tuple[Surface, Surface], Edge], tuple[Surface, Array] | None]

WIDTHS = (0.03, 0.015, 0.06)  # of the legs, unit frame: the refinement's windows reach from one to the next
_BAD_PX = 0.5  # median silhouette residual of an edge that is not where the solid has it
_SHARE_OF_WORST = 0.25  # and of the worst edge's: one wrong edge draws others with it
_PARALLEL = 1e-3  # sine between a plane's normal and a cylinder's axis whose circle is chamfered
_ACROSS = 0.9  # |cosine| between planes whose edge is too blunt or too sharp for a chamfer
SPACING = 0.006  # of the points that stand for a chamfer, unit frame
_MARGIN = 0.05  # of a narrow face's width without made points, at either end
_REACH = 2.0  # spacings
_LEAST_LEFT = 0.3  # of a neighbour's points that must remain
_LEAST_LENGTH = 2.0  # widths: length of an edge that is worth it


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
    for row in edges:
        kind, index = str(row["name"]).rsplit(" ", 1)
        if kind == "edge" and isinstance(row["silhouette_px"], float):
            px[int(index)] = row["silhouette_px"]
    limit = max(_BAD_PX, _SHARE_OF_WORST * max(px.values(), default=0.0))
    return [k for k in sorted(px) if px[k] > limit and structure.edges[k].convexity == CONVEX]


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
    """Narrow faces on edges, with what remains of the neighbours' points; None if there are none or too little is left.

    Args:
        edges, surfaces, patches: of a solid.
        width: from an edge within which the neighbours lose their points, unit frame.
        make: a face and points (N, 3) on it for an edge's two surfaces and the edge; None if there is none.
        what: for the change's name.
    """
    bands: list[tuple[Surface, Array]] = []
    lines: dict[int, list[Array]] = {}
    for edge in edges:
        if max(edge.surfaces) >= len(patches) or min(edge.surfaces) < 0 or len(edge.polyline) < 2:
            continue
        band = make((surfaces[edge.surfaces[0]], surfaces[edge.surfaces[1]]), edge)
        if band is None:
            continue
        bands.append(band)
        for s in edge.surfaces:
            lines.setdefault(s, []).append(edge.polyline)
    left = _trimmed(patches, lines, width)
    if not bands or left is None:
        return None
    new = _numbered(bands, patches)
    return Change(f"{len(new)} {what}", tuple(sorted(lines)), (*left, *new))


def _trimmed(patches: Sequence[Patch], lines: Mapping[int, Sequence[Array]], width: float) -> list[Patch] | None:
    """Patches (by index) without their points within a width of lines; None if too little is left of one."""
    result = []
    for index, near in sorted(lines.items()):
        patch = patches[index]
        away = cKDTree(np.concatenate(near)).query(patch.xyz)[0] > width
        if away.mean() < _LEAST_LEFT:
            return None
        result.append(replace(patch, xyz=patch.xyz[away], normals=patch.normals[away]))
    return result


def _numbered(bands: Sequence[tuple[Surface, Array]], patches: Sequence[Patch]) -> list[Patch]:
    """Patches of made surfaces and points (N, 3) on them, numbered after those that there are."""
    first = next_number(patches)
    return [
        Patch(made, first + k, points, made.normals(points).copy(), _REACH * SPACING, 0.0)
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
