"""The profiles name rules that exist."""

import re
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]


def rules():
    text = "\n".join(file.read_text() for file in (ROOT / "workflow" / "rules").glob("*.smk"))
    return set(re.findall(r"^rule (\w+):", text, re.MULTILINE)) | set(
        re.findall(r"^use rule \w+ as (\w+)", text, re.MULTILINE)
    )


def test_the_cluster_profile_groups_every_stage_of_an_object():
    profile = yaml.safe_load((ROOT / "profiles" / "slurm" / "config.yaml").read_text())
    grouped = {entry.split("=")[0] for entry in profile["groups"]}
    assert grouped <= rules()
    assert set(profile["set-resources"]) <= rules()
    stages = {"views", "views_without_truth", "masks", "stage1", "stage2", "points", "primitives", "brep"}
    assert stages | {"object_metrics", "page"} <= grouped
