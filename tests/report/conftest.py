"""The example object of the metrics' tests, with its page and sheet made once."""

import importlib.util
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from brepgaussian.metrics.stage import score_object
from brepgaussian.report.stage import ObjectFiles, make_report
from brepgaussian.settings.metrics import MetricsSettings
from brepgaussian.settings.report import ReportSettings

SMALL = ReportSettings(page_points=2000, panel_px=120, view_px=120, page_views=3)


@pytest.fixture(scope="session")
def example():
    path = Path(__file__).parents[1] / "metrics" / "example.py"
    spec = importlib.util.spec_from_file_location("report_example", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def object_files():
    """The example's artifacts and a row of metrics as a report takes them."""

    def gather(files, row):
        return ObjectFiles(
            views=files.views,
            masks=files.masks,
            surfels=files.stage1_ply,
            evidence=files.stage1,
            stage2=files.stage2,
            points=files.points,
            primitives=files.primitives,
            step=files.step,
            brep=files.brep,
            row=row,
            truth=files.truth,
        )

    return gather


@pytest.fixture(scope="session")
def made(example, object_files, tmp_path_factory):
    """Paths of an object's artifacts, row, page and sheet; its hole is .004 too wide."""
    folder = tmp_path_factory.mktemp("report")
    files = example.write_object(folder, result=example.drilled_plate(radius=0.204))
    row = folder / "metrics.csv"
    score_object(
        object_name="plate",
        variant="full",
        views_path=files.views,
        truth_path=files.truth,
        points_path=files.points,
        step_path=files.step,
        brep_h5=files.brep,
        out_csv=row,
        settings=MetricsSettings(samples=2000),
        seconds=61.0,
        peak_mb=800.0,
    )

    artifacts = object_files(files, row)

    def report(name="view", **changes):
        page, sheet = folder / f"{name}.html", folder / f"{name}.png"
        options = {"object_name": "plate", "files": artifacts, "settings": SMALL}
        make_report(**{**options, **changes}, out_html=page, out_sheet=sheet)
        return page, sheet

    page, sheet = report()
    return SimpleNamespace(
        files=files, folder=folder, row=row, page=page, sheet=sheet, report=report, artifacts=artifacts
    )
