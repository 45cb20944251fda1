"""Objects with a known truth: the real nut, and views of exact solids."""

import json
from pathlib import Path

import cv2
import numpy as np
from brepgaussian.artifacts.views import Views
from brepgaussian.brep.refine.mesh import from_solid
from brepgaussian.brep.refine.parameters import prior_sigmas, update
from brepgaussian.brep.structure import extract
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.geometry.surfaces import cone, cylinder, plane
from poses import look_at

NUT = Path(__file__).parents[3] / "shared/data/abc_nef/00000006"


def abc_views(folder: Path, count: int = 50) -> Views:
    frames = json.loads((folder / "transforms_train.json").read_text())["frames"]
    frames = [frames[i] for i in np.linspace(0, len(frames) - 1, count).round().astype(int)]
    images, poses, intrinsics = [], [], []
    for frame in frames:
        name = Path(frame["file_path"]).name
        images.append(cv2.cvtColor(cv2.imread(str(folder / "train_img" / f"{name}.png"), -1), cv2.COLOR_BGRA2RGBA))
        world_from_cam = np.array(frame["transform_matrix"]) @ np.diag([1.0, -1, -1, 1])
        poses.append(np.linalg.inv(world_from_cam))
        k = np.array(frame["camera_intrinsics"])
        intrinsics.append([k[0, 0], k[1, 1], k[0, 2] + 0.5, k[1, 2] + 0.5])
    rgba = np.array(images)
    rgb = np.where(rgba[..., 3:] > 0, rgba[..., :3], 0).astype(np.uint8)
    cameras = Cameras(np.array(intrinsics), np.array(poses), rgba.shape[2], rgba.shape[1])
    return Views(folder.name, tuple(f["file_path"] for f in frames), rgb, rgba[..., 3].copy(), cameras, np.eye(4))


def nut_solid():
    """The nut of 00000006 in the unit frame, and its surfaces."""
    from build123d import Align, Cone, Cylinder, RegularPolygon, extrude
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
    from OCP.gp import gp_Trsf

    flat, height, bore, size = 2.38125, 1.5875, 1.2573, 2 * 2.74963065701559
    base = (Align.CENTER, Align.CENTER, Align.MIN)
    corner = flat / np.cos(np.pi / 6)
    body = extrude(RegularPolygon(corner, 6, rotation=30), height)
    body = body & Cone(flat + height, flat, height, align=base) - Cylinder(bore, height, align=base)
    transform = gp_Trsf()
    transform.SetValues(1 / size, 0, 0, 0.5, 0, 1 / size, 0, 0.5, 0, 0, 1 / size, 0.5 - height / 2 / size)
    solid = BRepBuilderAPI_Transform(body.solid().wrapped, transform, True).Shape()

    def to_unit(p):
        return (np.asarray(p, float) - [0, 0, height / 2]) / size + 0.5

    surfaces = []
    for k in range(6):
        angle = np.pi / 3 * k
        n = np.array([np.cos(angle), np.sin(angle), 0])
        surfaces.append(plane(to_unit(flat * n), n))
    surfaces.append(plane(to_unit([0, 0, 0]), [0, 0, -1]))
    surfaces.append(plane(to_unit([0, 0, height]), [0, 0, 1]))
    surfaces.append(cone(to_unit([0, 0, height]), [0, 0, -1], flat / size, np.pi / 4))
    surfaces.append(cylinder(to_unit([0, 0, 0]), [0, 0, 1], bore / size, flipped=True))
    return solid, tuple(surfaces)


def perturbed(surfaces, seed: int, angle_deg: float = 0.5, length: float = 0.003):
    """Every local parameter moved by a normal deviate of that size."""
    rng = np.random.default_rng(seed)
    moved = []
    for surface in surfaces:
        sigmas = prior_sigmas(surface.kind, np.radians(angle_deg), length)
        moved.append(update(surface, rng.normal(size=len(sigmas)) * sigmas))
    return tuple(moved)


def start_of(solid, surfaces, seed: int, angle_deg: float = 0.5, length: float = 0.003):
    """Structure and mesh of a solid whose surfaces are perturbed (as an assembly of bad primitives has)."""
    from brepgaussian.brep.refine.descent import move_structure
    from brepgaussian.brep.refine.mesh import follow
    from brepgaussian.brep.refine.refinement import _anchored

    structure, mesh = extract(solid, surfaces), from_solid(solid)
    moved = perturbed(_anchored(structure, mesh, surfaces), seed, angle_deg, length)
    return move_structure(structure, moved), follow(mesh, structure, moved), moved, mesh


def on_triangles(corners, count: int, rng):
    """(count, 3) points spread evenly over triangles (T, 3, 3)."""
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    pick = rng.choice(len(area), count, p=area / area.sum())
    return np.einsum("nk,nki->ni", rng.dirichlet([1, 1, 1], count), corners[pick])


def surface_error(mesh, truth) -> float:
    """Mean distance of a mesh to the true mesh and back (20,000 points each)."""
    import open3d as o3d

    def one_way(a, b):
        points = on_triangles(a.vertices[a.triangles], 20000, np.random.default_rng(0))
        scene = o3d.t.geometry.RaycastingScene()
        scene.add_triangles(
            o3d.core.Tensor(b.vertices.astype(np.float32)), o3d.core.Tensor(b.triangles.astype(np.uint32))
        )
        return float(scene.compute_distance(o3d.core.Tensor(points.astype(np.float32)), nthreads=1).numpy().mean())

    return 0.5 * (one_way(a=mesh, b=truth) + one_way(a=truth, b=mesh))


