"""Who meets whom in a solid: faces, edges and vertices by the surfaces that they lie on.

This is what the refinement and the curves of `brep.h5` work on. OCP is imported only by `extract`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]

CONVEX, CONCAVE, SMOOTH = "convex", "concave", "smooth"
SMOOTH_ANGLE = np.radians(10.0)  # faces that meet at less are smooth: the project's definition of a sharp edge
SAMPLE_SPACING = 0.01  # of edge polylines, unit frame: three pixels of an 800-px view
_MESH_DEFLECTION = 2e-3  # face samples for matching need no accuracy: they are projected onto the surface
_MESH_ANGLE = 0.4


@dataclass(frozen=True)
class Face:
    """One face of the solid.

    Attributes:
        surface: index of its surface, -1 if no surface explains it.
        area: unit frame squared.
        center: (3,) a point of the face.
        flipped: True if the face's outward normal is opposite to that of its surface.
    """

    surface: int
    area: float
    center: Array
    flipped: bool = False


@dataclass(frozen=True)
class Edge:
    """One edge that is neither a seam nor degenerate.

    Attributes:
        surfaces: indices of the surfaces on its two sides (-1 unknown); equal where coplanar faces meet.
        faces: indices of its two faces.
        kind: line, circle, ellipse or other.
        polyline: (M, 3) samples from its first to its last parameter, about `SAMPLE_SPACING` apart;
            a closed edge ends where it starts.
        convexity: convex, concave or smooth (less than 10 degrees between the faces at the middle).
        vertices: indices of its first and last vertex.
        t_range: its parameter range; arc length for a line, radians for a circle or an ellipse.
        closed: whether it ends where it starts.
    """

    surfaces: tuple[int, int]
    faces: tuple[int, int]
    kind: str
    polyline: Array
    convexity: str
    vertices: tuple[int, int]
    t_range: tuple[float, float]
    closed: bool


@dataclass(frozen=True)
class Vertex:
    """One vertex with the sorted indices of the surfaces that meet there.

    A vertex with fewer than three distinct faces (the end of a seam) is no corner.
    """

    point: Array
    surfaces: tuple[int, ...]
    faces: tuple[int, ...]

    @property
    def corner(self) -> bool:
        """Whether three or more faces meet here."""
        return len(self.faces) >= 3


@dataclass(frozen=True)
class Structure:
    """Faces, edges and vertices of a solid by surface."""

    faces: tuple[Face, ...]
    edges: tuple[Edge, ...]
    vertices: tuple[Vertex, ...]


def extract(solid: Any, surfaces: Sequence[Surface], spacing: float = SAMPLE_SPACING) -> Structure:
    """Read the structure of a closed solid (TopoDS_Shape, unit frame) whose faces lie on `surfaces`.

    Where two surfaces are identical, the one with the smaller index is named.
    """
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_VERTEX

    from brepgaussian.brep import occ

    occ.tessellate(solid, _MESH_DEFLECTION, _MESH_ANGLE)
    shapes = occ.faces(solid)
    faces = tuple(_face(shape, surfaces) for shape in shapes)
    face_ids, vertex_shapes = occ.shape_map(shapes), occ.shapes(solid, TopAbs_VERTEX)
    vertex_ids = occ.shape_map(vertex_shapes)
    edges = []
    for edge, around in occ.ancestors(solid, TopAbs_EDGE, TopAbs_FACE):
        if occ.is_degenerate(edge) or len(around) != 2 or around[0].IsSame(around[1]):
            continue
        pair = (face_ids.FindIndex(around[0]) - 1, face_ids.FindIndex(around[1]) - 1)
        edges.append(_edge(edge, pair, faces, surfaces, shapes, vertex_ids, spacing))
    return Structure(faces, tuple(edges), _vertices(solid, vertex_shapes, faces, face_ids))


def _face(shape: Any, surfaces: Sequence[Surface]) -> Face:
    """Match a face to the nearest surface of its own kind by samples and normals."""
    from brepgaussian.brep import occ

    nodes, triangles = occ.triangles(shape)
    corners = nodes[triangles]  # (T, 3, 3)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    weight = np.linalg.norm(cross, axis=1)
    good = weight > 0
    area = occ.area(shape)
    if not good.any():
        center = nodes.mean(axis=0) if len(nodes) else np.full(3, np.nan)
        return Face(-1, area, center)
    samples, weight = corners[good].mean(axis=1), weight[good] / weight[good].sum()
    normals = cross[good] / np.linalg.norm(cross[good], axis=1, keepdims=True)
    kind = occ.surface_kind(shape)
    best, best_cost, flipped = -1, np.inf, False
    for index, surface in enumerate(surfaces):
        if kind not in ("other", surface.kind):
            continue
        distance = weight @ np.abs(surface.signed_distance(nodes[triangles[good]].reshape(-1, 3)).reshape(-1, 3).max(1))
        agree = weight @ np.einsum("ij,ij->i", surface.normals(samples), normals)
        cost = distance + 0.01 * (1 - abs(agree))  # normals break ties between surfaces through the same points
        if cost < best_cost - 1e-9:
            best, best_cost, flipped = index, cost, bool(agree < 0)
    return Face(best, area, samples[np.argmax(weight)], flipped)


def _edge(
    edge: Any,
    pair: tuple[int, int],
    faces: tuple[Face, ...],
    surfaces: Sequence[Surface],
    shapes: Sequence[Any],
    vertex_ids: Any,
    spacing: float,
) -> Edge:
    from brepgaussian.brep import occ

    kind, t_range = occ.curve_kind(edge)
    polyline = occ.curve_samples(edge, spacing)
    ends = tuple(vertex_ids.FindIndex(v) - 1 for v in occ.edge_ends(edge))
    closed = ends[0] == ends[1]
    middle = len(polyline) // 2
    tangent = polyline[middle] - polyline[middle - 1]
    point = 0.5 * (polyline[middle] + polyline[middle - 1])
    if occ.is_reversed(occ.edge_in(edge, shapes[pair[0]])):
        tangent = -tangent  # counter-clockwise around the first face, seen from outside
    first, second = (_outward(faces[f], surfaces, shapes[f], point) for f in pair)
    if first @ second > np.cos(SMOOTH_ANGLE):
        convexity = SMOOTH
    else:
        inward = np.cross(first, tangent)  # into the first face
        convexity = CONVEX if inward @ second < 0 else CONCAVE
    return Edge(
        surfaces=(faces[pair[0]].surface, faces[pair[1]].surface),
        faces=pair,
        kind=kind,
        polyline=polyline,
        convexity=convexity,
        vertices=(ends[0], ends[1]),
        t_range=t_range,
        closed=closed,
    )


def _outward(face: Face, surfaces: Sequence[Surface], shape: Any, point: Array) -> Array:
    """(3,) outward normal of a face near a point."""
    from brepgaussian.brep import occ

    if face.surface >= 0:
        normal = surfaces[face.surface].normals(point[None])[0]
        return -normal if face.flipped else normal
    return occ.normal_near(shape, point)


def _vertices(solid: Any, shapes: Sequence[Any], faces: tuple[Face, ...], face_ids: Any) -> tuple[Vertex, ...]:
    from OCP.TopAbs import TopAbs_FACE, TopAbs_VERTEX

    from brepgaussian.brep import occ

    ids = occ.shape_map(shapes)
    around: list[tuple[int, ...]] = [()] * len(shapes)
    for vertex, holders in occ.ancestors(solid, TopAbs_VERTEX, TopAbs_FACE):
        around[ids.FindIndex(vertex) - 1] = tuple(sorted({face_ids.FindIndex(f) - 1 for f in holders}))
    return tuple(
        Vertex(occ.point(shape), tuple(sorted({faces[f].surface for f in at})), at)
        for shape, at in zip(shapes, around, strict=True)
    )
