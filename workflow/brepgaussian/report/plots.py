"""Plots of tables."""

from itertools import cycle
from pathlib import Path

from brepgaussian.artifacts.base import atomic
from brepgaussian.report.formats import Table

_SCORES = {
    "patch_f1_008": "patch F1, tau .08",
    "edge_f1_008": "edge F1, tau .08",
    "patch_strict_f1_002": "strict patch F1, tau .02",
    "topology_match": "right topology",
}
_DISTANCE = "surface_cd_exact"
_MARKERS = ("o", "D", "s", "^")
_STYLES = ("-", "--", ":")  # one a group of objects


def plot_views(table: Table, out_png: str | Path) -> None:
    """Scores and distance over the number of views, a line a group of objects."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = [column.csv for column in table.columns]
    groups = list(dict.fromkeys(row[0] for row in table.rows))
    figure = Figure(figsize=(8.4, 3.2), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    scores, distances = figure.subplots(1, 2)
    for group, style in zip(groups, cycle(_STYLES)):
        own = [row for row in table.rows if row[0] == group]
        views = [row[1] for row in own]
        for k, (name, title) in enumerate(_SCORES.items()):
            values = [row[names.index(name)] for row in own]
            look = {"linestyle": style, "color": f"C{k}", "marker": _MARKERS[k], "markersize": 4}
            scores.plot(views, values, label=f"{title}, {group}", **look)
        distance = [row[names.index(_DISTANCE)] for row in own]
        distances.plot(views, distance, marker="o", markersize=4, color="tab:red", linestyle=style, label=group)
    scores.set(xlabel="views", ylabel="mean over objects", ylim=(0, 1.03))
    scores.legend(frameon=False, fontsize=7)
    distances.legend(frameon=False, fontsize=7)
    distances.set(xlabel="views", ylabel="surface distance, unit frame", yscale="log")
    for axes in (scores, distances):
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(alpha=0.25)
        axes.set_xticks(sorted({row[1] for row in table.rows if isinstance(row[1], int)}))
    with atomic(out_png) as temporary:
        figure.savefig(temporary, metadata={"Software": None})
