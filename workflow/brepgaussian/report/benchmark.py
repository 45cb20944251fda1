"""The tables under `results/benchmark`: rows of one object from the artifacts of its variants, and their join.

A row's method, noise and detectors are those of the variant whose artifacts it scores, so that nothing is computed
for a benchmark alone, and its seconds and memory are those of the workflow's jobs.
"""

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from brepgaussian.artifacts.base import atomic
from brepgaussian.errors import ArtifactError
from brepgaussian.metrics.benchmarks import total
from brepgaussian.settings.base import build
from brepgaussian.settings.masks import MasksSettings
from brepgaussian.settings.views import ViewsSettings

_DIGITS = 6  # significant digits of a number
Row = Mapping[str, Any]


@dataclass(frozen=True)
class Case:
    """One variant of one object: what a row of a table scores.

    Attributes:
        name, group: of the object.
        variant: the variant's name.
        views, masks: the settings of these stages that differ from the defaults.
        files: paths by artifact's name; benchmarks: Snakemake's benchmark table by stage.
    """

    name: str
    group: str
    variant: str
    views: Mapping[str, Any]
    masks: Mapping[str, Any]
    files: Mapping[str, str]
    benchmarks: Mapping[str, str]

    @property
    def noise(self) -> str:
        """`clean`, `sigma<grey levels>`, `jpeg<quality>`, or both."""
        settings = build(ViewsSettings, dict(self.views), "views")
        sigma = [f"sigma{settings.noise:g}"] if settings.noise else []
        return "+".join([*sigma, *([f"jpeg{settings.jpeg_quality}"] if settings.jpeg_quality else [])]) or "clean"

    @property
    def head(self) -> dict[str, Any]:
        """The columns that say what a row is about."""
        return {"object": self.name, "group": self.group, "noise": self.noise}

    def seconds(self, stage: str) -> float | None:
        """Wall time of a stage's job."""
        return total([self.benchmarks[stage]])[0]


def stage1_rows(cases: Sequence[Case]) -> list[dict[str, Any]]:
    """Surfels of each variant against the truth; the variant is the method."""
    from brepgaussian.splatting.evaluate import evaluate_stage1

    rows = []
    for case in cases:
        seconds, memory = total([case.benchmarks["stage1"]])
        files = [case.files[name] for name in ("stage1.ply", "stage1.h5", "truth.h5")]
        # what was not measured is NaN, which the table shows as an empty field
        cost = [math.nan if value is None else value for value in (seconds, memory)]
        row = evaluate_stage1(files[0], files[1], files[2], case.variant, cost[0], cost[1])
        rows.append({**row, "object": case.name})
    return rows


def masks_rows(cases: Sequence[Case]) -> list[dict[str, Any]]:
    """Masks of each variant as detected and as repaired by stage 2, against the faces that are seen."""
    from brepgaussian.artifacts.masks import read_masks
    from brepgaussian.artifacts.stage2 import read_stage2
    from brepgaussian.artifacts.truth import read_truth
    from brepgaussian.masks.benchmark import COLUMNS, score_views

    rows = []
    for case in cases:
        truth, found = read_truth(case.files["truth.h5"]), read_masks(case.files["masks.h5"])
        if truth.face_ids is None:
            raise ArtifactError("has no face ids", file=case.files["truth.h5"], fix="set views.face_ids: true")
        settings = build(MasksSettings, dict(case.masks), "masks")
        head = {**case.head, "patches": settings.patches}
        raw = {"edges": settings.edges, "repaired": False, "seconds": case.seconds("masks")}
        rows.append(head | raw | score_views(found.edges, found.patches, truth))
        repaired = {"edges": "regions", "repaired": True, "seconds": case.seconds("stage2")}
        rows.append(head | repaired | score_views(None, read_stage2(case.files["stage2.h5"]).patches, truth))
    return [{column: row[column] for column in COLUMNS} for row in rows]


def labels_rows(cases: Sequence[Case]) -> list[dict[str, Any]]:
    """Labelled points of each variant against the truth."""
    from brepgaussian.points.benchmark import benchmark_points

    rows = []
    for case in cases:
        patches = build(MasksSettings, dict(case.masks), "masks").patches
        files = (case.files["points.ply"], case.files["truth.h5"])
        rows.append(benchmark_points(*files, name=case.name, group=case.group, noise=case.noise, patches=patches))
    return rows


def brep_rows(part: str, group: str, plan: Mapping[str, Sequence[Any]]) -> list[dict[str, Any]]:
    """The assembly alone, on damaged clouds with true labels of one bundled part; see `brep_cases`."""
    from brepgaussian.brep.benchmark import run
    from brepgaussian.settings.brep import BrepSettings

    return [{**row, "group": group} for row in run(brep_cases(part, plan), BrepSettings())]


def brep_cases(part: str, plan: Mapping[str, Sequence[Any]]) -> list[Any]:
    """The clouds of a part that the assembly is measured on.

    Args:
        part: the part's name.
        plan: `sigmas`, `wrong_labels`, `damages`, `seeds`: every noise with every share of wrong labels and no
            damage, and every damage at the first of both, for every seed.
    """
    from brepgaussian.brep.benchmark import Case as Cloud

    kinds = [(sigma, wrong, "none") for sigma in plan["sigmas"] for wrong in plan["wrong_labels"]]
    kinds += [(plan["sigmas"][0], plan["wrong_labels"][0], damage) for damage in plan["damages"]]
    return [Cloud(part, *kind, seed) for seed in plan["seeds"] for kind in kinds]


def write_rows(rows: Sequence[Row], out_csv: str | Path) -> None:
    """Write a table; the columns are those of the first row."""
    with atomic(out_csv) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(rows[0])
        writer.writerows([_text(row[name]) for name in rows[0]] for row in rows)


def join(tables: Sequence[str | Path], out_csv: str | Path, failed: Sequence[Row] = ()) -> None:
    """Join the tables of the objects.

    Args:
        tables: tables with the same columns.
        out_csv: the joined table.
        failed: rows of objects without a table, with the columns that are known; the others stay empty.

    Raises:
        ArtifactError: two tables have different columns.
    """
    columns: list[str] = []
    rows: list[dict[str, Any]] = []
    for path in tables:
        with open(path, newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            found = list(reader.fieldnames or ())
            if columns and found != columns:
                raise ArtifactError(f"has other columns than {tables[0]}", file=path, fix="delete it and run again")
            columns = found
            rows += reader
    rows += [{column: row.get(column, "") for column in columns} for row in failed]
    if columns:
        write_rows(rows, out_csv)


def _text(value: Any) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.{_DIGITS}g}" if isinstance(value, float) else " ".join(str(value).split())
