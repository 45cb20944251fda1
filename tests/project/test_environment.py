"""The conda environment holds what the virtual environment holds."""

import importlib.util
import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]
ENVS = ROOT / "envs"


def test_the_conda_environment_is_made_from_the_locked_requirements():
    spec = importlib.util.spec_from_file_location("conda_environment", ENVS / "conda.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert (ENVS / "environment.yaml").read_text() == module.environment()


def test_the_conda_environment_pins_every_package_and_names_no_other_file():
    found = yaml.safe_load((ENVS / "environment.yaml").read_text())["dependencies"]
    pins = next(entry["pip"] for entry in found if isinstance(entry, dict))
    locked = [s for s in (ENVS / "requirements.txt").read_text().splitlines() if s and not s.startswith("#")]
    assert pins == locked
    assert all("==" in pin for pin in pins)  # Snakemake copies the file away from any other that it would name


def test_python_is_the_one_that_the_project_asks_for():
    found = yaml.safe_load((ENVS / "environment.yaml").read_text())["dependencies"]
    asked = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["requires-python"]
    assert asked.removeprefix(">=") == next(d for d in found if str(d).startswith("python=")).removeprefix("python=")


def test_every_rule_that_runs_a_script_names_the_environment():
    for file in (ROOT / "workflow" / "rules").glob("*.smk"):
        text = file.read_text()
        assert text.count("    script:") == text.count("../../envs/environment.yaml"), file.name
