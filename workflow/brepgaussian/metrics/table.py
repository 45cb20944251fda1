"""Reading and writing of `metrics.csv`: one row an object and variant, failed ones included."""

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from brepgaussian.artifacts.base import atomic
from brepgaussian.errors import ArtifactError
from brepgaussian.metrics.columns import COLUMNS, FAILED, FLAGS

_DIGITS = 6  # significant digits of a number


def write_rows(rows: Sequence[Mapping[str, Any]], path: str | Path) -> None:
    """Write rows with all columns in the documented order; what a row lacks is left empty."""
    for row in rows:
        unknown = sorted(set(row) - set(COLUMNS))
        if unknown:
            raise ValueError(f"not a column of metrics.csv: {unknown[0]}")
    with atomic(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows([_text(row.get(name)) for name in COLUMNS] for row in rows)


def read_rows(path: str | Path) -> list[dict[str, Any]]:
    """Read a `metrics.csv`: numbers as float, flags as bool, empty fields as None."""
    try:
        with open(path, newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            if tuple(reader.fieldnames or ()) != COLUMNS:
                raise ArtifactError(
                    "does not have the columns of metrics.csv", file=path, fix="rerun the rule that makes it"
                )
            return [{name: _value(name, text) for name, text in row.items()} for row in reader]
    except OSError as error:
        raise ArtifactError(f"cannot be read ({error.strerror})", file=path, fix="rerun the metrics rule") from error


def collect(rows: Sequence[tuple[str | Path, str]], failures: Sequence[Mapping[str, Any]], out_csv: str | Path) -> None:
    """Join one-row tables and failed objects into one `metrics.csv`, sorted by object and variant.

    Args:
        rows: files written by `score_object`, each with the variant that it stands for: a variant that changes
            nothing shares the file of another.
        failures: mappings with `object`, `variant`, `reason` and, where known, other columns.
        out_csv: the joined table.
    """
    found = [{**row, "variant": variant} for path, variant in rows for row in read_rows(path)]
    found += [{**failure, "status": FAILED} for failure in failures]
    found.sort(key=lambda row: (str(row["object"]), str(row["variant"])))
    write_rows(found, out_csv)


def _text(value: Any) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return str(int(value)) if value.is_integer() and abs(value) < 10**_DIGITS else f"{value:.{_DIGITS}g}"
    return " ".join(str(value).split())  # a reason on one line


_TEXT_COLUMNS = ("object", "variant", "status", "reason")


def _value(name: str, text: str) -> Any:
    if name in _TEXT_COLUMNS:
        return text
    if text == "":
        return None
    return text == "true" if name in FLAGS else float(text)
