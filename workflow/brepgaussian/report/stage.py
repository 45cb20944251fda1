"""Stage `report`: an object's page and contact sheet."""

from pathlib import Path

from brepgaussian.log import get_logger
from brepgaussian.report.content import load
from brepgaussian.report.page import make_page
from brepgaussian.report.sheet import make_sheet
from brepgaussian.settings.report import ReportSettings

log = get_logger("report")


def make_report(
    *,
    object_name: str,
    views_path: str | Path,
    masks_path: str | Path,
    stage1_ply: str | Path,
    stage1_h5: str | Path,
    points_path: str | Path,
    primitives_path: str | Path,
    step_path: str | Path,
    brep_h5: str | Path,
    truth_path: str | Path | None,
    metrics_row: str | Path,
    out_html: str | Path,
    out_sheet: str | Path | None,
    settings: ReportSettings,
    stage2_path: str | Path | None = None,
) -> None:
    """Make the page and, where asked for, the contact sheet of one object.

    Args:
        object_name: name in `config/objects.tsv`.
        views_path, masks_path, stage1_ply, stage1_h5, points_path, primitives_path, step_path, brep_h5: artifacts.
        truth_path: `truth.h5`, or None.
        metrics_row: the object's one-row `metrics.csv`.
        out_html: the page, self-contained.
        out_sheet: the contact sheet (PNG), or None.
        settings: settings of the stage.
        stage2_path: `stage2.h5`, whose repaired masks are shown beside those detected, or None.
    """
    log.info("%s: %s", object_name, settings)
    content = load(
        object_name=object_name,
        views_path=views_path,
        masks_path=masks_path,
        stage1_ply=stage1_ply,
        stage1_h5=stage1_h5,
        points_path=points_path,
        primitives_path=primitives_path,
        step_path=step_path,
        brep_h5=brep_h5,
        truth_path=truth_path,
        metrics_row=metrics_row,
        settings=settings,
        stage2_path=stage2_path,
    )
    make_page(content, out_html, settings)
    if out_sheet is not None:
        make_sheet(content, out_sheet, settings)
