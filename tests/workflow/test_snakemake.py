"""The real Snakemake on a small part: the whole way, reruns, kills, failures, tables, the report."""

import hashlib
import os
import subprocess
import time

import pytest

# small images and few views: this test is about the workflow, not about accuracy
CONFIG = """
objects: objects.tsv
select: []
variants: [full]
results: results
settings:
  views: {image_size: 400, rendered_views: 24}
overlays: {}
benchmark: {stage1: [full], masks: [full], labels: [full]}
"""
OBJECTS = "object\tsource\tpath\ttruth\tgroup\ngood\tpart\tblock_hole\t\t\nbroken\tnerf\tabsent\t\t\n"
ROW = "results/full/good/metrics.csv"


@pytest.fixture(scope="module")
def ran(new_project):
    """A project with one good and one broken object, whose tables were asked for once: status and what was said."""
    project = new_project(CONFIG)
    (project.folder / "objects.tsv").write_text(OBJECTS)
    return project, project.run("results/tables", "results/benchmark/labels.csv")


@pytest.fixture
def project(ran):
    return ran[0]


def digests(project):
    found = (project.folder / "results" / "full" / "good").iterdir()
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in found if p.suffix in (".h5", ".ply", ".step")}


def test_a_good_object_ends_in_a_closed_solid_and_a_broken_one_in_a_row_with_its_reason(ran):
    project, (status, said) = ran
    rows = {row["object"]: row for row in project.rows()}
    assert rows["good"]["status"] == "ok", said
    assert rows["good"]["valid"] == rows["good"]["closed"] == "true"
    assert rows["good"]["fallback"] == "false"
    assert rows["broken"]["status"] == "failed"
    assert "absent" in rows["broken"]["reason"]
    assert "2 row(s): 1 ok, 1 failed" in said
    assert "broken: absent does not exist" in said  # before anything ran
    assert status == 1  # like a compiler: what could be made is made, and the failure is told


def test_tables_are_made_in_spite_of_a_broken_object_with_baselines_beside_ours(project):
    rows = project.rows("results/tables/1_patches.csv")
    ours = [row for row in rows if row["objects are"] == "holdout"]
    assert [row["method"] for row in ours[::2]] == ["ours, mean", "region growing, mean", "RANSAC planes, mean"]
    assert (ours[0]["objects"], ours[0]["failed"]) == ("2", "1")
    runs = {row["variant"]: row for row in project.rows("results/tables/runs.csv")}
    assert (runs["full"]["objects"], runs["full"]["failed"]) == ("2", "1")
    assert float(runs["full"]["seconds_max"]) > 0
    assert project.rows("results/benchmark/labels.csv")[0]["object"] == "good"


def test_a_second_run_of_the_good_object_does_nothing(project):
    assert project.jobs(ROW) == []


def test_changing_a_library_module_reruns_its_stage_and_what_follows(project):
    module = project.folder / "workflow" / "brepgaussian" / "primitives" / "stage.py"
    text, before = module.read_text(), module.stat()
    module.write_text(text + "\n# changed\n")
    try:
        assert project.jobs(ROW) == ["points", "primitives", "brep", "object_metrics"]  # which points uses
    finally:
        module.write_text(text)
        os.utime(module, ns=(before.st_atime_ns, before.st_mtime_ns))


def test_touching_a_library_module_reruns_its_stage_and_what_follows(project):
    module = project.folder / "workflow" / "brepgaussian" / "primitives" / "stage.py"
    before = module.stat()
    os.utime(module)
    try:
        assert project.jobs(ROW) == ["points", "primitives", "brep", "object_metrics"]  # which points uses
    finally:
        os.utime(module, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert project.jobs(ROW) == []


def test_one_stage_of_one_object_can_be_rerun_and_gives_the_same_bytes(project):
    before = digests(project)
    status, said = project.run("results/full/good/brep.step", "--forcerun", "primitives")
    assert status == 0, said
    assert digests(project) == before


def test_after_a_kill_the_same_command_ends_with_the_same_bytes(project):
    before = digests(project)
    folder = project.folder / "results" / "full" / "good"
    for name in ("points.ply", "primitives.h5", "brep.step", "brep.glb", "brep.h5", "metrics.csv"):
        (folder / name).unlink()
    log = project.folder / "logs" / "full" / "good" / "points.log"
    log.unlink()
    target = "results/full/good/brep.step"
    running = project.popen(target, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while running.poll() is None and not log.exists():
        time.sleep(0.02)
    running.kill()  # Snakemake alone: its job goes on, as after a `kill -9` by hand
    running.wait()
    assert not (folder / "brep.step").exists()
    status, said = project.run(target)
    assert status == 0, said
    assert digests(project) == before


def test_snakemakes_report_holds_the_tables_and_pictures(project):
    wanted = ["results/full/good/view.html", "results/full/good/point2cad.txt"]
    status, said = project.run(*wanted)
    assert status == 0, said
    line = (project.folder / wanted[1]).read_text().splitlines()[0].split()
    assert len(line) == 4
    status, said = project.run(*wanted, "--report", "report.html")
    assert status == 0, said
    text = (project.folder / "report.html").read_text()
    assert "view.html" in text
    assert "sheet.png" in text


def test_a_misspelt_key_is_named(project):
    (project.folder / "typo.yaml").write_text("settings: {masks: {sede: 1}}\n")
    status, said = project.run("--dry-run", config=("small.yaml", "typo.yaml"))
    assert status != 0
    assert "sede" in said