def surfaces_of(solid):
    """The distinct surfaces of an exact solid."""
    from brepgaussian.brep import occ
    from brepgaussian.geometry.surfaces import sphere, torus
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.gp import gp_Ax3

    def place(position: gp_Ax3):
        return occ.xyz(position.Location()), occ.xyz(position.Direction())

    found = []
    for face in occ.faces(solid):
        shape, kind = BRepAdaptor_Surface(face), occ.surface_kind(face)
        if kind == "plane":
            origin, axis = place(shape.Plane().Position())
            surface = plane(origin, -axis if occ.is_reversed(face) else axis)
        elif kind == "cylinder":
            surface = cylinder(*place(shape.Cylinder().Position()), shape.Cylinder().Radius())
        elif kind == "sphere":
            surface = sphere(place(shape.Sphere().Position())[0], shape.Sphere().Radius())
        elif kind == "torus":
            t = shape.Torus()
            surface = torus(*place(t.Position()), t.MajorRadius(), t.MinorRadius())
        elif kind == "cone":
            origin, axis = place(shape.Cone().Position())
            angle, radius = shape.Cone().SemiAngle(), shape.Cone().RefRadius()
            if radius < 1e-6:
                origin, radius = origin + 0.1 * np.sign(angle) * axis, 0.1 * np.tan(abs(angle))
            surface = cone(origin, axis if angle > 0 else -axis, radius, abs(angle))
        else:
            raise ValueError(kind)
        surface = surface.flip() if kind != "plane" and _is_hole(face, surface) else surface
        if not any(_same(surface, other) for other in found):
            found.append(surface)
    return tuple(found)


def _is_hole(face, surface):
    from brepgaussian.brep import occ

    nodes, triangles = occ.triangles(face)
    if len(triangles) == 0:
        occ.tessellate(face, 1e-3, 0.3)
        nodes, triangles = occ.triangles(face)
    a, b, c = (nodes[triangles[:, k]] for k in range(3))
    return float((np.cross(b - a, c - a) * surface.normals((a + b + c) / 3)).sum()) < 0


def _same(a, b):
    points = a.project(np.random.default_rng(0).uniform(0.3, 0.7, (20, 3)))
    close = a.kind == b.kind and np.abs(b.signed_distance(points)).max() < 1e-7
    return close and (a.normals(points) * b.normals(points)).sum(axis=1).min() > 0.99


def random_surface(kind: str, rng):
    """A surface of one kind in general position in the unit frame."""
    from brepgaussian.geometry.surfaces import Surface, unit

    radius = 0.0 if kind == "plane" else rng.uniform(0.2, 0.4)
    return Surface(
        kind,
        rng.uniform(0.3, 0.7, 3),
        unit(rng.normal(size=3)),
        radius,
        rng.uniform(0.05, 0.15) if kind == "torus" else 0.0,
        rng.uniform(0.2, 1.2) if kind == "cone" else 0.0,
        bool(rng.integers(2)),
    )


def look_at_cameras(count: int, size: int = 400) -> Cameras:
    """Cameras around the unit frame's centre, spread evenly, focal length as ABC-NEF's."""
    k = np.arange(count) + 0.5
    height, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    poses = []
    for z, t in zip(height * 0.9, turn, strict=True):
        eye = 0.5 + 3.4 * np.array([np.sqrt(1 - z * z) * np.cos(t), np.sqrt(1 - z * z) * np.sin(t), z])
        poses.append(look_at(eye))
    focal = 1111.11 * size / 800
    return Cameras(np.tile([focal, focal, size / 2, size / 2], (count, 1)), np.array(poses), size, size)


def unit_solid(part):
    """A build123d solid as an OCP shape in the unit frame."""
    from brepgaussian.views.truth import transformed, unit_from_world

    world = (part.solid() if hasattr(part, "solid") else part).wrapped
    return transformed(world, unit_from_world(world))


def views_of(part, tmp_path, **settings):
    """50 views of 500 px of a build123d part, as the stage `brep` has them: not smoothed."""
    from brepgaussian.artifacts.views import read_views
    from brepgaussian.settings.views import ViewsSettings
    from brepgaussian.views.stage import make_views
    from build123d import export_step

    export_step(part, tmp_path / "part.step")
    files = {"out_views": tmp_path / "views.h5", "out_truth": tmp_path / "truth.h5"}
    options = ViewsSettings(**({"rendered_views": 50, "image_size": 500} | settings))
    make_views(object_name="part", source="step", path=str(tmp_path / "part.step"), settings=options, **files)
    return read_views(files["out_views"]).as_taken


def asked_of(part, views):
    """What the tests of a solid's faces ask of a build123d part: scene, structure, images, poses."""
    from brepgaussian.brep.refine import from_solid
    from brepgaussian.brep.refine.observe import prepare
    from brepgaussian.brep.refine.visibility import Scene
    from brepgaussian.brep.structure import extract
    from brepgaussian.splatting.concave import Images
    from brepgaussian.views.truth import transformed

    solid = transformed(part.wrapped, np.linalg.inv(views.world_from_unit))
    shown, poses = Images.of(views, prepare(views).noise), np.zeros((len(views.cameras), 3))
    return Scene(from_solid(solid)), extract(solid, surfaces_of(solid)), shown, poses
