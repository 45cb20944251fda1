"""Tables: averages by hand, failures, groups, formats, the paper's numbers."""

import csv
import io
import re
from pathlib import Path

import pytest
from brepgaussian.metrics.columns import COLUMNS
from brepgaussian.metrics.table import write_rows
from brepgaussian.report import formats, paper, summary, tables
from brepgaussian.report.export import export_point2cad
from brepgaussian.report.runs import summary_line

GROUPS = {"a": "tuned", "b": "tuned", "c": "holdout"}
TEX = Path(__file__).parents[3] / "shared/paper/brepgaussian.tex"


def row(name, variant="full", **values):
    found = dict.fromkeys(COLUMNS) | {"object": name, "variant": variant, "status": "ok", "reason": "", "views": 50.0}
    scores = {c: 0.8 for c in COLUMNS if "f1" in c or "precision" in c or "recall" in c}
    lengths = {c: 0.02 for c in COLUMNS if c.startswith(("surface_", "curve_"))}
    flags = {"valid": True, "closed": True, "fallback": False, "topology_match": True, "volume_iou": 0.9}
    return found | scores | lengths | flags | {"faces": 7.0, "faces_truth": 7.0, "seconds": 60.0} | values


def failed(name, variant="full"):
    nothing = dict.fromkeys(COLUMNS)
    return nothing | {"object": name, "variant": variant, "status": "failed", "reason": "stage1: no surfels"}


def lines_of(table):
    return list(csv.DictReader(io.StringIO(formats.as_csv(table))))


def test_failures_count_as_zero_in_scores_and_not_in_distances():
    rows = [row("a", patch_f1_008=0.9), failed("b")]
    assert summary.average(rows, "patch_f1_008") == summary.Average(0.45, 0.45, 2)
    assert summary.average(rows, "topology_match").mean == 0.5
    assert summary.average(rows, "surface_cd_exact") == summary.Average(0.02, 0.02, 1)
    assert summary.average([row("a", curve_hd=None)], "curve_hd") is None


def test_groups_are_kept_apart_with_mean_median_and_counts():
    rows = [row("a", patch_f1_008=1.0), row("b", patch_f1_008=0.5), failed("c")]
    patches = next(t for t in tables.all_tables(rows, GROUPS) if t.name == "1_patches")
    ours = [line for line in lines_of(patches) if line["method"].startswith("ours")]
    found = {(x["objects are"], x["method"]): (x["objects"], x["failed"], float(x["patch_f1_008"])) for x in ours}
    assert found == {
        ("holdout", "ours, mean"): ("1", "1", 0.0),
        ("holdout", "ours, median"): ("1", "1", 0.0),
        ("tuned", "ours, mean"): ("2", "0", 0.75),
        ("tuned", "ours, median"): ("2", "0", 0.75),
    }
    theirs = next(line for line in lines_of(patches) if line["method"] == paper.OURS)
    assert theirs["objects are"] == "paper's objects"
    assert float(theirs["patch_f1_008"]) == 0.904
    assert theirs["patch_strict_f1_002"] == ""


def test_variants_are_compared_on_common_objects_only():
    rows = [
        row("a"),
        row("b", patch_f1_008=0.1),
        row("a", "no_edge", patch_f1_008=0.6),
        row("a", "views_20", views=20.0),
    ]
    found = {t.name: lines_of(t) for t in tables.all_tables(rows, GROUPS)}
    means = {x["method"]: x for x in found["4_ablation_patches"]}
    assert means["full, mean"]["objects"] == "1"
    assert means["full, mean"]["objects are"] == "tuned"
    assert float(means["full, mean"]["patch_f1_008"]) == 0.8
    assert float(means["w/o edge segmentation, mean"]["patch_f1_008"]) == 0.6
    assert [x["views"] for x in found["6_views"]] == ["20", "50"]
    assert "5_masks" not in found


def test_variants_and_numbers_of_views_keep_the_groups_apart():
    rows = [row(n, v, views=k) for n in "abc" for v, k in (("full", 50.0), ("views_20", 20.0), ("no_edge", 50.0))]
    found = {t.name: lines_of(t) for t in tables.all_tables(rows, GROUPS)}
    ours = [x for x in found["4_ablation_patches"] if x["objects are"] != "paper's objects"]
    assert [(x["objects are"], x["objects"]) for x in ours] == [("holdout", "1")] * 4 + [("tuned", "2")] * 4
    assert [(x["objects are"], x["views"]) for x in found["6_views"]] == [
        ("holdout", "20"),
        ("holdout", "50"),
        ("tuned", "20"),
        ("tuned", "50"),
    ]


