"""Both published layouts of ABC-NEF, and its truth."""

from pathlib import Path

import numpy as np
import pytest
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.abc_nef_layout import find_abc_nef, find_truth, has_truth
from sources_support import abc_object, run

NUT = Path(__file__).parents[3] / "shared/data/abc_nef/00000006"


@pytest.mark.parametrize("layout", ["abc_nef", "emap"])
def test_both_layouts_of_abc_nef(bracket, tmp_path, layout):
    folder = abc_object(tmp_path / "data", bracket.views, layout)
    views, _ = run("abc_nef", folder, tmp_path)
    np.testing.assert_allclose(views.cameras.cam_from_unit, bracket.views.cameras.cam_from_unit, atol=1e-9)
    np.testing.assert_allclose(views.cameras.intrinsics, bracket.views.cameras.intrinsics)
    np.testing.assert_array_equal(views.world_from_unit, np.eye(4))
    assert (views.rgb == bracket.views.rgb).all()
    assert (views.edge_maps == bracket.views.alpha).all()
    rows = find_abc_nef(tmp_path / "data")
    assert [(row.name, row.source) for row in rows] == [("00000042", "abc_nef")]
    assert not has_truth("abc_nef", str(folder))


def test_truth_files_may_lie_elsewhere(tmp_path):
    folder = tmp_path / "data" / "7"
    folder.mkdir(parents=True)
    other = tmp_path / "truth" / "7"
    other.mkdir(parents=True)
    assert find_truth(folder, tmp_path / "truth") is None
    (other / "7_x_trimesh_001.obj").touch()
    (other / "7_x_features_001.yml").touch()
    assert find_truth(folder, tmp_path / "truth").mesh.name == "7_x_trimesh_001.obj"
    assert has_truth("abc_nef", str(folder), str(tmp_path / "truth"))
    assert has_truth("part", "cup")
    assert not has_truth("nerf", "folder")


@pytest.mark.shared
@pytest.mark.skipif(not NUT.is_dir(), reason="the published object is not here")
def test_the_published_nut(tmp_path):
    views, truth = run(
        "abc_nef", NUT, tmp_path, settings=ViewsSettings(view_count=8, truth_points=2000), with_truth=True
    )
    covered, seen = views.alpha >= 128, truth.face_ids >= 0
    assert (covered & seen).sum() / (covered | seen).sum() > 0.9999
    assert sorted(truth.face_types) == ["cone"] * 6 + ["cylinder"] + ["plane"] * 8
    assert (truth.edge_count, truth.vertex_count, len(truth.face_pairs)) == (32, 18, 32)
    assert len(truth.curve_types) == 32
    np.testing.assert_allclose(np.linalg.norm(truth.normals, axis=1), 1, atol=1e-6)
