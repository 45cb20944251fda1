"""The paper's tables from `metrics.csv`, with the paper's own numbers and stricter columns beside them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from brepgaussian.artifacts.base import atomic
from brepgaussian.metrics.columns import BASELINES, FAILED
from brepgaussian.metrics.table import read_rows
from brepgaussian.report import captions, paper
from brepgaussian.report.formats import Cell, Column, Table, as_markdown, write
from brepgaussian.report.plots import plot_views
from brepgaussian.report.runs import runs_table
from brepgaussian.report.summary import (
    FULL,
    Row,
    average,
    by_group,
    common_objects,
    failures,
    of_variant,
    variants_where,
)

ABLATIONS = {
    "no_two_stage": "w/o two-stage learning",
    "no_triplet": "w/o triplet loss",
    "no_edge": "w/o edge segmentation",
    "no_densification": "w/o densification of points",
    "no_splitting": "w/o splitting of surfels",
    FULL: "full",
}
MASKS = {"masks_truth": "truth masks", "masks_sam": "SAM, not corrected", FULL: "automatic masks"}
MASKS_PREFIX, VIEWS_PREFIX = "masks_", "views_"
_INPUTS = dict.fromkeys(BASELINES, "our points")
_COUNTS = (Column("objects", "objects", "objects"), Column("failed", "failed", "failed"))


def make_tables(
    metrics_csv: str | Path, groups: Mapping[str, str], out_dir: str | Path, others: Sequence[str | Path] = ()
) -> None:
    """Write all tables as CSV, Markdown and LaTeX, the view-count plot, and `readme.md`.

    Args:
        metrics_csv: the joined `metrics.csv`.
        groups: object name to `tuned` or `holdout` (`objects.tsv`).
        out_dir: folder of the tables; a table whose variants were not run is left out.
        others: tables of other methods and baselines on our objects, from `metrics.external` and
            `metrics.baselines`; they stand beside ours in tables 1 to 3.
    """
    rows = read_rows(metrics_csv)
    for table in all_tables(rows, groups, [row for path in others for row in read_rows(path)]):
        write(table, out_dir)
    views = views_table(rows, groups)
    if views is not None:
        plot_views(views, Path(out_dir) / "views.png")
    with atomic(Path(out_dir) / "readme.md") as temporary:
        temporary.write_text(readme_table(rows, groups), encoding="utf-8")


def all_tables(rows: Sequence[Row], groups: Mapping[str, str], others: Sequence[Row] = ()) -> list[Table]:
    """Every table for which there are rows."""
    full = of_variant(rows, FULL)
    beside = [*full, *others]
    found: list[Table | None] = [
        _grouped("1_patches", _segmentation("patch"), paper.PATCHES, beside, groups, captions.segmentation("Patch")),
        _grouped("2_edges", _segmentation("edge"), paper.EDGES, beside, groups, captions.segmentation("Edge")),
        _grouped(
            "3_cad", _cad(), paper.CAD, beside, groups, f"CAD reconstruction. {captions.DISTANCES} {captions.OURS}"
        ),
        _grouped("3_solids", _solids(), (), beside, groups, captions.SOLIDS),
        _variants("4_ablation_patches", _segmentation("patch"), paper.ABLATION_PATCHES, rows, groups, ABLATIONS),
        _variants("4_ablation_cad", _cad(), paper.ABLATION_CAD, rows, groups, ABLATIONS),
        _variants("5_masks", _mask_columns(), paper.MASKS, rows, groups, _mask_titles(rows)),
        views_table(rows, groups),
        objects_table(full, groups),
        runs_table(rows),
        failures_table(rows),
    ]
    return [table for table in found if table is not None]


def _segmentation(kind: str) -> dict[str, Column]:
    columns = {}
    for name in "precision_008 recall_008 f1_008 f1_002 f1_001 strict_f1_008 strict_f1_002 strict_f1_001".split():
        *words, tau = name.split("_")
        title = " ".join(words).replace("f1", "F1") + f" .{tau[1:]}"
        columns[f"{kind}_{name}"] = Column(title, f"{kind}_{name}", title.replace("F1", "F$_1$"))
    return columns


def _named(kind: str, score: str) -> Column:
    """A score's column where patches and edges stand in one table."""
    column = _segmentation(kind)[f"{kind}_{score}"]
    return replace(column, name=f"{kind} {column.name}", latex=f"{kind} {column.latex}")


def _cad() -> dict[str, Column]:
    columns = {}
    for kind in ("surface", "curve"):
        for name, title in (("cd_sum", "D_c sum"), ("cd_avg", "D_c avg"), ("cd_exact", "D_c exact")):
            if kind == "surface" or name != "cd_exact":
                columns[f"{kind}_{name}"] = _distance(kind, name, title, 1e-2)
        for name, title in (("hd", "D_h"), ("hd99", "D_h 99 %")):
            columns[f"{kind}_{name}"] = _distance(kind, name, title, 1e-1)
    return columns


