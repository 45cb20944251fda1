"""Both published layouts of ABC-NEF through the real Snakemake: a healthy object and a broken one."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from brepgaussian.artifacts.views import read_views

NUT = Path(__file__).parents[3] / "shared" / "data" / "abc_nef" / "00000006"
# few views and a short training: this test is about the data set, not about accuracy
CONFIG = """
objects: ""
select: []
abc_nef: {root: data, tuned: [nut]}
settings:
  views: {view_count: 16, truth_points: 4000}
  stage1: {image_size: 200, iterations: 100, surfels: 4000}
  brep: {refine: false}
"""
pytestmark = [pytest.mark.shared, pytest.mark.skipif(not NUT.is_dir(), reason="the published object is not here")]


def to_emap(source, folder):
    """Write an object of ABC-NEF in EMAP's layout: OpenCV axes, intrinsics a frame, other folders' names."""
    data = json.loads((source / "transforms_train.json").read_text())
    frames = []
    for entry in data["frames"]:
        pose = np.array(entry["transform_matrix"]) @ np.diag([1.0, -1, -1, 1])
        name = entry["file_path"].split("/")[-1] + ".png"
        frames.append({"rgb_path": name, "camtoworld": pose.tolist(), "intrinsics": entry["camera_intrinsics"]})
    folder.mkdir(parents=True)
    (folder / "meta_data.json").write_text(json.dumps({"frames": frames}))
    (folder / "color").symlink_to(source / "train_img")
    (folder / "edge_PidiNet").symlink_to(source / "train")
    for truth in (*source.glob("*.obj"), *source.glob("*.yml")):
        (folder / truth.name).symlink_to(truth)


@pytest.fixture(scope="module")
def ran(new_project):
    project = new_project(CONFIG)
    data = project.folder / "data"
    to_emap(NUT, data / "nut")
    shutil.copytree(NUT, data / "torn")
    image = data / "torn" / "train_img" / "1_colors.png"  # among the 16 views
    image.write_bytes(image.read_bytes()[:2000])
    return project, project.run("results/metrics.csv")


def test_the_healthy_object_is_a_row_and_the_broken_one_says_why(ran):
    project, (status, said) = ran
    rows = {row["object"]: row for row in project.rows()}
    assert rows["nut"]["status"] == "ok", said
    assert rows["nut"]["valid"] == rows["nut"]["closed"] == "true"
    assert float(rows["nut"]["surface_cd_exact"]) < 0.02
    assert rows["torn"]["status"] == "failed"
    assert "1_colors.png" in rows["torn"]["reason"]
    assert status == 1


def test_both_layouts_give_the_same_views(ran):
    project, _ = ran
    (project.folder / "data" / "torn").rename(project.folder / "set_aside")
    (project.folder / "data" / "published").symlink_to(NUT)
    status, said = project.run("results/full/published/views.h5")
    assert status == 0, said
    emap, published = (read_views(project.folder / f"results/full/{name}/views.h5") for name in ("nut", "published"))
    assert sorted(emap.names) == sorted(published.names)
    order = [emap.names.index(name) for name in published.names]
    assert (emap.rgb[order] == published.rgb).all()
    assert (emap.edge_maps[order] == published.edge_maps).all()
    np.testing.assert_allclose(emap.cameras.cam_from_unit[order], published.cameras.cam_from_unit, atol=1e-9)
    np.testing.assert_allclose(emap.cameras.intrinsics[order], published.cameras.intrinsics, atol=1e-9)


def test_an_unknown_root_is_named(ran):
    project, _ = ran
    (project.folder / "wrong.yaml").write_text("abc_nef: {root: absent}\n")
    status, said = project.run("--dry-run", config=("small.yaml", "wrong.yaml"))
    assert status != 0
    assert "absent: is not a folder" in said
