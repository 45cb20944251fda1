"""One table as CSV, Markdown and LaTeX."""

import csv
import io
from dataclasses import dataclass
from pathlib import Path

from brepgaussian.artifacts.base import atomic

Cell = str | float | int | None


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes:
        name: heading in Markdown; csv: heading in CSV; latex: heading in LaTeX.
        scale: numbers are divided by it in Markdown and LaTeX (1e-2: shown in hundredths).
        digits: decimals in Markdown and LaTeX.
    """

    name: str
    csv: str
    latex: str
    scale: float = 1.0
    digits: int = 3


@dataclass(frozen=True)
class Table:
    """A table of a report.

    Attributes:
        name: stem of its files; also the LaTeX label.
        caption: what it shows, with definitions.
        columns: headings; rows: cells, None for an empty one.
        rules: numbers of the rows before which a line is drawn.
    """

    name: str
    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    rules: tuple[int, ...] = ()


def write(table: Table, folder: str | Path) -> list[Path]:
    """Write a table as .csv, .md and .tex."""
    texts = {"csv": as_csv(table), "md": as_markdown(table), "tex": as_latex(table)}
    paths = []
    for ending, text in texts.items():
        path = Path(folder) / f"{table.name}.{ending}"
        with atomic(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
        paths.append(path)
    return paths


def as_csv(table: Table) -> str:
    """Full numbers, in unit lengths."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow([column.csv for column in table.columns])
    for row in table.rows:
        writer.writerow(["" if c is None else f"{c:.6g}" if isinstance(c, float) else c for c in row])
    return buffer.getvalue()


def as_markdown(table: Table) -> str:
    """A GitHub table with its caption."""
    numeric = _numeric(table)
    lines = ["| " + " | ".join(column.name for column in table.columns) + " |"]
    lines.append("|" + "|".join("---:" if right else "---" for right in numeric) + "|")
    for row in table.rows:
        cells = [_text(cell, column).replace("|", "\\|") for cell, column in zip(row, table.columns, strict=True)]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + f"\n\n{table.caption}\n"


def as_latex(table: Table) -> str:
    """A booktabs table."""
    alignment = "".join("r" if right else "l" for right in _numeric(table))
    lines = [r"\begin{table}", r"\centering", rf"\caption{{{_escape(table.caption)}}}"]
    lines += [rf"\label{{tab:{table.name}}}", rf"\begin{{tabular}}{{{alignment}}}", r"\toprule"]
    lines += [" & ".join(column.latex for column in table.columns) + r" \\", r"\midrule"]
    for number, row in enumerate(table.rows):
        if number in table.rules and number > 0:
            lines.append(r"\midrule")
        cells = [_escape(_text(cell, column)) for cell, column in zip(row, table.columns, strict=True)]
        lines.append(" & ".join(cells) + r" \\")
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", r"\end{table}", ""])


def _numeric(table: Table) -> list[bool]:
    """Which columns hold no text."""
    return [not any(isinstance(row[i], str) for row in table.rows) for i in range(len(table.columns))]


def _text(cell: Cell, column: Column) -> str:
    if cell is None:
        return "–"
    return f"{cell / column.scale:.{column.digits}f}" if isinstance(cell, float) else str(cell)


def _escape(text: str) -> str:
    special = {"\\": r"\textbackslash{}", "_": r"\_", "%": r"\%", "&": r"\&", "#": r"\#", "–": "--", "×": r"$\times$"}
    special |= {"^": r"\^{}", "~": r"\~{}", "{": r"\{", "}": r"\}", "$": r"\$", "<": r"$<$", ">": r"$>$"}
    return "".join(special.get(character, character) for character in text)
