"""Topology of an OCC shape as a user of CAD sees it: one count for truths and for results. Imports OCP."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.collections import IndexedDataMap_TopoDS_Shape_List_TopoDS_Shape_TopTools_ShapeMapHasher as AncestorMap
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.GCPnts import GCPnts_AbscissaPoint
from OCP.GeomAbs import GeomAbs_Circle, GeomAbs_Ellipse, GeomAbs_Line
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_VERTEX
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS

from brepgaussian.geometry.chains import EdgeEnds, join, resample
from brepgaussian.geometry.kernel import face_normals, face_surface, faces_of

Array = NDArray[np.float64]
SHARP_DEG = 10.0  # faces that meet at more than this make a sharp curve (the project's metrics)
CURVE_SPACING = 0.005  # unit frame; distance between samples of sharp curves (the project's metrics)
_DIHEDRAL_FRACTIONS = (0.1, 0.3, 0.5, 0.7, 0.9)  # where along an edge its dihedral angle is taken
_CURVE_TYPES = {GeomAbs_Line: "line", GeomAbs_Circle: "circle", GeomAbs_Ellipse: "ellipse"}


@dataclass(frozen=True)
class Topology:
    """Counts of one shape.

    Attributes:
        face_types: plane, cylinder, cone, sphere, torus or other per face, in the order of `faces_of`.
        face_pairs: (A, 2) int32 adjacent faces, each pair once, first < second, sorted; sharp or smooth.
        edge_count: visible curves: edges that are neither seams nor degenerate, where pieces that continue
            each other between the same two faces count once.
        vertex_count: corners, see `count_topology`.
    """

    face_types: tuple[str, ...]
    face_pairs: NDArray[np.int32]
    edge_count: int
    vertex_count: int


@dataclass(frozen=True)
class SharpCurves:
    """Samples of the sharp curves of a shape.

    Attributes:
        points: (M, 3) float64.
        curve_id: (M,) int32, 0..C-1.
        types: line, circle, ellipse or other per curve.
    """

    points: Array
    curve_id: NDArray[np.int32]
    types: tuple[str, ...]


def count_topology(solid: Any) -> Topology:
    """Count faces, edges and vertices as a user sees them in CAD.

    - Faces: as they are in the shape, none merged.
    - Edges: without seams (an edge that bounds the same face twice) and degenerate edges (poles, apices).
      Where a kernel splits a curve at a place that nobody sees (a seam ends there), the pieces count as one
      edge: they meet in a vertex of two edge ends, bound the same faces and continue without a bend.
    - Vertices: the ends of those edges that aren't hidden by that rule. So a full circle is one edge
      without a vertex, a block with a through hole has 8 vertices and 14 edges wherever its seam lies, and
      a vertex of seams and poles only doesn't count.

    The counts depend on the shape's geometry and not on where a kernel puts its seams, so truths and
    results of different origin can be compared.
    """
    faces = faces_of(solid)
    surfaces = [face_surface(face) for face in faces]
    types = tuple(surface.kind if surface is not None else "other" for surface in surfaces)
    edges = _visible_edges(solid)
    curves, corners = join([edge.ends for edge in edges])
    pairs = sorted({edge.ends.faces for edge in edges if len(edge.ends.faces) == 2})
    return Topology(
        face_types=types,
        face_pairs=np.array(pairs, np.int32).reshape(-1, 2),
        edge_count=len(set(curves.tolist())),
        vertex_count=corners,
    )


def sharp_curves(solid: Any, spacing: float = CURVE_SPACING, sharp_deg: float = SHARP_DEG) -> SharpCurves:
    """Sample the visible curves whose faces meet at more than `sharp_deg` degrees, every `spacing`."""
    faces = faces_of(solid)
    edges = _visible_edges(solid)
    curves, _ = join([edge.ends for edge in edges])
    points, ids = [np.zeros((0, 3))], [np.zeros(0, np.int32)]
    types: list[str] = []
    for curve in range(int(curves.max(initial=-1)) + 1):
        pieces = [edge for edge, owner in zip(edges, curves, strict=True) if owner == curve]
        if _dihedral_deg(pieces[0], faces) <= sharp_deg:
            continue
        for piece in pieces:
            samples = piece.samples(spacing)
            points.append(samples)
            ids.append(np.full(len(samples), len(types), np.int32))
        types.append(pieces[0].kind)
    return SharpCurves(np.concatenate(points), np.concatenate(ids), tuple(types))


@dataclass(frozen=True)
class _Edge:
    """One edge with what counting and sampling need."""

    curve: Any  # BRepAdaptor_Curve
    ends: EdgeEnds

    @property
    def kind(self) -> str:
        return _CURVE_TYPES.get(self.curve.GetType(), "other")

    def at(self, fractions: Array | tuple[float, ...]) -> Array:
        """(N, 3) points at fractions of the parameter range."""
        low, high = self.curve.FirstParameter(), self.curve.LastParameter()
        return np.array([_xyz(self.curve.Value(low + float(f) * (high - low))) for f in fractions])

    def samples(self, spacing: float) -> Array:
        """(N, 3) points at equal arc lengths, at most `spacing` apart, both ends included."""
        low, high = self.curve.FirstParameter(), self.curve.LastParameter()
        length = GCPnts_AbscissaPoint.Length_s(self.curve, low, high)
        count = max(1, int(np.ceil(length / spacing)))
        if self.kind in ("line", "circle"):
            return self.at(np.linspace(0, 1, count + 1))
        dense = self.at(np.linspace(0, 1, 8 * count + 1))
        return resample(dense, count)


def _visible_edges(solid: Any) -> list[_Edge]:
    """All edges that are neither seams nor degenerate."""
    faces, vertices, owners = ShapeMap(), ShapeMap(), AncestorMap()
    TopExp.MapShapes_s(solid, TopAbs_FACE, faces)
    TopExp.MapShapes_s(solid, TopAbs_VERTEX, vertices)
    TopExp.MapShapesAndAncestors_s(solid, TopAbs_EDGE, TopAbs_FACE, owners)
    found = []
    for index in range(1, owners.Extent() + 1):
        edge = TopoDS.Edge(owners.FindKey(index).Oriented(TopAbs_FORWARD))
        sides = [faces.FindIndex(face) - 1 for face in owners.FindFromIndex(index)]
        if BRep_Tool.Degenerated_s(edge) or _is_seam(edge, owners.FindFromIndex(index), sides):
            continue
        curve = BRepAdaptor_Curve(edge)
        ends = EdgeEnds(
            vertices=(
                vertices.FindIndex(TopExp.FirstVertex_s(edge)),
                vertices.FindIndex(TopExp.LastVertex_s(edge)),
            ),
            tangents=np.array([_tangent(curve, curve.FirstParameter(), 1), _tangent(curve, curve.LastParameter(), -1)]),
            faces=tuple(sorted(set(sides))),
        )
        found.append(_Edge(curve, ends))
    return found


def _is_seam(edge: Any, owners: Any, sides: list[int]) -> bool:
    if len(set(sides)) > 1:
        return False
    return len(sides) > 1 or any(BRep_Tool.IsClosed_s(edge, TopoDS.Face(face)) for face in owners)


def _tangent(curve: Any, parameter: float, sign: int) -> Array:
    point, first = gp_Pnt(), gp_Vec()
    curve.D1(parameter, point, first)
    direction = _xyz(first)
    length = float(np.linalg.norm(direction))
    return sign * direction / length if length > 0 else direction


def _dihedral_deg(edge: _Edge, faces: list[Any]) -> float:
    """Median angle between the outward normals of an edge's two faces; 180 for a free edge."""
    if len(edge.ends.faces) != 2:
        return 180.0
    points = edge.at(_DIHEDRAL_FRACTIONS)
    first, second = (face_normals(faces[i], points) for i in edge.ends.faces)
    cosine = np.clip(np.einsum("ij,ij->i", first, second), -1, 1)
    return float(np.degrees(np.median(np.arccos(cosine))))


def _xyz(thing: Any) -> Array:
    return np.array([thing.X(), thing.Y(), thing.Z()])
