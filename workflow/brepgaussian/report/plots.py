"""Plots of tables."""

from pathlib import Path

from brepgaussian.artifacts.base import atomic
from brepgaussian.report.formats import Table

_SCORES = {
    "patch_f1_008": "patch F1, tau .08",
    "patch_strict_f1_002": "strict patch F1, tau .02",
    "topology_match": "right topology",
}
_DISTANCE = "surface_cd_exact"
_MARKERS = ("o", "s", "^")


def plot_views(table: Table, out_png: str | Path) -> None:
    """Scores and distance over the number of views."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = [column.csv for column in table.columns]
    views = [row[0] for row in table.rows]
    figure = Figure(figsize=(8.4, 3.2), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    scores, distances = figure.subplots(1, 2)
    for (name, title), marker in zip(_SCORES.items(), _MARKERS, strict=True):
        scores.plot(views, [row[names.index(name)] for row in table.rows], marker=marker, label=title)
    scores.set(xlabel="views", ylabel="mean over objects", ylim=(0, 1.03))
    scores.legend(frameon=False, fontsize=8)
    distances.plot(views, [row[names.index(_DISTANCE)] for row in table.rows], marker="o", color="tab:red")
    distances.set(xlabel="views", ylabel="surface distance, unit frame", yscale="log")
    for axes in (scores, distances):
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(alpha=0.25)
        axes.set_xticks(sorted({v for v in views if isinstance(v, int)}))
    with atomic(out_png) as temporary:
        figure.savefig(temporary, metadata={"Software": None})
