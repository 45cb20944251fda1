"""Fillets that the points do not have, proposed where parallax puts faces elsewhere beside a sharp edge.

In a pocket's corner, or where a web meets a flange, no silhouette shows a fillet, and the hull is as sharp as it is
round. Edges and masks agree with the sharp solid; the grey of the rounded surface follows the slant of the views.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.brep.features import SPACING, WIDTHS, bad_edges, chamfer_of, placed, strip
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.shown import edge_rows
from brepgaussian.brep.simplify import Change
from brepgaussian.brep.structure import CONCAVE, CONVEX, SMOOTH, Edge, Face, Structure
from brepgaussian.geometry.chains import resample
from brepgaussian.geometry.rolling import rolling, touching
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]

_BESIDE = 0.06  # from an edge to the places that speak for a fillet on it, unit frame: the largest radius
_BLUNT = 0.9  # |cosine| between planes whose edge is too blunt or too sharp
_SQUARE = 1e-3  # sine between a plane's normal and a cylinder's axis that a torus rounds off
_ALIKE = 0.02  # of their length that two edges of a set differ by,
_PARALLEL = np.cos(np.radians(2.0))  # and between their directions
_AS_FAR = 1 / (2 - np.sqrt(2))  # radius over a chamfer's leg where both take a square edge back by the same length
_FAR = 0.8  # quantile of the places' distances from the edge: near the fillet's end the faces are hardly off
_RADIUS_DIGITS = 3  # of radii that are one
_CONFIRMED_PX = 0.25  # median distance of an edge from what views show there: less than fillets of a few px scatter it
_SHIFTED_PX, _SHIFTED = 0.3, 3.0  # median distance from an edge to a step in grey that is not its, least; and medians
_OFTEN, _NEXT_TO_NONE = 200, 0.05  # samples of an edge that views see, and those of them that show a step in grey
_ALIKE_RADII = 0.3  # of one by which another differs that the refinement comes to
_MOST_KNOWN = 2  # radii of a solid's fillets that are tried
_MOST_SETS = 2  # that are tried, those with most places first


def fillets(
    structure: Structure,
    surfaces: Sequence[Surface],
    patches: Sequence[Patch],
    off: Array,
    edges: Sequence[Mapping[str, Any]] = (),
) -> list[Change]:
    """One change for every radius and set of edges: fillets on edges beside places that lie elsewhere.

    Not on convex edges that the images confirm: of a rounded one, views from other sides see other lines.

    Args:
        structure: of the solid that the images judged.
        surfaces: that it names; the first ones belong to `patches`.
        patches: that it was built from.
        off: (P, 4) places and by how many px the surface should lie deeper.
        edges: the acceptance test's table of the solid's edges.
    """
    sharp = _confirmed(structure, edges)
    near = {k: distances for k, distances in _beside(structure, off).items() if k not in sharp}
    if not near:
        return []
    reach = float(np.quantile(np.concatenate(list(near.values())), _FAR))
    sets = {tuple(_set_of(structure.edges, index)) for index in near}
    told = {s: sum(len(near[k]) for k in s if k in near) for s in sets}
    order = sorted(sets, key=lambda s: (-told[s], s))[:_MOST_SETS]
    radii = sorted(WIDTHS, key=lambda radius: abs(np.log(radius / max(reach, SPACING))))
    return _with_radii(structure, surfaces, patches, order, radii)


def inner_fillets(
    structure: Structure, surfaces: Sequence[Surface], patches: Sequence[Patch], edges: Sequence[Mapping[str, Any]]
) -> list[Change]:
    """One change for every radius: fillets on the concave edges that images show elsewhere, all of them or one set.

    No silhouette shows these. Fillets that the solid has tell a radius that is likely.

    Args:
        structure, surfaces, patches, edges: as of `fillets`.
    """
    shifted = _shifted(structure, edges)
    sets = {tuple(k for k in _set_of(structure.edges, index) if k in shifted) for index in shifted}
    groups = [shifted] + (sorted(sets, key=lambda s: (-len(s), s))[:_MOST_SETS] if len(sets) > 1 else [])
    known = sorted({round(s.radius, _RADIUS_DIGITS) for s in _rolled(structure, surfaces)})
    radii = [*known[:_MOST_KNOWN], *(w for w in WIDTHS if all(abs(w - r) > _ALIKE_RADII * r for r in known))]
    return _with_radii(structure, surfaces, patches, groups, radii)


def _with_radii(
    structure: Structure,
    surfaces: Sequence[Surface],
    patches: Sequence[Patch],
    sets: Iterable[Sequence[int]],
    radii: Sequence[float],
) -> list[Change]:
    """Fillets of each radius on each of some sets of edges."""
    found = (_filleted([structure.edges[k] for k in s], surfaces, patches, r) for s in sets if s for r in radii)
    return [change for change in found if change is not None]


def _rolled(structure: Structure, surfaces: Sequence[Surface]) -> list[Surface]:
    """Cylinders of concave fillets."""
    smooth = {f for e in structure.edges if e.convexity == SMOOTH and e.kind == "line" for f in e.faces}
    hollow = (_hollow(face, surfaces) for k, face in enumerate(structure.faces) if k in smooth)
    return [s for s in hollow if s is not None]


def _hollow(face: Face, surfaces: Sequence[Surface]) -> Surface | None:
    """The cylinder on whose inside a face lies, if it does."""
    surface = surfaces[face.surface] if face.surface >= 0 else None
    return surface if surface is not None and surface.kind == "cylinder" and surface.flipped != face.flipped else None


def _shifted(structure: Structure, edges: Sequence[Mapping[str, Any]]) -> list[int]:
    """Concave edges whose step in grey lies elsewhere, much farther than those of most edges do, or that show none."""
    rows = dict(edge_rows(edges))
    px = {k: row["interior_px"] for k, row in rows.items() if isinstance(row["interior_px"], float)}
    limit = max(_SHIFTED_PX, _SHIFTED * float(np.median([*px.values()] or [0.0])))
    off = {k for k in px if px[k] > limit} | {k for k, row in rows.items() if _is_missing(row)}
    return [k for k in sorted(off) if structure.edges[k].convexity == CONCAVE]


def _is_missing(row: Mapping[str, Any]) -> bool:
    """Whether many views see an edge and next to none shows a step in grey at it."""
    seen, shown = row.get("creases", 0), row.get("interior", 0)
    return bool(seen >= _OFTEN and shown < _NEXT_TO_NONE * seen)


def roundings(
    structure: Structure, surfaces: Sequence[Surface], patches: Sequence[Patch], edges: Sequence[Mapping[str, Any]]
) -> list[Change]:
    """One change for every width: what `features.chamfers` proposes, with straight edges between planes rounded.

    Args:
        structure, surfaces, patches, edges: as there.
    """
    bad = [structure.edges[k] for k in bad_edges(structure, edges)]
    if not any(_between_planes(edge, surfaces) for edge in bad):
        return []
    found = (_rounded(bad, surfaces, patches, width) for width in WIDTHS)
    return [change for change in found if change is not None]


def completed(structure: Structure, surfaces: Sequence[Surface], patches: Sequence[Patch]) -> list[Change]:
    """One change for every radius: fillets on the sharp corners of a pocket whose other corners are rounded.

    A cutter leaves no sharp ones, and views tell little of a corner deep inside.

    Args:
        structure, surfaces, patches: as of `fillets`.
    """
    sharp: dict[float, set[int]] = {}
    for index, face in enumerate(structure.faces):
        rounded = _hollow(face, surfaces)
        if rounded is None:
            continue
        around = [e for e in structure.edges if index in e.faces]
        sides = [e for e in around if e.convexity == SMOOTH and e.kind == "line"]
        if len(sides) == 2:
            ends = {f for e in around if e.convexity != SMOOTH for f in e.faces} - {index}
            walls = {f for e in sides for f in e.faces} - {index}
            alike = {k for k, e in enumerate(structure.edges)
                     if _is_corner(e, surfaces) and _as_long(e, sides[0]) and ends <= _met(structure, e)}  # fmt: skip
            sharp.setdefault(round(rounded.radius, _RADIUS_DIGITS), set()).update(_along(structure, alike, walls))
    changes = (
        _filleted([structure.edges[k] for k in sorted(found)], surfaces, patches, radius)
        for radius, found in sorted(sharp.items())
        if found
    )
    return [change for change in changes if change is not None]


def _along(structure: Structure, corners: set[int], walls: set[int]) -> set[int]:
    """Those corners that one meets going along walls: of another pocket they are none."""
    found: set[int] = set()
    while fresh := {k for k in corners - found if walls & set(structure.edges[k].faces)}:
        found |= fresh
        walls = walls | {f for k in fresh for f in structure.edges[k].faces}
    return found


def _is_corner(edge: Edge, surfaces: Sequence[Surface]) -> bool:
    return edge.convexity == CONCAVE and _between_planes(edge, surfaces)


def _met(structure: Structure, edge: Edge) -> set[int]:
    """Faces at both ends of an edge."""
    return {f for v in edge.vertices for f in structure.vertices[v].faces}


def _rounded(
    edges: Sequence[Edge], surfaces: Sequence[Surface], patches: Sequence[Patch], width: float
) -> Change | None:
    """Roundings on straight edges between planes and chamfers on others that take them back as far."""
    chamfer, radius = chamfer_of(width), _AS_FAR * width

    def make(pair: tuple[Surface, Surface], edge: Edge) -> tuple[Surface, Array] | None:
        if not _between_planes(edge, surfaces):
            return chamfer(pair, edge)
        made = _surface(pair, radius)
        return None if made is None else (made, _band(made, pair, edge.polyline))

    return placed(edges, surfaces, patches, radius, make, f"roundings and chamfers {width:g} wide")


def _between_planes(edge: Edge, surfaces: Sequence[Surface]) -> bool:
    return edge.kind == "line" and all(k >= 0 and surfaces[k].kind == "plane" for k in edge.surfaces)


def _confirmed(structure: Structure, edges: Sequence[Mapping[str, Any]]) -> set[int]:
    """Convex edges that lie where views show a silhouette or a step."""
    found = set()
    for index, row in edge_rows(edges):
        known = [px for px in (row["silhouette_px"], row["interior_px"]) if isinstance(px, float)]
        if known and max(known) < _CONFIRMED_PX and structure.edges[index].convexity == CONVEX:
            found.add(index)
    return found


def _beside(structure: Structure, off: Array) -> dict[int, Array]:
    """Edges that displaced places lie beside, and their distances: before concave edges, behind convex ones."""
    found: dict[int, list[float]] = {}
    for convexity, rows in ((CONCAVE, off[off[:, 3] < 0]), (CONVEX, off[off[:, 3] > 0])):
        edges = [k for k, e in enumerate(structure.edges) if e.convexity == convexity and len(e.polyline) > 1]
        if not edges or not len(rows):
            continue
        lines = [_dense(structure.edges[k].polyline) for k in edges]
        owner = np.repeat(edges, [len(line) for line in lines])
        distance, index = cKDTree(np.concatenate(lines)).query(rows[:, :3], distance_upper_bound=_BESIDE)
        for far, at in zip(distance, index, strict=True):
            if np.isfinite(far):
                found.setdefault(int(owner[at]), []).append(float(far))
    return {k: np.array(v) for k, v in sorted(found.items())}


def _set_of(edges: Sequence[Edge], index: int) -> list[int]:
    """Straight edges as long as one, parallel to it and of the same sign: the corners of a pocket; itself at least."""
    one = edges[index]
    if one.kind != "line":
        return [index]
    return [k for k, e in enumerate(edges)
            if e.kind == "line" and e.convexity == one.convexity and _as_long(e, one)]  # fmt: skip


def _as_long(first: Edge, second: Edge) -> bool:
    spans = [e.polyline[-1] - e.polyline[0] for e in (first, second)]
    lengths = [float(np.linalg.norm(s)) for s in spans]
    along = abs(float(spans[0] @ spans[1])) / max(lengths[0] * lengths[1], SPACING**2)
    return along > _PARALLEL and abs(lengths[0] - lengths[1]) < _ALIKE * max(lengths)


def _filleted(
    edges: Sequence[Edge], surfaces: Sequence[Surface], patches: Sequence[Patch], radius: float
) -> Change | None:
    """Fillets of one radius on edges, with what remains of the neighbours' points."""

    def make(pair: tuple[Surface, Surface], edge: Edge) -> tuple[Surface, Array] | None:
        made = _surface(pair, radius if edge.convexity == CONVEX else -radius)
        return None if made is None else (made, _band(made, pair, edge.polyline))

    return placed(edges, surfaces, patches, radius, make, f"fillets of radius {radius:g}")


