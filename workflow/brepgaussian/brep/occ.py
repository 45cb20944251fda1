"""Thin helpers over OCP: explore, measure, tessellate, serialise. The only place that knows its odd corners."""

import io
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BinTools import BinTools
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepGProp import BRepGProp
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.collections import (
    IndexedDataMap_TopoDS_Shape_List_TopoDS_Shape_TopTools_ShapeMapHasher as AncestorMap,
)
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.collections import List_TopoDS_Shape as ShapeList
from OCP.GeomAbs import (
    GeomAbs_Circle,
    GeomAbs_Cone,
    GeomAbs_Cylinder,
    GeomAbs_Ellipse,
    GeomAbs_Line,
    GeomAbs_Plane,
    GeomAbs_Sphere,
    GeomAbs_Torus,
)
from OCP.GProp import GProp_GProps
from OCP.TopAbs import (
    TopAbs_EDGE,
    TopAbs_FACE,
    TopAbs_FORWARD,
    TopAbs_REVERSED,
    TopAbs_ShapeEnum,
    TopAbs_SOLID,
    TopAbs_VERTEX,
)
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Compound, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from brepgaussian.geometry.surfaces import Surface, plane

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

FORWARD = TopAbs_FORWARD
_SURFACE_KINDS = {
    GeomAbs_Plane: "plane",
    GeomAbs_Cylinder: "cylinder",
    GeomAbs_Sphere: "sphere",
    GeomAbs_Cone: "cone",
    GeomAbs_Torus: "torus",
}
_CURVE_KINDS = {GeomAbs_Line: "line", GeomAbs_Circle: "circle", GeomAbs_Ellipse: "ellipse"}


def shapes(shape: TopoDS_Shape, kind: TopAbs_ShapeEnum) -> list[Any]:
    """The distinct sub-shapes of one kind, in OCC's (deterministic) exploration order."""
    found = ShapeMap()
    TopExp.MapShapes_s(shape, kind, found)
    return [typed(found.FindKey(i)) for i in range(1, found.Extent() + 1)]


def typed(shape: TopoDS_Shape) -> Any:
    """A shape as its own Python type (OCC's maps and lists hand out the base type)."""
    cast = {
        TopAbs_FACE: TopoDS.Face,
        TopAbs_EDGE: TopoDS.Edge,
        TopAbs_VERTEX: TopoDS.Vertex,
        TopAbs_SOLID: TopoDS.Solid,
    }
    return cast.get(shape.ShapeType(), lambda s: s)(shape)


def faces(shape: TopoDS_Shape) -> list[TopoDS_Face]:
    """The faces of a shape."""
    return shapes(shape, TopAbs_FACE)


def oriented_faces(shape: TopoDS_Shape) -> list[TopoDS_Face]:
    """Every use of a face in a shape, with its orientation there."""
    found, explorer = [], TopExp_Explorer(shape, TopAbs_FACE)
    while explorer.More():
        found.append(TopoDS.Face(explorer.Current()))
        explorer.Next()
    return found


def solids(shape: TopoDS_Shape) -> list[Any]:
    """The solids of a shape."""
    return shapes(shape, TopAbs_SOLID)


def shape_map(items: Iterable[TopoDS_Shape]) -> Any:
    """An indexed map (1-based `FindIndex`) over shapes; orientation does not matter to it."""
    found = ShapeMap()
    for item in items:
        found.Add(item)
    return found


def ancestors(shape: TopoDS_Shape, kind: TopAbs_ShapeEnum, of: TopAbs_ShapeEnum) -> Iterator[tuple[Any, list[Any]]]:
    """Each sub-shape of `kind` with the sub-shapes of type `of` that hold it (with repetition for seams)."""
    found = AncestorMap()
    TopExp.MapShapesAndAncestors_s(shape, kind, of, found)
    for i in range(1, found.Extent() + 1):
        yield typed(found.FindKey(i)), [typed(s) for s in found.FindFromIndex(i)]


def shape_list(items: Iterable[TopoDS_Shape]) -> Any:
    """An OCC list of shapes."""
    result = ShapeList()
    for item in items:
        result.Append(item)
    return result


def compound(items: Iterable[TopoDS_Shape]) -> TopoDS_Compound:
    """A compound of shapes."""
    result, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(result)
    for item in items:
        builder.Add(result, item)
    return result


def area(face: TopoDS_Shape) -> float:
    """Area of a face or shape."""
    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, properties)
    return float(properties.Mass())


def volume(shape: TopoDS_Shape) -> float:
    """Signed volume of a shape."""
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties)
    return float(properties.Mass())


def is_reversed(shape: TopoDS_Shape) -> bool:
    """Whether a sub-shape is used against its own direction."""
    return bool(shape.Orientation() == TopAbs_REVERSED)


def is_seam(edge: TopoDS_Edge, face: TopoDS_Face) -> bool:
    """Whether an edge closes a periodic face onto itself."""
    return bool(BRep_Tool.IsClosed_s(edge, face))


def is_degenerate(edge: TopoDS_Edge) -> bool:
    """Whether an edge is a point (a cone's apex, a sphere's pole)."""
    return bool(BRep_Tool.Degenerated_s(edge))


def point(vertex: Any) -> Array:
    """(3,) position of a vertex."""
    return xyz(BRep_Tool.Pnt_s(vertex))