def _distance(kind: str, name: str, title: str, scale: float) -> Column:
    latex = title.replace("D_c", "$D_c$").replace("D_h", "$D_h$").replace("%", r"\%")
    power = -1 if scale == 1e-1 else -2
    return Column(f"{kind} {title} (1e{power})", f"{kind}_{name}", f"{kind} {latex} ($10^{{{power}}}$)", scale)


def _solids() -> dict[str, Column]:
    names = {"valid": "valid", "closed": "closed", "topology_match": "topology", "fallback": "last resort"}
    names |= {"volume_iou": "volume IoU", "normal_consistency": "normals", "mask_iou": "mask IoU"}
    names |= {"silhouette_px": "silhouette (px)", "seconds": "seconds", "peak_mb": "MB"}
    digits = {"seconds": 0, "peak_mb": 0, "volume_iou": 4, "mask_iou": 4}
    return {name: Column(title, name, title, 1.0, digits.get(name, 3)) for name, title in names.items()}


def _mask_titles(rows: Sequence[Row]) -> dict[str, str]:
    """Titles of the mask variants; one that is not known here goes by its name."""
    others = variants_where(rows, lambda name: name.startswith(MASKS_PREFIX))
    return {**{name: name for name in others}, **MASKS}


def _mask_columns() -> dict[str, Column]:
    patch = {name: c for name, c in _segmentation("patch").items() if "f1_001" not in name}
    return patch | {name: c for name, c in _cad().items() if name.startswith("surface_cd")}


def _head(first: str) -> tuple[Column, ...]:
    return tuple(Column(name, name, name) for name in (first, "method", "input")) + _COUNTS


def _grouped(
    name: str,
    columns: Mapping[str, Column],
    theirs: Sequence[paper.PaperRow],
    rows: Sequence[Row],
    groups: Mapping[str, str],
    caption: str,
) -> Table | None:
    """The paper's rows, then mean and median of ours by group."""
    if not rows:
        return None
    lines = [_paper_line(("paper's objects",), row, columns) for row in theirs]
    rules = [len(lines)]
    methods = list(dict.fromkeys(row["variant"] for row in rows))
    for group, members in by_group(rows, groups).items():
        for method in methods:
            own = of_variant(members, method)
            if any(row["status"] == FAILED or row[column] is not None for row in own for column in columns):
                named = ("ours", "images") if method == FULL else (method, _INPUTS.get(method))
                lines += _our_lines((group,), named[0], own, columns, named[1])
        rules.append(len(lines))
    return Table(name, caption, _head("objects are") + tuple(columns.values()), tuple(lines), tuple(rules))


def _variants(
    name: str,
    columns: Mapping[str, Column],
    theirs: Sequence[paper.PaperRow],
    rows: Sequence[Row],
    groups: Mapping[str, str],
    titles: Mapping[str, str],
) -> Table | None:
    """The paper's rows, then by group mean and median of each variant over the objects that all of them ran."""
    variants = variants_where(rows, titles.__contains__)
    if set(variants) <= {FULL}:
        return None
    shared = common_objects(rows, variants)
    lines = [_paper_line(("paper's objects",), row, columns) for row in theirs]
    rules = [len(lines)]
    for group, members in by_group(shared, groups).items():
        for variant in variants:
            lines += _our_lines((group,), titles[variant], of_variant(members, variant), columns)
        rules.append(len(lines))
    caption = f"Variants on the objects that all of them ran. {captions.DISTANCES} {captions.OURS}"
    return Table(name, caption, _head("objects are") + tuple(columns.values()), tuple(lines), tuple(rules))


def _paper_line(head: tuple[str], row: paper.PaperRow, columns: Mapping[str, Column]) -> tuple[Cell, ...]:
    """D_c of the paper stands under the sum: it is not known which it is."""
    values = dict(row.values)
    for kind in ("surface", "curve"):
        if f"{kind}_cd" in values:
            values[f"{kind}_cd_sum"] = values.pop(f"{kind}_cd")
    return (*head, row.method, row.input, None, None, *(values.get(name) for name in columns))


def _our_lines(
    head: tuple[str], method: str, rows: Sequence[Row], columns: Mapping[str, Column], source: str | None = "images"
) -> list[tuple[Cell, ...]]:
    averages = [average(rows, name) for name in columns]
    counts = (len(rows), failures(rows))
    means = tuple(None if a is None else a.mean for a in averages)
    medians = tuple(None if a is None else a.median for a in averages)
    return [
        (*head, f"{method}, mean", source, *counts, *means),
        (*head, f"{method}, median", source, *counts, *medians),
    ]


