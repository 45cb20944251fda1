"""The real Snakemake on a small part: the whole way, reruns, failures."""

import csv
import hashlib
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
COPIED = ("Snakefile", "workflow", "config", "profiles", "envs")
# small images and few views: this test is about the workflow, not about accuracy
CONFIG = """
objects: objects.tsv
select: []
variants: [full]
results: results
settings:
  views: {image_size: 400, rendered_views: 24}
overlays: {}
"""
OBJECTS = "object\tsource\tpath\ttruth\tgroup\ngood\tpart\tblock_hole\t\t\nbroken\tnerf\tabsent\t\t\n"


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A copy of the workflow with one good and one broken object, run once."""
    folder = tmp_path_factory.mktemp("project")
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, folder / name)
    (folder / "small.yaml").write_text(CONFIG)
    (folder / "objects.tsv").write_text(OBJECTS)
    return folder, snakemake(folder, "results/metrics.csv")


def command(*arguments, config=("small.yaml",)):
    return [sys.executable, "-m", "snakemake", "--cores", "2", *arguments, "--configfile", *config]


def environment():
    found = {**os.environ, "BREPGAUSSIAN_BUILD": str(ROOT / "build")}
    found.pop("PYTHONPATH", None)  # the Snakefile must find its own library
    return found


def snakemake(folder, *arguments, config=("small.yaml",)):
    return subprocess.run(
        command(*arguments, config=config), cwd=folder, env=environment(), capture_output=True, text=True, check=False
    )


def rows(folder):
    with (folder / "results" / "metrics.csv").open() as file:
        return {row["object"]: row for row in csv.DictReader(file)}


def digests(folder):
    found = (folder / "results" / "full" / "good").iterdir()
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in found if p.suffix in (".h5", ".ply", ".step")}


def jobs(folder, *arguments):
    """Rules that a dry run would execute, in the order of the run."""
    done = snakemake(folder, "--dry-run", *arguments)
    assert done.returncode == 0, done.stdout + done.stderr
    lines = (done.stdout + done.stderr).splitlines()
    return [line.split()[1].rstrip(":") for line in lines if line.startswith(("rule ", "localrule "))]


def test_a_good_object_ends_in_a_closed_solid_and_a_broken_one_in_a_row_with_its_reason(project):
    folder, done = project
    table = rows(folder)
    assert table["good"]["status"] == "ok", done.stdout + done.stderr
    assert table["good"]["valid"] == table["good"]["closed"] == "true"
    assert table["good"]["fallback"] == "false"
    assert table["broken"]["status"] == "failed"
    assert "absent" in table["broken"]["reason"]
    assert done.returncode == 1  # like a compiler: what could be made is made, and the failure is told


def test_a_second_run_of_the_good_object_does_nothing(project):
    folder, _ = project
    assert jobs(folder, "results/full/good/metrics.csv") == []


def test_changing_a_library_module_reruns_its_stage_and_what_follows(project):
    folder, _ = project
    module = folder / "workflow" / "brepgaussian" / "primitives" / "stage.py"
    text, before = module.read_text(), module.stat()
    module.write_text(text + "\n# changed\n")
    try:
        assert jobs(folder, "results/full/good/metrics.csv") == ["primitives", "brep", "object_metrics"]
    finally:
        module.write_text(text)
        os.utime(module, ns=(before.st_atime_ns, before.st_mtime_ns))


def test_touching_a_library_module_reruns_its_stage_and_what_follows(project):
    folder, _ = project
    module = folder / "workflow" / "brepgaussian" / "primitives" / "stage.py"
    before = module.stat()
    os.utime(module)
    try:
        assert jobs(folder, "results/full/good/metrics.csv") == ["primitives", "brep", "object_metrics"]
    finally:
        os.utime(module, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert jobs(folder, "results/full/good/metrics.csv") == []


def test_one_stage_of_one_object_can_be_rerun_and_gives_the_same_bytes(project):
    folder, _ = project
    before = digests(folder)
    done = snakemake(folder, "results/full/good/brep.step", "--forcerun", "primitives")
    assert done.returncode == 0, done.stdout + done.stderr
    assert digests(folder) == before


def test_after_a_kill_the_same_command_ends_with_the_same_bytes(project):
    folder, _ = project
    before = digests(folder)
    for name in ("points.ply", "primitives.h5", "brep.step", "brep.glb", "brep.h5", "metrics.csv"):
        (folder / "results" / "full" / "good" / name).unlink()
    log = folder / "logs" / "full" / "good" / "points.log"
    log.unlink()
    target = ("results/full/good/brep.step",)
    running = subprocess.Popen(
        command(*target), cwd=folder, env=environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    while running.poll() is None and not log.exists():
        time.sleep(0.02)
    running.kill()  # Snakemake alone: its job goes on, as after a `kill -9` by hand
    running.wait()
    assert not (folder / "results" / "full" / "good" / "brep.step").exists()
    done = snakemake(folder, *target)
    assert done.returncode == 0, done.stdout + done.stderr
    assert digests(folder) == before


def test_a_misspelt_key_is_named(project):
    folder, _ = project
    (folder / "typo.yaml").write_text("settings: {masks: {sede: 1}}\n")
    done = snakemake(folder, "--dry-run", config=("small.yaml", "typo.yaml"))
    assert done.returncode != 0
    assert "sede" in done.stdout + done.stderr
