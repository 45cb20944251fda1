"""Triangulation of a solid to a guaranteed distance.

OCC's mesher is slow on doubly curved faces (13 s for a sphere at 2e-5). So it meshes their inside
coarsely, with fine borders, and edges inside a face are split until every midpoint lies within the deflection.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.IMeshTools import IMeshTools_Parameters
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopLoc import TopLoc_Location

from brepgaussian.geometry.kernel import faces_of
from brepgaussian.metrics.mesh import edges_of, subdivide

_BORDER_ANGLE = 0.1  # rad between neighbouring segments of a border
_INTERIOR_ANGLE = 0.5  # rad; only a start, splitting does the rest
_INTERIOR_FACTOR = 100  # deflection inside faces before splitting, in units of the final one
_MOST_ROUNDS = 12  # each round quarters the deviation
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Triangulation:
    """Triangles of a solid with the face and the surface parameters behind them.

    Attributes:
        vertices: (K, 3); uv: (K, 2) parameters on the vertex's face (vertices are not shared by faces).
        triangles: (T, 3) int32, outward; face: (T,) int32 index in `faces`.
        faces: the OCC faces.
    """

    vertices: Array
    uv: Array
    triangles: NDArray[np.int32]
    face: NDArray[np.int32]
    faces: tuple[Any, ...]


def triangulate(shape: Any, deflection: float) -> Triangulation:
    """Triangulate a shape within `deflection` of its surface; borders of neighbouring faces coincide."""
    BRepTools.Clean_s(shape)
    BRepMesh_IncrementalMesh(shape, _parameters(deflection))
    faces = tuple(faces_of(shape))
    vertices, uvs, triangles, owner = [np.zeros((0, 3))], [np.zeros((0, 2))], [np.zeros((0, 3), np.int32)], []
    start = 0
    for index, face in enumerate(faces):
        mesh = _face_mesh(face)
        if mesh is None:
            continue  # a face that cannot be meshed has no samples; `valid` and the distances show it
        positions, uv, corners = _split(face, *mesh, deflection)
        vertices.append(positions)
        uvs.append(uv)
        triangles.append((corners[:, ::-1] if face.Orientation() == TopAbs_REVERSED else corners) + start)
        owner.append(np.full(len(corners), index, np.int32))
        start += len(positions)
    return Triangulation(
        np.concatenate(vertices),
        np.concatenate(uvs),
        np.concatenate(triangles).astype(np.int32),
        np.concatenate([*owner, np.zeros(0, np.int32)]),
        faces,
    )


def _parameters(deflection: float) -> Any:
    parameters = IMeshTools_Parameters()
    parameters.Deflection, parameters.Angle = deflection, _BORDER_ANGLE
    parameters.DeflectionInterior, parameters.AngleInterior = deflection * _INTERIOR_FACTOR, _INTERIOR_ANGLE
    parameters.InParallel = False
    return parameters


def _face_mesh(face: Any) -> tuple[Array, Array, NDArray[np.int32]] | None:
    """OCC's positions, parameters and triangles of a face."""
    location = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, location)
    if mesh is None:
        return None
    placed, nodes = location.Transformation(), range(1, mesh.NbNodes() + 1)
    positions = np.array([_xyz(mesh.Node(i).Transformed(placed)) for i in nodes])
    uv = np.array([(p.X(), p.Y()) for p in map(mesh.UVNode, nodes)])
    corners = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)], np.int32) - 1
    return positions, uv, corners


def _split(
    face: Any, positions: Array, uv: Array, triangles: NDArray[np.int32], deflection: float
) -> tuple[Array, Array, NDArray[np.int32]]:
    """Split edges inside a face until each midpoint lies within `deflection` of the surface."""
    surface = BRepAdaptor_Surface(face, True)
    settled = np.zeros((0, 2), np.int32)  # edges known to be near enough
    for _ in range(_MOST_ROUNDS):
        edges, sides, uses = edges_of(triangles)
        asked = np.flatnonzero((uses == 2) & ~_contained(edges, settled))
        middle = uv[edges[asked]].mean(axis=1)
        exact = np.array([_xyz(surface.Value(u, v)) for u, v in middle]).reshape(-1, 3)
        far = np.linalg.norm(exact - positions[edges[asked]].mean(axis=1), axis=1) > deflection
        if not far.any():
            break
        settled = np.concatenate([settled, edges[asked[~far]]])
        new = np.full(len(edges), -1, np.int32)
        new[asked[far]] = len(positions) + np.arange(np.count_nonzero(far))
        positions, uv = np.concatenate([positions, exact[far]]), np.concatenate([uv, middle[far]])
        triangles = subdivide(triangles, new[sides])
    return positions, uv, triangles


def _contained(edges: NDArray[np.int32], known: NDArray[np.int32]) -> NDArray[np.bool_]:
    """(E,) whether each of (E, 2) edges is among the known ones."""
    asked, there = (pairs[:, 0].astype(np.int64) << 32 | pairs[:, 1] for pairs in (edges, known))
    return np.isin(asked, there)


def _xyz(point: Any) -> tuple[float, float, float]:
    return point.X(), point.Y(), point.Z()
