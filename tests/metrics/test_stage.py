"""The stage on objects of known shape: perfect, shrunk, without a hole, without a truth."""

import numpy as np
import pytest
from brepgaussian.metrics.stage import score_object
from brepgaussian.metrics.table import read_rows
from brepgaussian.settings.metrics import MetricsSettings


def score(files, out, truth=True, **options):
    score_object(
        object_name="plate",
        variant="full",
        views_path=files.views,
        truth_path=files.truth if truth else None,
        points_path=files.points,
        step_path=files.step,
        brep_h5=files.brep,
        out_csv=out,
        settings=MetricsSettings(),
        **options,
    )
    return read_rows(out)[0]


@pytest.fixture(scope="module")
def files(example, tmp_path_factory):
    return example.write_object(tmp_path_factory.mktemp("plate"))


def test_a_perfect_result_has_perfect_scores(files, tmp_path):
    (tmp_path / "b.tsv").write_text("s\tmax_rss\n61\t900\n")
    row = score(files, tmp_path / "row.csv", benchmark_files=[tmp_path / "b.tsv"])
    assert (row["status"], row["views"], row["seconds"], row["peak_mb"]) == ("ok", 4, 61, 900)
    for kind in ("patch", "edge"):
        scores = [value for name, value in row.items() if name.startswith(f"{kind}_")]
        assert scores == [1.0] * 8
    assert row["surface_cd_exact"] < 3e-5
    assert row["surface_hd_exact"] < 2e-4
    assert row["surface_cd_sum"] == pytest.approx(2 * row["surface_cd_avg"], rel=1e-5)
    area = 2 * (1 - np.pi * 0.04) + 2 + np.pi * 0.2
    assert row["surface_cd_sum"] == pytest.approx(np.sqrt(area / 20_000), rel=0.05)  # the floor of samples
    assert row["curve_cd_sum"] <= 0.005 / 2  # samples every .005 may lie out of step with the truth's
    assert row["curve_hd"] < 0.005
    assert [row[k] for k in ("valid", "closed", "topology_match", "fallback")] == [True, True, True, False]
    assert [row[k] for k in ("faces", "faces_truth", "edges", "edges_truth")] == [7, 7, 14, 14]
    assert [row[k] for k in ("vertices", "vertices_truth", "solids")] == [8, 8, 1]
    assert row["volume_iou"] > 0.9999
    assert row["normal_consistency"] > 0.9999
    assert (row["silhouette_px"], row["mask_iou"]) == (0.02, 0.9991)


def test_without_a_truth_its_columns_are_empty(files, tmp_path):
    row = score(files, tmp_path / "row.csv", truth=False)
    assert row["valid"]
    assert row["faces"] == 7
    filled = {name for name, value in row.items() if value not in (None, "")}
    assert not any(name.startswith(("patch", "edge_", "surface", "curve")) or "truth" in name for name in filled)
    assert row["topology_match"] is None


def test_threads_and_reruns_change_no_byte(files, tmp_path):
    for name, threads in (("1.csv", 1), ("2.csv", 2)):
        score(files, tmp_path / name, threads=threads)
    assert (tmp_path / "1.csv").read_bytes() == (tmp_path / "2.csv").read_bytes()


def test_a_plate_without_its_hole(example, tmp_path):
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.gp import gp_Pnt

    blind = BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0.25), 1.0, 1.0, 0.5).Shape()
    row = score(example.write_object(tmp_path, result=blind), tmp_path / "row.csv")
    assert row["topology_match"] is False
    assert (row["faces"], row["edges"]) == (6, 12)
    assert row["volume_iou"] == pytest.approx(1 - np.pi * 0.04, abs=2e-3)
    assert row["surface_hd_exact"] == pytest.approx(0.25, abs=1e-3)  # the wall's middle is .25 from both lids
    wall, rest = np.pi * 0.2, 4 - 2 * np.pi * 0.04
    missed = np.pi * 0.4 * 0.125 * 0.5  # the wall's mean distance to the nearer lid, times its area
    invented = 2 * np.pi * (0.2**3 / 3)  # the lids over the hole are up to .2 from its rim
    expected = (missed / (wall + rest) + invented / 4) / 2
    assert row["surface_cd_exact"] == pytest.approx(expected, rel=0.03)


def test_a_result_with_a_wider_hole_and_the_same_topology(example, tmp_path):
    row = score(example.write_object(tmp_path, result=example.drilled_plate(radius=0.21)), tmp_path / "row.csv")
    assert row["topology_match"] is True
    assert row["surface_hd_exact"] == pytest.approx(0.01, abs=2e-4)
    assert row["curve_hd"] == pytest.approx(0.01, abs=1e-3)
    assert row["volume_iou"] == pytest.approx((1 - np.pi * 0.21**2) / (1 - np.pi * 0.04), abs=1e-3)
