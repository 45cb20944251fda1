"""Faces of the OCC kernel as numbers: surface, type, outward normals. Imports OCP."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepTools import BRepTools
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.GeomAbs import GeomAbs_Cone, GeomAbs_Cylinder, GeomAbs_Plane, GeomAbs_Sphere, GeomAbs_Torus
from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
from OCP.gp import gp_Cone, gp_Cylinder, gp_Pln, gp_Pnt, gp_Sphere, gp_Vec
from OCP.ShapeAnalysis import ShapeAnalysis_CanonicalRecognition
from OCP.TopAbs import TopAbs_FACE, TopAbs_REVERSED, TopAbs_ShapeEnum
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS

from brepgaussian.geometry.surfaces import Surface, cone, cylinder, plane, sphere, torus

Array = NDArray[np.float64]
# Spline faces that are a quadric within this length (in the shape's unit) count as that quadric.
RECOGNITION_TOLERANCE = 1e-6


def sub_shapes(shape: Any, kind: TopAbs_ShapeEnum) -> list[Any]:
    """The distinct sub-shapes of one kind, in the kernel's deterministic order."""
    found = ShapeMap()
    TopExp.MapShapes_s(shape, kind, found)
    return [found.FindKey(i) for i in range(1, found.Extent() + 1)]


def faces_of(shape: Any) -> list[Any]:
    """The faces of a shape; their index here is the face id everywhere else."""
    return [TopoDS.Face(face) for face in sub_shapes(shape, TopAbs_FACE)]


def face_surface(face: Any) -> Surface | None:
    """The analytic surface of a face with its outward orientation, or None for any other surface."""
    adaptor = BRepAdaptor_Surface(face, True)
    surface = _elementary(adaptor)
    if surface is None:
        surface = _recognised(face)
    if surface is None:
        return None
    point, normal = middle(face)
    return surface if float(surface.normals(point[None])[0] @ normal) > 0 else surface.flip()


def middle(face: Any) -> tuple[Array, Array]:
    """A point (3,) of the face's surface, off its poles, and the outward normal (3,) there."""
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    parameters = np.array([[u0 + f * (u1 - u0), v0 + g * (v1 - v0)] for f, g in ((0.5, 0.5), (0.37, 0.41))])
    points, normals = evaluate(face, parameters)
    best = int(np.argmax(np.linalg.norm(normals, axis=1)))
    return points[best], normals[best]


def evaluate(face: Any, parameters: Array) -> tuple[Array, Array]:
    """Points (N, 3) and outward unit normals (N, 3) of a face at (N, 2) surface parameters.

    A normal is zero where the surface is singular (the apex of a cone).
    """
    adaptor = BRepAdaptor_Surface(face, False)
    sign = -1.0 if face.Orientation() == TopAbs_REVERSED else 1.0
    found = np.empty((len(parameters), 3, 3))  # position and both derivatives
    point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
    for i, (u, v) in enumerate(parameters):
        adaptor.D1(float(u), float(v), point, along_u, along_v)
        found[i] = [(p.X(), p.Y(), p.Z()) for p in (point, along_u, along_v)]
    normals = np.cross(found[:, 1], found[:, 2])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return found[:, 0], np.divide(sign * normals, lengths, out=np.zeros_like(normals), where=lengths > 0)


def face_normals(face: Any, points: Array) -> Array:
    """(N, 3) outward normals of a face at (N, 3) points on it; by projection if it isn't analytic."""
    surface = face_surface(face)
    if surface is not None:
        return surface.normals(points)
    geometry = BRep_Tool.Surface_s(face)
    parameters = np.zeros((len(points), 2))
    for i, point in enumerate(points):
        projection = GeomAPI_ProjectPointOnSurf(gp_Pnt(*map(float, point)), geometry)
        parameters[i] = projection.LowerDistanceParameters()
    return evaluate(face, parameters)[1]


def _elementary(adaptor: BRepAdaptor_Surface) -> Surface | None:
    kind = adaptor.GetType()
    if kind == GeomAbs_Plane:
        return _plane(adaptor.Plane())
    if kind == GeomAbs_Cylinder:
        return _cylinder(adaptor.Cylinder())
    if kind == GeomAbs_Cone:
        return _cone(adaptor.Cone())
    if kind == GeomAbs_Sphere:
        return _sphere(adaptor.Sphere())
    if kind == GeomAbs_Torus:
        shape = adaptor.Torus()
        return torus(_xyz(shape.Location()), _xyz(shape.Axis().Direction()), shape.MajorRadius(), shape.MinorRadius())
    return None


def _recognised(face: Any) -> Surface | None:
    """A spline, extruded or revolved face that is a quadric in truth."""
    recognition = ShapeAnalysis_CanonicalRecognition(face)
    for method, empty, convert in (
        ("IsPlane", gp_Pln, _plane),
        ("IsCylinder", gp_Cylinder, _cylinder),
        ("IsCone", gp_Cone, _cone),
        ("IsSphere", gp_Sphere, _sphere),
    ):
        found = empty()
        if getattr(recognition, method)(RECOGNITION_TOLERANCE, found):
            return convert(found)
    return None


def _plane(shape: Any) -> Surface:
    return plane(_xyz(shape.Location()), _xyz(shape.Axis().Direction()))


def _cylinder(shape: Any) -> Surface:
    return cylinder(_xyz(shape.Location()), _xyz(shape.Axis().Direction()), shape.Radius())


def _sphere(shape: Any) -> Surface:
    return sphere(_xyz(shape.Location()), shape.Radius())


def _cone(shape: Any) -> Surface:
    """OCC's half angle may be negative: the cone then narrows along its axis.

    The nappe that holds the reference circle is the face's, save where the reference radius is 0.
    """
    axis, angle = _xyz(shape.Axis().Direction()), shape.SemiAngle()
    if angle < 0:
        axis, angle = -axis, -angle
    return cone(_xyz(shape.Location()), axis, shape.RefRadius(), angle)


def _xyz(thing: Any) -> Array:
    return np.array([thing.X(), thing.Y(), thing.Z()])
