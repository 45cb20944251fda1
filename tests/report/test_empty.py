"""Objects of which hardly anything was found still get a row, a page and a sheet."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.artifacts.base import Provenance
from brepgaussian.artifacts.brep import Brep
from brepgaussian.artifacts.masks import Masks
from brepgaussian.artifacts.points import Points
from brepgaussian.artifacts.primitives import Primitives
from brepgaussian.artifacts.stage1 import Evidence, Surfels
from brepgaussian.artifacts.views import read_views
from brepgaussian.metrics.stage import score_object
from brepgaussian.metrics.table import read_rows
from brepgaussian.report.stage import make_report
from brepgaussian.settings.metrics import MetricsSettings
from brepgaussian.settings.report import ReportSettings
from OCP.BRepPrimAPI import BRepPrimAPI_MakeSphere
from OCP.gp import gp_Pnt


@pytest.mark.parametrize("with_truth", [True, False])
def test_a_ball_without_labels_curves_or_masks(example, object_files, tmp_path, with_truth):
    ball = BRepPrimAPI_MakeSphere(gp_Pnt(0.5, 0.5, 0.5), 0.5).Shape()
    files, by = example.write_object(tmp_path, result=ball, truth_shape=ball), Provenance("ball")
    shape = read_views(files.views).alpha.shape
    Masks(np.zeros(shape, np.uint8), np.zeros(shape, np.int16), np.zeros(shape[0], np.float32)).write(files.masks, by)
    empty = np.zeros((0, 3), np.float32)
    none = np.zeros(0, np.float32)
    Surfels(empty, np.zeros((0, 4), np.float32), np.zeros((0, 2), np.float32), none, empty, none).write(
        files.stage1_ply
    )
    Evidence().write(files.stage1, by)
    xyz = np.full((5, 3), 0.5, np.float32)
    nowhere = np.full(5, -1, np.int32)
    Points(xyz, xyz, np.zeros(5, np.float32), nowhere, nowhere).write(files.points)
    Primitives(()).write(files.primitives, by)
    Brep((), (), np.zeros((0, 3)), {"fallback": True, "note": None, "bad": float("nan")}).write(files.brep, by)
    truth = files.truth if with_truth else None
    row = tmp_path / "metrics.csv"
    score_object(
        object_name="ball",
        variant="full",
        views_path=files.views,
        truth_path=truth,
        points_path=files.points,
        step_path=files.step,
        brep_h5=files.brep,
        out_csv=row,
        settings=MetricsSettings(samples=1000, deflection=1e-3),
    )
    found = read_rows(row)[0]
    assert found["fallback"]
    assert found["closed"]
    assert (found["faces"], found["edges"], found["vertices"]) == (1, 0, 0)
    assert found["patch_f1_008"] == (0 if with_truth else None)
    assert found["edge_f1_008"] is None  # a ball has no edge, and none was found
    make_report(
        object_name="ball",
        files=replace(object_files(files, row), truth=truth),
        out_html=tmp_path / "view.html",
        out_sheet=tmp_path / "sheet.png",
        settings=ReportSettings(panel_px=100, view_px=80, page_views=2),
    )
    assert "polyhedral last resort" in (tmp_path / "view.html").read_text()
    assert (tmp_path / "sheet.png").stat().st_size > 0
