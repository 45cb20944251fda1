"""STEP files, samples and topology of solids of known shape."""

import numpy as np
import pytest
from brepgaussian.errors import ArtifactError
from brepgaussian.metrics import mesh, sampling, solid, topology, triangulation
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.TopAbs import TopAbs_FACE
from OCP.TopExp import TopExp_Explorer

DEFLECTION = 1e-4


def drilled_box():
    """A unit box with a hole of radius .2 through it: 7 faces, 14 sharp edges."""
    hole = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(0.5, 0.5, -1), gp_Dir(0, 0, 1)), 0.2, 3.0).Shape()
    return BRepAlgoAPI_Cut(BRepPrimAPI_MakeBox(1.0, 1.0, 1.0).Shape(), hole).Shape()


def write_step(shape, path):
    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_AsIs)
    writer.Write(str(path))


def distance(name, p):
    x, y, z = p.T
    if name == "sphere":
        return np.linalg.norm(p, axis=1) - 0.5
    if name == "torus":
        return np.hypot(np.hypot(x, y) - 0.35, z) - 0.15
    side = np.hypot(x, y) - (0.3 if name == "cylinder" else 0.5 - 0.25 * z)
    return np.where(np.minimum(np.abs(z), np.abs(z - 1)) < 1e-9, np.maximum(side, 0), side)


SHAPES = {
    "sphere": (lambda: BRepPrimAPI_MakeSphere(0.5).Shape(), np.pi),
    "torus": (lambda: BRepPrimAPI_MakeTorus(0.35, 0.15).Shape(), 4 * np.pi**2 * 0.35 * 0.15),
    "cylinder": (lambda: BRepPrimAPI_MakeCylinder(0.3, 1.0).Shape(), 2 * np.pi * 0.3 * 1.3),
    "cone": (
        lambda: BRepPrimAPI_MakeCone(0.5, 0.25, 1.0).Shape(),
        np.pi * (0.75 * np.hypot(1, 0.25) + 0.25 + 0.0625),
    ),
}


@pytest.mark.parametrize("name", SHAPES)
def test_samples_lie_on_the_surface_and_triangles_within_the_deflection(name):
    make, area = SHAPES[name]
    triangles = triangulation.triangulate(make(), DEFLECTION)
    surface = sampling.sample_surface(triangles, 5000, 0)
    assert np.abs(distance(name, surface.points)).max() < 1e-9
    assert surface.closest(surface.points)[0].max() < 1.5 * DEFLECTION
    assert mesh.areas(triangles.vertices, triangles.triangles).sum() == pytest.approx(area, rel=1e-3)
    centre = surface.points.mean(axis=0)
    outward = (surface.normals * (surface.points - centre)).sum(axis=1) > 0
    assert outward.mean() == (1 if name != "torus" else pytest.approx(0.7, abs=0.3))
    assert mesh.volume(triangles.vertices, triangles.triangles) > 0


def test_triangles_of_neighbouring_faces_share_their_border():
    triangles = triangulation.triangulate(drilled_box(), DEFLECTION)
    _, welded = np.unique(np.round(triangles.vertices, 9), axis=0, return_inverse=True)
    _, _, uses = mesh.edges_of(welded.reshape(-1)[triangles.triangles].astype(np.int32))
    assert (uses == 2).all()
    volume = mesh.volume(triangles.vertices, triangles.triangles)
    assert volume == pytest.approx(1 - np.pi * 0.04, abs=1e-4)


def test_normals_of_a_hole_point_out_of_the_material():
    surface = sampling.sample_surface(triangulation.triangulate(drilled_box(), DEFLECTION), 4000, 0)
    radial = surface.points[:, :2] - 0.5
    wall = np.abs(np.linalg.norm(radial, axis=1) - 0.2) < 1e-6
    inside = wall & (surface.points[:, 2] > 0.01) & (surface.points[:, 2] < 0.99)
    np.testing.assert_allclose(surface.normals[inside, :2], -radial[inside] / 0.2, atol=1e-6)


@pytest.mark.parametrize("scale", [1.0, 40.0])
def test_step_is_brought_back_into_the_unit_frame(tmp_path, scale):
    shape = drilled_box()
    rotation = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    world_from_unit = np.eye(4)
    world_from_unit[:3, :3], world_from_unit[:3, 3] = scale * rotation, [5, -3, 100]
    write_step(solid.transform(shape, world_from_unit), tmp_path / "brep.step")
    back = solid.read_step(tmp_path / "brep.step", world_from_unit)
    triangles = triangulation.triangulate(back, DEFLECTION)
    np.testing.assert_allclose(triangles.vertices.min(axis=0), 0, atol=1e-7)
    np.testing.assert_allclose(triangles.vertices.max(axis=0), 1, atol=1e-7)
    assert solid.check(back) == solid.Health(valid=True, closed=True, solids=1)


def test_a_step_in_metres_has_the_units_of_its_views(tmp_path):
    from brepgaussian.brep import occ, publish

    world_from_unit = np.diag([0.04, 0.04, 0.04, 1.0])  # 40 mm, in metres
    publish.write_step(occ.to_bytes(drilled_box()), world_from_unit, "m", "part", str(tmp_path / "brep.step"))
    triangles = triangulation.triangulate(solid.read_step(tmp_path / "brep.step", world_from_unit, "m"), DEFLECTION)
    np.testing.assert_allclose(triangles.vertices.max(axis=0), 1, atol=1e-7)


def test_a_damaged_or_missing_step_is_named(tmp_path):
    (tmp_path / "bad.step").write_text("no step")
    for name in ("bad.step", "none.step"):
        with pytest.raises(ArtifactError, match=name):
            solid.read_step(tmp_path / name, np.eye(4))


def test_an_open_shell_is_not_closed():
    face = TopExp_Explorer(drilled_box(), TopAbs_FACE).Current()
    assert solid.check(face) == solid.Health(valid=True, closed=False, solids=0)


def test_topology_match_is_blind_to_names_and_sees_types_and_neighbours():
    types = ["plane"] * 6 + ["cylinder"]
    box = [(0, 2), (0, 3), (0, 4), (0, 5), (1, 2), (1, 3), (1, 4), (1, 5), (2, 4), (2, 5), (3, 4), (3, 5)]
    through = np.array([*box, (0, 6), (1, 6)])
    order = np.random.default_rng(0).permutation(7)
    renamed = [types[i] for i in np.argsort(order)]
    assert topology.topology_match(types, through, renamed, order[through])
    assert not topology.topology_match(types, through, types, np.array([*box, (0, 6), (2, 6)]))  # round a corner
    assert not topology.topology_match(types, through, [*types[:6], "cone"], through)
    assert not topology.topology_match(types, through, types[:6], np.array(box))
