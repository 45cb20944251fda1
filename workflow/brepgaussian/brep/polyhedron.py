"""The last rung: a closed polyhedral solid, whatever the input. Published as a fallback, never as a success."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Builder
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakePolygon, BRepBuilderAPI_Sewing
from OCP.gp import gp_Pnt
from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain
from OCP.TopAbs import TopAbs_SHELL
from OCP.TopoDS import TopoDS, TopoDS_Solid
from scipy.spatial import ConvexHull, QhullError, cKDTree

from brepgaussian.brep import occ
from brepgaussian.brep.gate import integrity
from brepgaussian.brep.silhouettes import Silhouettes
from brepgaussian.errors import StageError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_GRID = 72  # voxels along the longest side of the hull: a few of its faces' size
_RIM = 2  # empty voxels around it
_POISSON_DEPTH = 6
_SEW = 1e-7
_FLAT = np.radians(1.0)  # neighbouring triangles closer than this are one face
_THINNEST = 1e-4  # standard deviation across the flattest direction, unit frame
_OWN_DISTANCE = 0.03  # a surface that leaves the points by more than this does not describe them


def polyhedral(xyz: Array, normals: Array | None, silhouettes: Silhouettes | None, triangles: int) -> tuple[bytes, str]:
    """A closed polyhedral solid (OCC bytes) and what it was made of: the best of Poisson, visual hull, convex hull.

    Raises:
        StageError: the points span no volume.
    """
    sources: list[tuple[str, Callable[[], tuple[Array, Indices]]]] = []
    if normals is not None:
        sources.append(("poisson", lambda: _poisson(xyz, normals)))
    if silhouettes is not None:
        sources.append(("visual_hull", lambda: _visual_hull(silhouettes)))
    found: list[tuple[float, str, bytes]] = []
    for name, make in sources:
        try:
            vertices, faces = simplify(*make(), triangles)
            shape = solid_of_mesh(vertices, faces)
            if not integrity(shape):
                found.append((_misfit(xyz, vertices[faces], silhouettes), name, occ.to_bytes(shape)))
        except (StageError, RuntimeError, ValueError, IndexError):
            continue
    if found:
        _, name, data = min(found, key=lambda f: f[0])
        return data, name
    flat = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)[-1] / np.sqrt(len(xyz)) < _THINNEST
    try:
        hull = None if flat else ConvexHull(xyz, qhull_options="QJ Pp")
    except (QhullError, ValueError):
        hull = None
    if hull is None:
        raise StageError(
            "the points span no volume, so no solid can be made", fix="check that the object is seen from all sides"
        )
    vertices, faces = simplify(xyz, _outwards(xyz, hull), triangles, convex=True)
    shape = solid_of_mesh(vertices, faces)
    faults = integrity(shape)
    if faults:
        raise StageError(f"even the convex hull of the points gives no valid solid ({faults[0]})")
    return occ.to_bytes(shape), "convex_hull"


def _misfit(xyz: Array, corners: Array, silhouettes: Silhouettes | None) -> float:
    """Mean distance of the points to a mesh's samples, plus what its silhouettes miss."""
    from brepgaussian.brep.cells import SAMPLE_SPACING, sample_triangles

    samples = sample_triangles(corners, SAMPLE_SPACING)[0]
    distance = float(np.mean(np.minimum(cKDTree(samples).query(xyz)[0], 1.0)))
    stray = float(np.mean(cKDTree(xyz).query(samples)[0] > _OWN_DISTANCE))
    return distance + 0.1 * stray + (0.0 if silhouettes is None else 1 - silhouettes.iou(corners))


def _poisson(xyz: Array, normals: Array) -> tuple[Array, Indices]:
    """Screened Poisson reconstruction of oriented points."""
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=xyz, v_normals_matrix=normals))
    meshes.generate_surface_reconstruction_screened_poisson(depth=_POISSON_DEPTH, preclean=True, threads=1)
    mesh = meshes.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix().astype(np.int64)


def _visual_hull(silhouettes: Silhouettes) -> tuple[Array, Indices]:
    """Marching cubes on the voxels that no camera sees through."""
    from skimage.measure import marching_cubes

    axis = (np.arange(_GRID) + 0.5) / _GRID
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    solid = np.pad(~silhouettes.empty(grid, clear=0.5).reshape((_GRID,) * 3), _RIM)
    if not solid.any():
        raise StageError("the silhouettes have no common volume")
    vertices, faces, _, _ = marching_cubes(solid.astype(np.float32), 0.5)
    return (vertices - _RIM + 0.5) / _GRID, faces.astype(np.int64)[:, ::-1]


def simplify(vertices: Array, faces: Indices, count: int, convex: bool = False) -> tuple[Array, Indices]:
    """The largest closed part of a mesh with about `count` triangles.

    Raises:
        StageError: it cannot be closed.
    """
    import pymeshlab
    import trimesh

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
    meshes.meshing_remove_unreferenced_vertices()
    if not convex:
        meshes.apply_coord_taubin_smoothing()
    for target in (count, 2 * count, 4 * count):
        if len(faces) > target:
            meshes.meshing_decimation_quadric_edge_collapse(
                targetfacenum=target, preservetopology=True, preservenormal=True, optimalplacement=not convex,
                planarquadric=True, qualitythr=0.3,
            )  # fmt: skip
        mesh = meshes.current_mesh()
        result = trimesh.Trimesh(mesh.vertex_matrix(), mesh.face_matrix(), process=True)
        parts = [p for p in result.split(only_watertight=True) if abs(p.volume) > 0]
        if parts:
            best = max(parts, key=lambda p: abs(p.volume))
            closed = np.asarray(best.faces, np.int64)
            return np.asarray(best.vertices, float), closed if best.volume > 0 else closed[:, ::-1]
        meshes.clear()
        meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
    raise StageError("the mesh cannot be closed")


def _outwards(xyz: Array, hull: ConvexHull) -> Indices:
    """The hull's triangles wound so that normals point out."""
    faces = hull.simplices.astype(np.int64)
    corners = xyz[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ij,ij->i", normal, corners[:, 0] - xyz.mean(axis=0)) < 0
    faces[inward] = faces[inward][:, ::-1]
    return faces


def solid_of_mesh(vertices: Array, faces: Indices) -> Any:
    """Sew a closed triangle mesh into a solid and merge coplanar faces.

    Raises:
        StageError: it does not close.
    """
    sewing = BRepBuilderAPI_Sewing(_SEW)
    points = [gp_Pnt(*map(float, v)) for v in vertices]
    for a, b, c in faces:
        wire = BRepBuilderAPI_MakePolygon(points[a], points[b], points[c], True)
        if not wire.IsDone():
            raise StageError("a triangle without area")
        face = BRepBuilderAPI_MakeFace(wire.Wire(), True)
        if face.IsDone():
            sewing.Add(face.Face())
    sewing.Perform()
    shells = occ.shapes(sewing.SewedShape(), TopAbs_SHELL)
    if len(shells) != 1:
        raise StageError(f"the polyhedron falls into {len(shells)} shells")
    shape, builder = TopoDS_Solid(), BRep_Builder()
    builder.MakeSolid(shape)
    builder.Add(shape, shells[0])
    if occ.volume(shape) < 0:
        shape = TopoDS.Solid(shape.Reversed())
    unify = ShapeUpgrade_UnifySameDomain(shape, True, True, False)
    unify.SetAngularTolerance(_FLAT)
    unify.Build()
    merged = occ.solids(unify.Shape())
    return merged[0] if len(merged) == 1 and not integrity(merged[0]) else shape
