"""Time and memory of an object from Snakemake's benchmark tables."""

import csv
from collections.abc import Sequence
from pathlib import Path


def total(benchmark_files: Sequence[str | Path]) -> tuple[float | None, float | None]:
    """Sum of seconds and maximum of MB over benchmark tables (columns `s` and `max_rss`).

    A file that does not exist or a value that was not measured is left out; None if nothing was
    measured. Several lines in one file are repeats of one job: their mean counts.
    """
    seconds, memory = [], []
    for path in benchmark_files:
        if not Path(path).exists():
            continue
        with open(path, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file, delimiter="\t"))
        times = [value for row in rows if (value := _number(row.get("s"))) is not None]
        if times:
            seconds.append(sum(times) / len(times))
        memory += [value for row in rows if (value := _number(row.get("max_rss"))) is not None]
    return (sum(seconds) if seconds else None), (max(memory) if memory else None)


def _number(text: str | None) -> float | None:
    """None for what Snakemake writes when it could not measure (`NA`, `-`)."""
    try:
        return float(text or "")
    except ValueError:
        return None
