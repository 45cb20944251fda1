"""The stage from paths to paths, with the real kernel in its own process."""

import numpy as np
import pytest
import trimesh
from brepgaussian.artifacts.brep import read_brep
from brepgaussian.artifacts.primitives import Primitives
from brepgaussian.brep import occ, publish, solid
from brepgaussian.brep.stage import build_brep
from brepgaussian.errors import StageError
from brepgaussian.settings.brep import BrepSettings

SETTINGS = BrepSettings(refine=False)  # the silhouettes here are rough: binary, ten views of 200 px


def test_block_with_hole(paths, kit):
    known = kit.block_with_hole(sigma=0.003)
    world = np.diag([60.0, 60.0, 60.0, 1.0])
    world[:3, 3] = [-7, 3, 100]
    files = paths(known, kit.make_views(kit.box_corners(np.array([1, 0.8, 0.5])), world))
    build_brep(**files, settings=SETTINGS)
    read = publish._read(files["out_step"])
    assert solid.is_valid(read)
    assert solid.free_edges(read) == 0
    assert sorted(occ.surface_kind(f) for f in occ.faces(read)) == ["cylinder"] + ["plane"] * 6
    assert occ.volume(read) == pytest.approx(known.volume * 60**3, rel=1e-6)
    np.testing.assert_allclose(occ.bounds(read)[0], 60 * np.array([0, 0.1, 0.25]) + [-7, 3, 100], atol=1e-4)
    brep = read_brep(files["out_h5"])
    assert brep.report["rung"] == "support"
    assert brep.report["fallback"] is False
    assert len(brep.curves) == 14
    assert len(brep.corners) == 8
    assert sum(c.kind == "circle" for c in brep.curves) == 2
    mesh = trimesh.load(files["out_glb"], force="mesh")
    mesh.merge_vertices()
    assert mesh.volume == pytest.approx(known.volume * 60**3, rel=5e-3)


def test_bytes_are_the_same_again(paths, kit):
    files = paths(kit.block_with_hole(sigma=0.004, seed=3))
    outputs = [files[k] for k in ("out_step", "out_glb", "out_h5")]
    build_brep(**files, settings=SETTINGS)
    first = [f.read_bytes() for f in outputs]
    build_brep(**files, settings=SETTINGS, threads=2)
    assert first == [f.read_bytes() for f in outputs]


@pytest.mark.parametrize("keep", [3])
def test_too_few_primitives_fall_back_to_a_closed_polyhedron(paths, kit, keep):
    known = kit.block_with_hole(sigma=0.003, radius=0.0)
    items = known.primitives.items[:keep]
    files = paths(type(known)(known.points, Primitives(items), known.volume, 6))
    build_brep(**files, settings=SETTINGS)
    brep = read_brep(files["out_h5"])
    assert brep.report["fallback"] is True
    read = publish._read(files["out_step"])
    assert solid.is_valid(read)
    assert solid.free_edges(read) == 0
    assert occ.volume(read) == pytest.approx(known.volume, rel=0.1)


def test_metres(paths, kit):
    known = kit.block_with_hole(radius=0.0)
    world = np.diag([0.5, 0.5, 0.5, 1.0])
    files = paths(known, kit.make_views(kit.box_corners(np.array([1, 0.8, 0.5])), world, unit="m"))
    build_brep(**files, settings=SETTINGS)
    assert occ.volume(publish._read(files["out_step"])) == pytest.approx(known.volume * 500**3, rel=1e-6)


def test_refinement_is_the_default_and_does_no_harm(paths, kit):
    known = kit.block_with_hole(sigma=0.003, radius=0.0)
    files = paths(known)
    build_brep(**files, settings=BrepSettings())
    brep = read_brep(files["out_h5"])
    assert "refined" in brep.report
    assert brep.report["silhouette_px"] is not None
    assert brep.report["volume"] == pytest.approx(known.volume, rel=0.03)


def test_flat_points_are_a_clear_error(paths, kit):
    rng = np.random.default_rng(0)
    xyz = np.column_stack([rng.random((500, 2)), np.full(500, 0.5)])
    known = kit.block_with_hole()
    points = kit.make_points(xyz, np.tile([0, 0, 1.0], (500, 1)), np.zeros(500))
    views = kit.make_views(np.zeros((0, 3, 3)))
    files = paths(type(known)(points, Primitives(()), 0, 0), views)
    with pytest.raises(StageError, match="span no volume"):
        build_brep(**files, settings=SETTINGS)
    assert not files["out_step"].exists()