def test_any_variant_of_the_masks_stands_in_their_table():
    rows = [row("a", v) for v in ("full", "masks_truth", "masks_mine")]
    masks = next(t for t in tables.all_tables(rows, GROUPS) if t.name == "5_masks")
    ours = [x["method"] for x in lines_of(masks) if x["objects are"] == "tuned"]
    assert ours[::2] == ["masks_mine, mean", "truth masks, mean", "automatic masks, mean"]


def test_runs_are_counted():
    rows = [row("a", seconds=60.0, peak_mb=800.0), row("b", seconds=90.0, peak_mb=900.0), failed("c")]
    runs = next(t for t in tables.all_tables(rows, GROUPS) if t.name == "runs")
    assert list(lines_of(runs)[0].values()) == ["full", "3", "1", "150", "75", "90", "900"]
    assert summary_line(rows) == (
        "3 row(s): 2 ok, 1 failed; 2.5 min of work, median 75 s, most 90 s; peak memory 900 MB"
    )


def test_other_methods_stand_beside_ours_where_they_have_scores():
    scores = dict.fromkeys(c for c in COLUMNS if c.startswith(("surface_", "curve_", "edge_")))
    other = row("a", "region growing", **scores, patch_f1_008=0.3)
    found = {t.name: lines_of(t) for t in tables.all_tables([row("a")], GROUPS, [other])}
    means = {x["method"]: x for x in found["1_patches"] if x["objects are"] == "tuned"}
    assert float(means["region growing, mean"]["patch_f1_008"]) == 0.3
    assert {x["method"] for x in found["2_edges"] if x["objects are"] == "tuned"} == {"ours, mean", "ours, median"}


def test_all_files_are_written(tmp_path):
    rows = [row("a"), row("a", "views_20", views=20.0), row("a", "masks_truth"), failed("b")]
    write_rows(rows, tmp_path / "metrics.csv")
    tables.make_tables(tmp_path / "metrics.csv", GROUPS, tmp_path / "tables")
    names = {p.name for p in (tmp_path / "tables").iterdir()}
    stems = "1_patches 2_edges 3_cad 3_solids 5_masks 6_views objects runs failures".split()
    assert names == {f"{s}.{e}" for s in stems for e in ("csv", "md", "tex")} | {"views.png", "readme.md"}
    latex = (tmp_path / "tables" / "3_cad.tex").read_text()
    body = [line for line in latex.splitlines() if line.endswith(r"\\")]
    columns = re.search(r"\\begin\{tabular\}\{([lr]+)\}", latex).group(1)
    assert {line.count("&") for line in body} == {len(columns) - 1}
    assert not re.search(r"(?<!\\)[_%#]", re.sub(r"\$[^$]*\$|\\label\{.*\}", "", latex))
    markdown = (tmp_path / "tables" / "failures.md").read_text()
    assert "| b | full | stage1: no surfels |" in markdown
    assert "failed" in (tmp_path / "tables" / "readme.md").read_text()


def test_distances_are_scaled_in_print_and_plain_in_csv():
    cad = next(t for t in tables.all_tables([row("a")], GROUPS) if t.name == "3_cad")
    assert float(lines_of(cad)[-1]["surface_cd_exact"]) == 0.02
    assert "| ours, mean | images | 1 | 0 | 2.000 |" in formats.as_markdown(cad)
    assert "4.900" in formats.as_markdown(cad)  # the paper's D_c, in 1e-2


@pytest.mark.shared
@pytest.mark.skipif(not TEX.exists(), reason="needs the paper")
def test_the_papers_numbers_are_the_papers():
    text = TEX.read_text()
    printed = set(re.findall(r"\d+\.\d+", text))
    scales = {"surface_cd": 100, "curve_cd": 100, "surface_hd": 10, "curve_hd": 10}
    groups = (paper.PATCHES, paper.EDGES, paper.CAD, paper.ABLATION_PATCHES, paper.ABLATION_CAD, paper.MASKS)
    for entry in (row for group in groups for row in group):
        for name, value in entry.values.items():
            shown = value * scales.get(name, 1)
            assert {f"{shown:.2f}", f"{shown:.3f}", f"{shown:.4f}"} & printed, (entry, name)


def test_point2cad_export(made, tmp_path):
    from brepgaussian.artifacts.points import read_points

    export_point2cad(made.files.points, tmp_path / "points.txt")
    lines = (tmp_path / "points.txt").read_text().splitlines()
    points = read_points(made.files.points)
    assert len(lines) == (points.label >= 0).sum()
    assert sorted({line.split()[3] for line in lines}) == [str(i) for i in range(7)]
    assert float(lines[0].split()[0]) == pytest.approx(points.xyz[0, 0], abs=1e-6)
