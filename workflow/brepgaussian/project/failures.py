"""Records of failed stages: a small JSON file beside the artifacts, from which `metrics.csv` says why."""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from brepgaussian.project.stages import upstream
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


def find_failure(results: str | Path, variants: Variants, variant: str, object_name: str) -> Failure | None:
    """The first recorded failure on an object's way, if there is one."""
    for stage in upstream("metrics"):
        path = failure_path(results, variants.owner(variant, stage), object_name, stage)
        if path.exists():
            try:
                return Failure(**json.loads(path.read_text(encoding="utf-8")))
            except (OSError, ValueError, TypeError):
                return Failure(stage, f"{stage}: failed, and its record {path} can't be read")
    return None


def unfinished(
    results: str | Path, variants: Variants, wanted: Iterable[str], objects: Iterable[str]
) -> tuple[list[tuple[Path, str]], list[dict[str, str]]]:
    """What there is after a run with failures.

    Returns:
        A row of metrics and the variant that it stands for, of each object and variant that has one (variants that
        change nothing share a row), and for each other object and variant a mapping with `object`, `variant`
        and `reason`.
    """
    rows: list[tuple[Path, str]] = []
    failed: list[dict[str, str]] = []
    for variant in wanted:
        folder = Path(results) / variants.owner(variant, "metrics")
        for name in objects:
            row = folder / name / "metrics.csv"
            failure = find_failure(results, variants, variant, name)
            if row.exists() and not failure:
                rows.append((row, variant))
            else:
                reason = failure.reason if failure else "did not finish and recorded no reason: see its logs"
                failed.append({"object": name, "variant": variant, "reason": reason})
    return rows, failed
