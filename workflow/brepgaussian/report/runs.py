"""How many objects ran, how long, with how much memory."""

from collections.abc import Sequence

import numpy as np

from brepgaussian.report.formats import Cell, Column, Table
from brepgaussian.report.summary import Row, failures, of_variant, variants_where

_CAPTION = (
    "Runs: objects and failures of each variant; seconds of all stages of an object, rendering included (a stage that "
    "variants share counts in each), and the largest memory of one stage."
)


def runs_table(rows: Sequence[Row]) -> Table | None:
    """A line a variant."""
    lines: list[tuple[Cell, ...]] = []
    for variant in variants_where(rows, lambda name: True):
        own = of_variant(rows, variant)
        seconds, memory = _values(own, "seconds"), _values(own, "peak_mb")
        total = sum(seconds) if seconds else None
        spread = (float(np.median(seconds)), max(seconds)) if seconds else (None, None)
        lines.append((variant, len(own), failures(own), total, *spread, max(memory) if memory else None))
    heads = ("variant", "objects", "failed", "s in all", "s median", "s most", "MB most")
    names = ("variant", "objects", "failed", "seconds_total", "seconds_median", "seconds_max", "peak_mb_max")
    columns = tuple(Column(head, name, head, digits=0) for head, name in zip(heads, names, strict=True))
    return Table("runs", _CAPTION, columns, tuple(lines)) if lines else None


def summary_line(rows: Sequence[Row]) -> str:
    """The same on one line, over all variants, for a log."""
    failed, seconds, memory = failures(rows), _values(rows, "seconds"), _values(rows, "peak_mb")
    text = f"{len(rows)} row(s): {len(rows) - failed} ok, {failed} failed"
    if seconds:
        text += f"; {sum(seconds) / 60:.1f} min of work, median {np.median(seconds):.0f} s, most {max(seconds):.0f} s"
    return text + (f"; peak memory {max(memory):.0f} MB" if memory else "")


def _values(rows: Sequence[Row], column: str) -> list[float]:
    return [float(row[column]) for row in rows if row[column] is not None]
