"""A copy of the workflow in a folder of its own, and the real Snakemake in it."""

import csv
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
COPIED = ("Snakefile", "workflow", "config", "profiles", "envs")


class Project:
    """The workflow in `folder`, run with the config `small.yaml` there."""

    def __init__(self, folder, config):
        self.folder = folder
        for name in COPIED:
            source = ROOT / name
            if source.is_dir():
                shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(source, folder / name)
        (folder / "small.yaml").write_text(config)

    def popen(self, *arguments, config=("small.yaml",), **options):
        """Start Snakemake."""
        command = [sys.executable, "-m", "snakemake", "--cores", "2", *arguments, "--configfile", *config]
        environment = {**os.environ, "BREPGAUSSIAN_BUILD": str(ROOT / "build")}
        environment.pop("PYTHONPATH", None)  # the Snakefile must find its own library
        return subprocess.Popen(command, cwd=self.folder, env=environment, text=True, **options)

    def run(self, *arguments, config=("small.yaml",)):
        """Run Snakemake to its end; gives its status and all that it said."""
        process = self.popen(*arguments, config=config, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        said, _ = process.communicate()
        return process.returncode, said

    def dry_run(self, *arguments, config=("small.yaml",)):
        """Rules that a run would execute, in its order, and all that Snakemake said."""
        status, said = self.run("--dry-run", *arguments, config=config)
        assert status == 0, said
        return re.findall(r"^(?:local)?rule (\w+):", said, re.MULTILINE), said

    def jobs(self, *arguments, **options):
        """Rules that a run would execute, in the order of the run."""
        return self.dry_run(*arguments, **options)[0]

    def counts(self, *arguments, **options):
        """How often a run would execute each rule."""
        return dict(Counter(self.jobs(*arguments, **options)))

    def rows(self, table="results/metrics.csv"):
        """Rows of a table."""
        with (self.folder / table).open() as file:
            return list(csv.DictReader(file))


@pytest.fixture(scope="session")
def new_project(tmp_path_factory):
    """Makes projects."""
    return lambda config: Project(tmp_path_factory.mktemp("project"), config)
