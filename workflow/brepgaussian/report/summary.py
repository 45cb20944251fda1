"""Means and medians over objects, failures counted."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from brepgaussian.metrics.columns import FAILED, FLAGS

Row = Mapping[str, Any]
# What a failed object counts as: nothing found, nothing covered. It has no distance, so it counts in none.
_ZERO_IF_FAILED = ("precision", "recall", "f1", "iou")
FULL = "full"


@dataclass(frozen=True)
class Average:
    """Mean and median of one column over the objects that have a value (failed ones as 0 where so defined)."""

    mean: float
    median: float
    count: int


def average(rows: Sequence[Row], column: str) -> Average | None:
    """Average a column; None if no object has a value."""
    values = [value for row in rows if (value := counted(row, column)) is not None]
    if not values:
        return None
    return Average(float(np.mean(values)), float(np.median(values)), len(values))


def counted(row: Row, column: str) -> float | None:
    """A row's value in averages; a failed object counts as 0 in scores and flags and not in distances."""
    if row["status"] == FAILED:
        return 0.0 if column in FLAGS or any(part in column for part in _ZERO_IF_FAILED) else None
    value = row[column]
    return None if value is None else float(value)


def failures(rows: Sequence[Row]) -> int:
    """Number of failed objects."""
    return sum(row["status"] == FAILED for row in rows)


def of_variant(rows: Sequence[Row], variant: str) -> list[Row]:
    """Rows of one variant."""
    return [row for row in rows if row["variant"] == variant]


def by_group(rows: Sequence[Row], groups: Mapping[str, str]) -> dict[str, list[Row]]:
    """Rows by their object's group, in the groups' alphabetical order; objects without a group come last."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(groups.get(row["object"], "no group"), []).append(row)
    return dict(sorted(found.items(), key=lambda item: (item[0] == "no group", item[0])))


def common_objects(rows: Sequence[Row], variants: Sequence[str]) -> list[Row]:
    """Rows of these variants for the objects that all of them ran (a failed run is a run)."""
    sets = [{row["object"] for row in of_variant(rows, variant)} for variant in variants]
    common = set.intersection(*sets) if sets else set()
    return [row for row in rows if row["variant"] in variants and row["object"] in common]


def variants_where(rows: Sequence[Row], wanted: Callable[[str], bool]) -> list[str]:
    """Names of the variants that occur and are wanted, `full` last."""
    names = sorted({row["variant"] for row in rows if wanted(row["variant"])})
    return [*(n for n in names if n != FULL), *([FULL] if FULL in names else [])]
