"""Other methods' files and plain baselines, on results whose scores are known."""

import numpy as np
import pytest
import trimesh
from brepgaussian.artifacts.points import read_points
from brepgaussian.artifacts.truth import read_truth
from brepgaussian.errors import InputError
from brepgaussian.metrics import baselines, external, solid
from brepgaussian.metrics.table import read_rows
from brepgaussian.settings.metrics import MetricsSettings
from plyfile import PlyData, PlyElement

SETTINGS = MetricsSettings(samples=4000)


@pytest.fixture(scope="module")
def files(example, tmp_path_factory):
    return example.write_object(tmp_path_factory.mktemp("plate"))


def score(files, folder, **options):
    objects = {"plate": (files.views, files.truth)}
    external.score_external(
        folder=folder, method="theirs", objects=objects, out_csv=folder / "out.csv", settings=SETTINGS, **options
    )
    row = read_rows(folder / "out.csv")[0]
    assert row["variant"] == "theirs"
    return row


def write_cloud(path, points, labels):
    if path.suffix == ".txt":
        np.savetxt(path, np.column_stack([points, labels]))
    elif path.suffix == ".ply":
        table = np.zeros(len(points), [("x", "f4"), ("y", "f4"), ("z", "f4"), ("label", "i4")])
        table["x"], table["y"], table["z"], table["label"] = *points.T, labels
        PlyData([PlyElement.describe(table, "vertex")]).write(str(path))
    else:
        lines = [f"{x} {y} {z} {n}" for (x, y, z), n in zip(points, labels, strict=True)]
        head = f"VERSION .7\nFIELDS x y z label\nSIZE 4 4 4 4\nTYPE F F F I\nCOUNT 1 1 1 1\nWIDTH {len(points)}\n"
        path.write_text(
            f"{head}HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA ascii\n" + "\n".join(lines)
        )


@pytest.mark.parametrize("ending", ["txt", "ply", "pcd"])
def test_labelled_clouds(files, tmp_path, ending):
    truth = read_truth(files.truth)
    write_cloud(tmp_path / f"plate.{ending}", truth.points, truth.point_face)
    row = score(files, tmp_path)
    assert (row["patch_f1_001"], row["patch_strict_f1_001"]) == (1, 1)
    assert row["surface_cd_exact"] is None


def test_a_step_in_the_world_frame(files, tmp_path):
    (tmp_path / "plate.step").write_bytes(files.step.read_bytes())
    row = score(files, tmp_path, frame="world")
    assert row["topology_match"]
    assert row["surface_cd_exact"] < 5e-5


def test_meshes_closed_open_and_in_groups(files, tmp_path):
    truth = read_truth(files.truth)
    whole = trimesh.Trimesh(truth.mesh_vertices, truth.mesh_triangles, process=False)
    (tmp_path / "closed").mkdir()
    whole.export(tmp_path / "closed" / "plate.stl")
    row = score(files, tmp_path / "closed")
    assert row["closed"]
    assert row["volume_iou"] > 0.999
    assert row["patch_f1_008"] is None
    (tmp_path / "open").mkdir()
    lines = [f"v {x} {y} {z}" for x, y, z in truth.mesh_vertices]
    for face in range(6):  # one of seven is missing
        triangles = truth.mesh_triangles[truth.triangle_face == face] + 1
        lines += [f"o face{face}", *(f"f {a} {b} {c}" for a, b, c in triangles)]
    (tmp_path / "open" / "plate.obj").write_text("\n".join(lines))
    row = score(files, tmp_path / "open")
    assert row["closed"] is False
    assert row["volume_iou"] is None
    assert row["faces"] == 6
    assert row["patch_strict_f1_002"] == pytest.approx(2 * 6 / 13)


def test_missing_damaged_and_ambiguous_files_are_failed_rows(files, tmp_path):
    assert score(files, tmp_path)["status"] == "failed"
    (tmp_path / "plate.step").write_text("nothing")
    row = score(files, tmp_path)
    assert "plate.step" in row["reason"]
    (tmp_path / "plate.obj").write_text("")
    assert "2 files" in score(files, tmp_path)["reason"]
    (tmp_path / "bare.txt").write_text("0 0 0\n1 1 1\n")
    with pytest.raises(InputError, match="without labels"):
        external.score_file(tmp_path / "bare.txt", read_truth(files.truth), np.eye(4), SETTINGS)


def test_baselines_on_perfect_points(files):
    points, truth = read_points(files.points), read_truth(files.truth)
    rows = baselines.score_baselines(points, truth, SETTINGS)
    assert set(rows) == {"region growing", "RANSAC planes", "Poisson mesh"}
    assert rows["region growing"]["patch_strict_f1_002"] == 1  # all edges are sharp
    planes = rows["RANSAC planes"]
    assert planes["patch_recall_008"] >= 6 / 7  # the cylinder is no plane
    assert rows["Poisson mesh"]["surface_cd_exact"] < 5e-3  # round edges, no more
    np.testing.assert_array_equal(*(baselines.ransac_planes(points, seed=3) for _ in range(2)))


def test_transform_of_a_solid_is_undone(example):
    shape = solid.transform(example.drilled_plate(), example.WORLD_FROM_UNIT)
    back = solid.transform(shape, np.linalg.inv(example.WORLD_FROM_UNIT))
    assert solid.check(back).valid