def views_table(rows: Sequence[Row], groups: Mapping[str, str]) -> Table | None:
    """Scores by group and number of views: variants `views_...` and `full`, on the objects that all of them ran."""
    variants = variants_where(rows, lambda variant: variant.startswith(VIEWS_PREFIX) or variant == FULL)
    if set(variants) <= {FULL}:
        return None
    shared = common_objects(rows, variants)
    names = "patch_f1_008 edge_f1_008 patch_strict_f1_002 edge_strict_f1_002".split()
    names += "surface_cd_exact topology_match closed volume_iou".split()
    columns = {**_cad(), **_solids(), **_PER_OBJECT}
    lines: list[tuple[Any, ...]] = []
    rules = []
    for group, members in by_group(shared, groups).items():
        found = []
        for variant in variants:
            own = of_variant(members, variant)
            views = average(own, "views")
            if views is not None:
                averages = [average(own, name) for name in names]
                values = (None if a is None else a.mean for a in averages)
                found.append((group, round(views.median), variant, len(own), failures(own), *values))
        lines += sorted(found, key=lambda line: line[1:3])
        rules.append(len(lines))
    head = (*(Column(name, name, name) for name in ("objects are", "views", "variant")), *_COUNTS)
    caption = (
        f"Number of input views; means over the objects that all variants ran. {captions.DISTANCES} {captions.OURS}"
    )
    return Table("6_views", caption, (*head, *(columns[name] for name in names)), tuple(lines), tuple(rules))


_PER_OBJECT = {
    "faces": Column("faces", "faces", "faces", digits=0),
    "faces_truth": Column("true", "faces_truth", "true", digits=0),
    "patch_f1_008": _named("patch", "f1_008"),
    "edge_f1_008": _named("edge", "f1_008"),
    "patch_strict_f1_002": _named("patch", "strict_f1_002"),
    "edge_strict_f1_002": _named("edge", "strict_f1_002"),
    "surface_cd_exact": _distance("surface", "cd_exact", "D_c exact", 1e-2),
    "volume_iou": Column("volume IoU", "volume_iou", "volume IoU", digits=4),
    "seconds": Column("s", "seconds", "s", digits=0),
    "peak_mb": Column("MB", "peak_mb", "MB", digits=0),
}


def objects_table(rows: Sequence[Row], groups: Mapping[str, str]) -> Table | None:
    """One line an object."""
    if not rows:
        return None
    lines: list[tuple[Cell, ...]] = []
    rules = [0]
    for group, members in by_group(rows, groups).items():
        for row in members:
            lines.append((row["object"], group, _verdict(row), *(row[name] for name in _PER_OBJECT)))
        rules.append(len(lines))
    head = tuple(Column(name, name, name) for name in ("object", "group", "solid"))
    caption = f"Every object of variant full. {captions.DISTANCES}"
    return Table("objects", caption, head + tuple(_PER_OBJECT.values()), tuple(lines), tuple(rules))


def _verdict(row: Row) -> str:
    if row["status"] == FAILED:
        return "failed"
    if row["fallback"]:
        return "last resort"
    if not (row["closed"] and row["valid"]):
        return "not closed" if not row["closed"] else "not valid"
    return {True: "closed, right topology", False: "closed, wrong topology", None: "closed"}[row["topology_match"]]


def failures_table(rows: Sequence[Row]) -> Table | None:
    """Why objects failed."""
    lines = tuple((row["object"], row["variant"], row["reason"]) for row in rows if row["status"] == FAILED)
    head = tuple(Column(name, name, name) for name in ("object", "variant", "reason"))
    return Table("failures", "Objects without a result.", head, lines) if lines else None


def readme_table(rows: Sequence[Row], groups: Mapping[str, str]) -> str:
    """Markdown for a README: a summary by group and a line an object."""
    full = of_variant(rows, FULL)
    names = "closed topology_match patch_f1_008 patch_strict_f1_002 edge_strict_f1_002".split()
    names += "surface_cd_exact volume_iou seconds".split()
    columns: dict[str, Any] = {**_cad(), **_solids(), **_PER_OBJECT}
    lines = []
    for group, members in by_group(full, groups).items():
        averages = [average(members, name) for name in names]
        lines.append((group, len(members), failures(members), *(None if a is None else a.mean for a in averages)))
    head = (Column("objects are", "group", "group"), *_COUNTS)
    summary = Table(
        "summary", f"Means. {captions.DISTANCES}", (*head, *(columns[name] for name in names)), tuple(lines)
    )
    objects = objects_table(full, groups)
    return as_markdown(summary) + ("\n" + as_markdown(objects) if objects is not None else "")
