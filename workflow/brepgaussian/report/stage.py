"""Stage `report`: an object's page and contact sheet."""

from pathlib import Path

from brepgaussian.log import get_logger
from brepgaussian.report.content import ObjectFiles, load
from brepgaussian.report.page import make_page
from brepgaussian.report.sheet import make_sheet
from brepgaussian.settings.report import ReportSettings

__all__ = ["ObjectFiles", "make_report"]

log = get_logger("report")


def make_report(
    *,
    object_name: str,
    files: ObjectFiles,
    out_html: str | Path,
    out_sheet: str | Path | None,
    settings: ReportSettings,
) -> None:
    """Make the page and, where asked for, the contact sheet of one object.

    Args:
        object_name: name in `config/objects.tsv`.
        files: its artifacts.
        out_html: the page, self-contained.
        out_sheet: the contact sheet (PNG), or None.
        settings: settings of the stage.
    """
    log.info("%s: %s", object_name, settings)
    content = load(object_name, files, settings)
    make_page(content, out_html, settings)
    if out_sheet is not None:
        make_sheet(content, out_sheet, settings)