def _surface(pair: tuple[Surface, Surface], radius: float) -> Surface | None:
    """The fillet between two planes, or a plane and a cylinder or cone across it; radius positive on a convex edge."""
    kinds = [s.kind for s in pair]
    if kinds == ["plane", "plane"]:
        return rolling(*pair, radius) if abs(pair[0].axis @ pair[1].axis) < _BLUNT else None
    if sorted(kinds) not in (["cylinder", "plane"], ["cone", "plane"]):
        return None
    floor, wall = pair if kinds[0] == "plane" else pair[::-1]
    if float(np.linalg.norm(np.cross(floor.axis, wall.axis))) >= _SQUARE:
        return None
    made = touching(wall, floor, radius)
    return made if made.radius > abs(radius) else None


def _band(made: Surface, pair: tuple[Surface, Surface], polyline: Array) -> Array:
    """(N, 3) points on a fillet between the lines in which it touches its two neighbours."""
    spine = _dense(polyline)
    on = made.project(spine)
    tube = made.minor if made.kind == "torus" else made.radius
    centre = on - made.sign * tube * made.normals(on)
    return strip(made, [s.project(centre) for s in pair])


def _dense(polyline: Array) -> Array:
    """(N, 3) points along an edge."""
    length = float(np.linalg.norm(np.diff(polyline, axis=0), axis=1).sum())
    return resample(polyline, max(int(length / SPACING), 2))
