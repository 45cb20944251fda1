"""What Snakemake would run: variants share what they do not change, benchmarks share with the tables."""

import re

import pytest

CONFIG = """
select: [hex_nut]
variants: [full, no_two_stage, no_triplet, no_edge, no_densification, no_splitting, masks_truth,
           views_20, views_30, views_40]
benchmark: {objects: [hex_nut, cup], stage1: [hull, full], masks: [full, sigma2], labels: [full, masks_truth, sigma2],
            sigmas: [0.002], wrong_labels: [0], damages: [], seeds: [0]}
"""
STAGES = ("views", "masks", "stage1", "stage2", "points", "primitives", "brep", "object_metrics")


@pytest.fixture(scope="module")
def project(new_project):
    return new_project(CONFIG)


def stages(counts):
    return [counts.get(stage, 0) for stage in STAGES]


def test_no_stage_is_computed_twice_for_the_same_settings(project):
    """Ten variants; each count is `full` and the variants that change this stage or one upstream."""
    rules, said = project.dry_run("results/metrics.csv")
    counts = {rule: rules.count(rule) for rule in rules}
    views = 1 + 3
    masks = views + 1  # truth masks
    stage1 = masks + 3  # one stage, no edges, no splitting
    stage2 = stage1 + 1  # no triplets
    points = stage2 + 1  # centres only
    assert stages(counts) == [views, masks, stage1, stage2, points, points, points, points]
    outputs = re.findall(r"^    output: (.*)$", said, re.MULTILINE)
    assert len(outputs) == len(set(outputs)) == len(rules)


def test_a_variant_that_changes_nothing_costs_nothing(project):
    (project.folder / "same.yaml").write_text("variants: [full, same]\noverlays: {same: {stage1: {edge_loss: true}}}\n")
    counts = project.counts("results/metrics.csv", config=("small.yaml", "same.yaml"))
    assert stages(counts) == [1] * len(STAGES)


@pytest.mark.parametrize(
    ("variant", "changed"),
    [
        ("no_two_stage", STAGES[2:]),
        ("no_edge", STAGES[2:]),
        ("no_splitting", STAGES[2:]),
        ("no_triplet", STAGES[3:]),
        ("no_densification", STAGES[4:]),
        ("masks_truth", STAGES[1:]),
        ("views_30", STAGES),
    ],
)
def test_each_ablation_changes_its_stage_and_what_follows(project, variant, changed):
    _, said = project.dry_run(f"results/{variant}/hex_nut/metrics.csv")
    made = re.findall(rf"logs/{variant}/hex_nut/(\w+)\.log", said)
    assert made == [stage.removeprefix("object_") for stage in changed]


def test_benchmarks_share_the_artifacts_of_the_variants(project):
    counts = project.counts(*(f"results/benchmark/{t}.csv" for t in ("stage1", "masks", "labels", "brep")))
    assert stages(counts) == [4, 6, 8, 6, 6, 0, 0, 0]  # two objects: clean and noisy views, truth masks, the hull
    made = {rule: counts[rule] for rule in counts if rule.startswith("benchmark")}
    assert made == dict.fromkeys((f"benchmark_{t}" for t in ("stage1", "masks", "labels", "brep")), 2) | {
        "benchmark_table": 4
    }


def test_an_object_need_not_be_selected_to_be_made_by_name(project):
    assert project.counts("results/full/knob/masks.h5") == {"views": 1, "masks": 1}


def test_other_methods_are_scored_for_the_tables(project):
    (project.folder / "others.yaml").write_text("variants: [full]\nexternal: [{method: HPNet, folder: hpnet}]\n")
    counts = project.counts("results/tables", config=("small.yaml", "others.yaml"))
    assert (counts["external"], counts["baselines"], counts["tables"]) == (1, 1, 1)


def test_an_unknown_object_of_a_benchmark_is_named(project):
    (project.folder / "wrong.yaml").write_text("benchmark: {objects: [absent]}\n")
    status, said = project.run("--dry-run", config=("small.yaml", "wrong.yaml"))
    assert status != 0
    assert "benchmark.objects names 'absent'" in said


def test_a_variant_keeps_the_settings_of_full_that_it_does_not_change(project):
    (project.folder / "base.yaml").write_text(
        "variants: [a, b]\n"
        "settings: {stage1: {iterations: 90}}\n"
        "overlays: {a: {stage1: {edge_loss: false}}, b: {stage1: {edge_loss: false, iterations: 90}}}\n"
    )
    counts = project.counts("results/metrics.csv", config=("small.yaml", "base.yaml"))
    assert stages(counts) == [1] * len(STAGES)
