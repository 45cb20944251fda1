"""Records of failed stages: a small JSON file beside the artifacts, from which `metrics.csv` says why."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from brepgaussian.project.stages import STAGES
from brepgaussian.project.variants import Variants


@dataclass(frozen=True)
class Failure:
    """Why an object has no result."""

    stage: str
    reason: str


def failure_path(results: str | Path, variant: str, object_name: str, stage: str) -> Path:
    """Where a stage records its failure."""
    return Path(results) / variant / object_name / f"{stage}.failed.json"


def record(path: str | Path, failure: Failure) -> None:
    """Write a failure record."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(asdict(failure), indent=1) + "\n", encoding="utf-8")


def find_failure(results: str | Path, variants: Variants, variant: str, object_name: str) -> Failure:
    """The first recorded failure on an object's way, or a note that there is none."""
    for stage in STAGES:
        path = failure_path(results, variants.owner(variant, stage), object_name, stage)
        if path.exists():
            try:
                return Failure(**json.loads(path.read_text(encoding="utf-8")))
            except (OSError, ValueError, TypeError):
                return Failure(stage, f"failed, and its record {path} can't be read")
    return Failure("", "did not finish and recorded no reason: see its logs")
