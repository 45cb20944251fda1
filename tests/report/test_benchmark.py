"""The benchmarks' tables: what a row is about, scores from artifacts, joins."""

import csv

import pytest
from brepgaussian.errors import ArtifactError
from brepgaussian.report import benchmark
from brepgaussian.report.benchmark import Case


def case(folder, variant="full", views=None, masks=None, **files):
    times = folder / "job.tsv"
    times.write_text("s\tmax_rss\n12.5\t640\n")
    names = dict.fromkeys(("stage1", "masks", "stage2"), str(times))
    return Case("plate", "holdout", variant, views or {}, masks or {}, {n: str(p) for n, p in files.items()}, names)


def read(path):
    with path.open() as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize(
    ("views", "noise"),
    [
        ({}, "clean"),
        ({"view_count": 20}, "clean"),
        ({"noise": 2}, "sigma2"),
        ({"noise": 2.5, "jpeg_quality": 85}, "sigma2.5+jpeg85"),
    ],
)
def test_noise_is_named_by_the_settings(tmp_path, views, noise):
    assert case(tmp_path, views=views).noise == noise


def test_rows_are_scored_from_artifacts(made, tmp_path):
    files = made.files
    one = case(
        tmp_path,
        "hull",
        {"noise": 5},
        {"patches": "truth"},
        **{"stage1.ply": files.stage1_ply, "stage1.h5": files.stage1, "truth.h5": files.truth},
        **{"points.ply": files.points},
    )
    (stage1,), (labels,) = benchmark.stage1_rows([one]), benchmark.labels_rows([one])
    assert (stage1["object"], stage1["method"]) == ("plate", "hull")
    assert (stage1["seconds"], stage1["peak_mb"]) == (12.5, 640)
    head = ("object", "group", "noise", "patches", "patch_f1_008")
    assert [labels[name] for name in head] == ["plate", "holdout", "sigma5", "truth", 1.0]


def test_masks_are_scored_as_detected_and_as_repaired(made, tmp_path):
    files = made.files
    one = case(tmp_path, **{"masks.h5": files.masks, "stage2.h5": files.stage2, "truth.h5": files.truth})
    detected, repaired = benchmark.masks_rows([one])
    assert (detected["edges"], detected["repaired"], detected["seconds"]) == ("classical", False, 12.5)
    assert (repaired["edges"], repaired["repaired"]) == ("regions", True)
    for row in (detected, repaired):  # the example's masks are the true faces
        assert (row["patches"], row["noise"], row["region_f_50"], row["region_f_75"]) == ("classical", "clean", 1, 1)


def test_the_assembly_is_measured_with_and_without_damage():
    plan = {"sigmas": [0.002, 0.0], "wrong_labels": [0.0], "damages": ["half_patch"], "seeds": [0]}
    cases = benchmark.brep_cases("block_hole", plan)
    assert [(c.sigma, c.wrong_labels, c.damage) for c in cases] == [
        (0.002, 0.0, "none"),
        (0.0, 0.0, "none"),
        (0.002, 0.0, "half_patch"),
    ]


def test_tables_are_joined_and_failed_objects_stand_in_them(tmp_path):
    benchmark.write_rows([{"object": "a", "group": "tuned", "f": 1 / 3, "closed": True}], tmp_path / "a.csv")
    benchmark.write_rows([{"object": "b", "group": "tuned", "f": None, "closed": False}], tmp_path / "b.csv")
    failed = [{"object": "c", "group": "holdout", "reason": "no surfels"}]
    benchmark.join([tmp_path / "a.csv", tmp_path / "b.csv"], tmp_path / "all.csv", failed)
    assert [list(row.values()) for row in read(tmp_path / "all.csv")] == [
        ["a", "tuned", "0.333333", "true"],
        ["b", "tuned", "", "false"],
        ["c", "holdout", "", ""],
    ]
    benchmark.write_rows([{"object": "d"}], tmp_path / "d.csv")
    with pytest.raises(ArtifactError, match=r"d\.csv"):
        benchmark.join([tmp_path / "a.csv", tmp_path / "d.csv"], tmp_path / "all.csv")


def test_without_any_table_none_is_made(tmp_path):
    benchmark.join([], tmp_path / "all.csv", [{"object": "c"}])
    assert not (tmp_path / "all.csv").exists()