def xyz(value: Any) -> Array:
    """(3,) of a gp_Pnt, gp_Dir or gp_Vec."""
    return np.array([value.X(), value.Y(), value.Z()])


def curve_samples(edge: TopoDS_Edge, spacing: float, minimum: int = 2) -> Array:
    """(M, 3) samples of an edge from its first to its last parameter, about `spacing` apart, ends included."""
    curve = BRepAdaptor_Curve(edge)
    first, last = curve.FirstParameter(), curve.LastParameter()
    rough = np.array([xyz(curve.Value(t)) for t in np.linspace(first, last, 9)])
    length = np.linalg.norm(np.diff(rough, axis=0), axis=1).sum()
    count = max(minimum, int(np.ceil(length / spacing)) + 1)
    return np.array([xyz(curve.Value(t)) for t in np.linspace(first, last, count)])


def bounds(shape: TopoDS_Shape) -> Array:
    """(2, 3) lower and upper corner of the bounding box."""
    from OCP.Bnd import Bnd_Box

    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box, False, False)
    return np.array([xyz(box.CornerMin()), xyz(box.CornerMax())])


def tessellate(shape: TopoDS_Shape, deflection: float, angle: float) -> None:
    """Give the faces of a shape a triangulation (chord error in units of the shape, angle in radians)."""
    BRepTools.Clean_s(shape)
    BRepMesh_IncrementalMesh(shape, deflection, False, angle, False)


def triangles(face: TopoDS_Face) -> tuple[Array, Indices]:
    """(K, 3) nodes and (T, 3) triangles of a tessellated face, wound so that normals point out of the face."""
    location = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, location)
    if mesh is None:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    transform = location.Transformation()
    found = (mesh.Node(i) for i in range(1, mesh.NbNodes() + 1))
    placed = found if location.IsIdentity() else (node.Transformed(transform) for node in found)
    nodes = np.array([(node.X(), node.Y(), node.Z()) for node in placed])
    corners = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)], np.int64) - 1
    return nodes, corners[:, ::-1] if is_reversed(face) else corners


def mesh_of(shape: TopoDS_Shape) -> tuple[Array, Indices, Indices]:
    """(K, 3) nodes, (T, 3) triangles and (T,) index of the face of each triangle, of a tessellated shape."""
    nodes, found, owner, start = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)], 0
    for index, face in enumerate(faces(shape)):
        n, t = triangles(face)
        nodes.append(n)
        found.append(t + start)
        owner.append(np.full(len(t), index, np.int64))
        start += len(n)
    return np.concatenate(nodes), np.concatenate(found), np.concatenate(owner)


def to_bytes(shape: TopoDS_Shape) -> bytes:
    """A shape as OCC's binary BRep, without its triangulation."""
    BRepTools.Clean_s(shape)
    stream = io.BytesIO()
    BinTools.Write_s(shape, stream)
    return stream.getvalue()


def from_bytes(data: bytes) -> TopoDS_Shape:
    """Inverse of `to_bytes`."""
    shape = TopoDS_Shape()
    BinTools.Read_s(shape, io.BytesIO(data))
    return shape


def surface_kind(face: TopoDS_Face) -> str:
    """Plane, cylinder, sphere, cone, torus or other."""
    return _SURFACE_KINDS.get(BRepAdaptor_Surface(face).GetType(), "other")


def curve_kind(edge: TopoDS_Edge) -> tuple[str, tuple[float, float]]:
    """Line, circle, ellipse or other, with the parameter range (0..1 for other)."""
    curve = BRepAdaptor_Curve(edge)
    kind = _CURVE_KINDS.get(curve.GetType(), "other")
    return kind, (0.0, 1.0) if kind == "other" else (curve.FirstParameter(), curve.LastParameter())


def edge_ends(edge: TopoDS_Edge) -> tuple[Any, Any]:
    """First and last vertex in the direction of the edge's curve."""
    return TopExp.FirstVertex_s(edge, False), TopExp.LastVertex_s(edge, False)


def edge_in(edge: TopoDS_Edge, face: TopoDS_Face) -> TopoDS_Edge:
    """The edge with the orientation that it has in a face."""
    explorer = TopExp_Explorer(face, TopAbs_EDGE)
    while explorer.More():
        if explorer.Current().IsSame(edge):
            return TopoDS.Edge(explorer.Current())
        explorer.Next()
    raise ValueError("the edge is not in the face")


def normal_near(face: TopoDS_Face, position: Array) -> Array:
    """(3,) outward normal of a tessellated face at its triangle nearest to a point."""
    nodes, found = triangles(face)
    if not len(found):
        return np.zeros(3)
    corners = nodes[found]
    nearest = int(np.argmin(np.linalg.norm(corners.mean(axis=1) - position, axis=1)))
    a, b, c = corners[nearest]
    normal = np.cross(b - a, c - a)
    return normal / max(np.linalg.norm(normal), 1e-300)


def planes(shape: TopoDS_Shape) -> list[Surface]:
    """The planes of a polyhedron's faces, normals outwards, one a face (faces of one plane share the first)."""
    tessellate(shape, 1.0, 1.0)
    found: list[Surface] = []
    for face in faces(shape):
        nodes, corners = triangles(face)
        a, b, c = np.moveaxis(nodes[corners], 1, 0)
        normal = np.cross(b - a, c - a).sum(axis=0)
        if np.linalg.norm(normal) > 0:
            found.append(plane(nodes.mean(axis=0), normal))
    return found
