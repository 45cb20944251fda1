"""All artifacts of one object of known shape, as a perfect run would write them."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from brepgaussian.artifacts.base import Provenance
from brepgaussian.artifacts.brep import Brep, Curve
from brepgaussian.artifacts.masks import Masks
from brepgaussian.artifacts.points import Points
from brepgaussian.artifacts.primitives import Primitive, Primitives
from brepgaussian.artifacts.stage1 import Evidence, Surfels
from brepgaussian.artifacts.stage2 import Stage2
from brepgaussian.artifacts.truth import Truth
from brepgaussian.artifacts.views import Views
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.geometry.kernel import face_surface, faces_of
from brepgaussian.geometry.topology import count_topology, sharp_curves
from brepgaussian.metrics import mesh, solid
from brepgaussian.metrics.sampling import sample_surface
from brepgaussian.metrics.triangulation import triangulate
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.TopAbs import TopAbs_VERTEX
from poses import look_at

WORLD_FROM_UNIT = np.array([[0, -40.0, 0, 5], [40.0, 0, 0, -3], [0, 0, 40.0, 100], [0, 0, 0, 1]])
HALF_SIZE, FOCAL = 48, 150.0  # px; the object fills most of the view
FACE_OF_WALL = 6


def drilled_plate(radius: float = 0.2, height: float = 0.5) -> Any:
    """A plate 1 x 1 x `height` in the unit frame with a hole through it: 7 faces, 14 edges, 8 corners."""
    low = 0.5 - height / 2
    plate = BRepPrimAPI_MakeBox(gp_Pnt(0, 0, low), 1.0, 1.0, height).Shape()
    hole = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(0.5, 0.5, -1), gp_Dir(0, 0, 1)), radius, 3.0).Shape()
    return BRepAlgoAPI_Cut(plate, hole).Shape()


def truth_of(shape: Any, samples: int = 20_000) -> Truth:
    triangles = triangulate(shape, 1e-4)
    surface = sample_surface(triangles, samples, 7)
    counts, curves = count_topology(shape), sharp_curves(shape)
    _, index, _ = mesh.sample_triangles(triangles.vertices, triangles.triangles, samples, 7)
    return Truth(
        points=surface.points,
        normals=surface.normals,
        point_face=triangles.face[index],
        face_types=counts.face_types,
        face_pairs=counts.face_pairs,
        curve_points=curves.points,
        curve_id=curves.curve_id,
        curve_types=curves.types,
        mesh_vertices=triangles.vertices,
        mesh_triangles=triangles.triangles,
        triangle_face=triangles.face,
        edge_count=counts.edge_count,
        vertex_count=counts.vertex_count,
        volume=mesh.volume(triangles.vertices, triangles.triangles),
    )


def points_of(truth: Truth) -> Points:
    """Labelled points without an error: the truth's own, and its curves."""
    xyz = np.concatenate([truth.points, truth.curve_points])
    none = np.full(len(truth.points), -1)
    nowhere = np.full(len(truth.curve_points), -1)
    return Points(
        xyz=xyz.astype(np.float32),
        normals=np.concatenate([truth.normals, np.tile([0.0, 0, 1], (len(nowhere), 1))]).astype(np.float32),
        edge=(np.arange(len(xyz)) >= len(none)).astype(np.float32),
        label=np.concatenate([truth.point_face, nowhere]).astype(np.int32),
        curve=np.concatenate([none, truth.curve_id]).astype(np.int32),
    )


def write_step(shape: Any, path: Path) -> None:
    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_AsIs)
    writer.Write(str(path))


def ring_of_cameras(count: int) -> Cameras:
    """Cameras on a ring around the object, looking at its centre."""
    angles = np.linspace(0.3, 6.0, count)
    eyes = 0.5 + 2.4 * np.column_stack([np.cos(angles) * 0.8, np.sin(angles) * 0.8, np.full(count, 0.6)])
    poses = np.array([look_at(eye) for eye in eyes])
    size = 2 * HALF_SIZE
    return Cameras(np.tile([FOCAL, FOCAL, HALF_SIZE, HALF_SIZE], (count, 1)), poses, size, size)


