"""`metrics.csv`: columns, failures, benchmarks."""

import pytest
from brepgaussian.errors import ArtifactError
from brepgaussian.metrics import benchmarks, table
from brepgaussian.metrics.columns import COLUMNS

DOCUMENTED = """
object variant status reason views seconds peak_mb
patch_precision_008 patch_recall_008 patch_f1_008 patch_f1_002 patch_f1_001
patch_strict_f1_008 patch_strict_f1_002 patch_strict_f1_001
edge_precision_008 edge_recall_008 edge_f1_008 edge_f1_002 edge_f1_001
edge_strict_f1_008 edge_strict_f1_002 edge_strict_f1_001
surface_cd_sum surface_cd_avg surface_cd_exact surface_hd surface_hd99 surface_hd_exact
curve_cd_sum curve_cd_avg curve_hd curve_hd99
silhouette_px mask_iou valid closed solids fallback faces faces_truth edges edges_truth
vertices vertices_truth topology_match volume_iou normal_consistency
""".split()


def test_columns_and_their_order():
    assert list(COLUMNS) == DOCUMENTED


def test_rows_and_failures_are_joined_and_sorted(tmp_path):
    row = {"object": "b", "variant": "full", "status": "ok", "views": 50, "seconds": 61.25, "valid": True}
    table.write_rows([row], tmp_path / "b.csv")
    failure = {"object": "a", "variant": "full", "reason": "stage1: no surfels\nleft"}
    table.collect([(tmp_path / "b.csv", "full")], [failure], tmp_path / "all.csv")
    first, second = table.read_rows(tmp_path / "all.csv")
    assert (first["object"], first["status"], first["reason"]) == ("a", "failed", "stage1: no surfels left")
    assert first["valid"] is None
    assert (second["seconds"], second["valid"], second["views"], second["mask_iou"]) == (61.25, True, 50, None)
    assert (tmp_path / "all.csv").read_text().splitlines()[0] == ",".join(DOCUMENTED)


def test_a_row_that_two_variants_share_stands_once_for_each(tmp_path):
    table.write_rows([{"object": "a", "variant": "full", "status": "ok", "views": 50}], tmp_path / "a.csv")
    table.collect([(tmp_path / "a.csv", "views_50"), (tmp_path / "a.csv", "full")], [], tmp_path / "all.csv")
    rows = table.read_rows(tmp_path / "all.csv")
    assert [(row["variant"], row["views"]) for row in rows] == [("full", 50), ("views_50", 50)]


def test_writing_twice_gives_the_same_bytes(tmp_path):
    row = {"object": "a", "surface_cd_exact": 1 / 3, "curve_hd": float("nan"), "fallback": False}
    table.write_rows([row], tmp_path / "1.csv")
    table.write_rows(table.read_rows(tmp_path / "1.csv"), tmp_path / "2.csv")
    assert (tmp_path / "1.csv").read_bytes() == (tmp_path / "2.csv").read_bytes()


def test_a_foreign_table_is_refused(tmp_path):
    (tmp_path / "x.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ArtifactError, match=r"x\.csv"):
        table.read_rows(tmp_path / "x.csv")
    with pytest.raises(ValueError, match="typo"):
        table.write_rows([{"typo": 1}], tmp_path / "y.csv")


def test_benchmarks_are_summed_and_the_memory_is_the_largest(tmp_path):
    head = "s\th:m:s\tmax_rss\tmax_vms\n"
    (tmp_path / "a.tsv").write_text(head + "10.5\t0:00:10\t800\t1\n")
    (tmp_path / "b.tsv").write_text(head + "2\t0:00:02\tNA\t1\n4\t0:00:04\t1200.5\t1\n")
    assert benchmarks.total([tmp_path / "a.tsv", tmp_path / "b.tsv", tmp_path / "none.tsv"]) == (13.5, 1200.5)
    assert benchmarks.total([]) == (None, None)