def render(truth: Truth, cameras: Cameras) -> tuple[np.ndarray, np.ndarray]:
    """Face ids (V, H, W), -1 outside, and grey images (V, H, W, 3) shaded by the world normal."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(truth.mesh_vertices.astype(np.float32), truth.mesh_triangles.astype(np.uint32))
    rows, columns = np.mgrid[0 : cameras.height, 0 : cameras.width]
    pixels = np.column_stack([columns.ravel(), rows.ravel()]) + 0.5
    normals = mesh.normals(truth.mesh_vertices, truth.mesh_triangles)
    ids, images = [], []
    for view in range(len(cameras)):
        origin, directions = cameras.rays(view, pixels)
        rays = np.column_stack([np.tile(origin, (len(pixels), 1)), directions]).astype(np.float32)
        hit = scene.cast_rays(o3d.core.Tensor(rays), nthreads=1)["primitive_ids"].numpy()
        seen = hit != o3d.t.geometry.RaycastingScene.INVALID_ID
        triangle = np.where(seen, hit, 0).astype(int)
        grey = np.where(seen, 130 + 90 * (normals[triangle] @ [0.5, 0.3, 0.8]), 0)
        ids.append(np.where(seen, truth.triangle_face[triangle], -1).reshape(rows.shape))
        images.append(np.repeat(grey.reshape(*rows.shape, 1), 3, axis=2))
    return np.array(ids, np.int16), np.array(images, np.uint8)


@dataclass(frozen=True)
class Files:
    """Paths of one object's artifacts."""

    folder: Path

    def __getattr__(self, name: str) -> Path:
        endings = {"points": "ply", "step": "step", "stage1_ply": "ply"}
        stem = {"step": "brep", "stage1_ply": "stage1"}.get(name, name)
        return self.folder / f"{stem}.{endings.get(name, 'h5')}"


def write_object(folder: Path, result: Any = None, truth_shape: Any = None, views: int = 4) -> Files:
    """Write every artifact; `result` is the shape in `brep.step`, by default the truth itself."""
    truth_shape = truth_shape if truth_shape is not None else drilled_plate()
    result = result if result is not None else truth_shape
    truth, cameras, files = truth_of(truth_shape), ring_of_cameras(views), Files(folder)
    ids, images = render(truth, cameras)
    by = Provenance("plate", "test")
    Views(
        object_name="plate",
        names=tuple(f"{i:02d}.png" for i in range(views)),
        rgb=images,
        alpha=np.where(ids >= 0, 255, 0).astype(np.uint8),
        cameras=cameras,
        world_from_unit=WORLD_FROM_UNIT,
        unit="mm",
    ).write(files.views, by)
    replace(truth, face_ids=ids).write(files.truth, by)
    border = np.zeros(ids.shape, bool)
    border[:, 1:] |= ids[:, 1:] != ids[:, :-1]
    border[:, :, 1:] |= ids[:, :, 1:] != ids[:, :, :-1]
    noise = np.full(views, 0.5, np.float32)
    Masks((border * 255).astype(np.uint8), (ids + 1).astype(np.int16), noise).write(files.masks, by)
    points = points_of(truth)
    points.write(files.points)
    surfels = _surfels(truth)
    surfels.write(files.stage1_ply)
    features = np.ones((len(surfels.centers), 2), np.float32) / np.float32(np.sqrt(2))
    Stage2(features, (ids + 1).astype(np.int16), consistent=True).write(files.stage2, by)
    Evidence(edge_points=truth.curve_points[::4].astype(np.float32)).write(files.stage1, by)
    surfaces = tuple(s for s in map(face_surface, faces_of(truth_shape)) if s is not None)
    Primitives(tuple(Primitive(s, i, np.flatnonzero(points.label == i), 0.0) for i, s in enumerate(surfaces))).write(
        files.primitives, by
    )
    _brep(result, surfaces).write(files.brep, by)
    write_step(solid.transform(result, WORLD_FROM_UNIT), files.step)
    return files


def _surfels(truth: Truth, step: int = 20) -> Surfels:
    centers, normals = truth.points[::step], truth.normals[::step]
    half = normals + np.array([0.0, 0, 1])  # the quaternion that turns z into the normal, by the half way vector
    half[np.linalg.norm(half, axis=1) < 1e-6] = [1, 0, 0]
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    count = len(centers)
    quaternions = np.column_stack([np.zeros(count), half])  # half a turn about it
    grey = np.repeat(0.5 + 0.35 * (normals @ [0.5, 0.3, 0.8])[:, None], 3, axis=1)
    return Surfels(
        centers=centers.astype(np.float32),
        rotations=quaternions.astype(np.float32),
        scales=np.full((count, 2), 0.02, np.float32),
        opacities=np.full(count, 0.9, np.float32),
        colors=grey.astype(np.float32),
        edges=np.zeros(count, np.float32),
    )


def _brep(shape: Any, surfaces: tuple[Any, ...]) -> Brep:
    from brepgaussian.geometry.kernel import sub_shapes
    from OCP.BRep import BRep_Tool
    from OCP.TopoDS import TopoDS

    found = sharp_curves(shape)
    curves = tuple(
        Curve(kind, (0, 1), (0.0, 1.0), found.points[found.curve_id == i]) for i, kind in enumerate(found.types)
    )
    vertices = [BRep_Tool.Pnt_s(TopoDS.Vertex(v)) for v in sub_shapes(shape, TopAbs_VERTEX)]
    report = {
        "rung": "arrangement",
        "fallback": False,
        "silhouette_px": 0.02,
        "mask_iou": 0.9991,
        "accepted": True,
        "gates": {"read_back": True, "patches_explained": 0.98},
    }
    return Brep(surfaces, curves, np.array([(p.X(), p.Y(), p.Z()) for p in vertices]), report)
