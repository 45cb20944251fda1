"""What an acceptance test's figures make of a solid."""

from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.brep import polish
from brepgaussian.brep.refine.accept import _worst_stretch
from brepgaussian.brep.verdict import Verdict
from brepgaussian.settings.brep import BrepSettings


@pytest.mark.parametrize(
    ("px", "hints", "doubts", "accepted"),
    [
        (0.02, ("2.2% of the area has no points",), (), True),
        (0.12, (), (), True),
        (0.02, (), ("patch 3 is explained to 0%",), True),
        (0.12, ("2.2% of the area",), (), False),
        (0.14, (), ("patch 15 is explained to 0%",), False),  # a bore was cut askew
        (0.02, ("2.2% of the area",), ("patch 3 is explained to 0%",), False),
    ],
)
def test_what_images_may_excuse_refuses_a_solid_that_points_do_not_cover(monkeypatch, px, hints, doubts, accepted):
    """An edge that few samples tell of, and a patch that is left out."""
    monkeypatch.setattr(polish, "shown_edges", lambda *_: ())
    test = SimpleNamespace(
        silhouette_px=px, mask_iou=0.9998, mask_pixels=40000, astray=0.0, disputed=9.0, displaced=None, stepped=0.0,
        accepted=True, edges=[],
    )  # fmt: skip
    attempt = SimpleNamespace(verdict=Verdict((), doubts=doubts, hints=hints))
    job = SimpleNamespace(settings=BrepSettings(), blends=())
    found = polish._polished(attempt, {}, None, test, job, 0.001)
    assert found.report["accepted"] is accepted


def test_a_kink_shows_in_a_stretch_of_an_edge_and_not_in_its_median():
    along = np.repeat(np.linspace(0, 1, 200), 30)  # a place every .005, seen by thirty views
    points = np.column_stack([along, np.zeros((len(along), 2))])
    residual = np.full(len(along), 0.02)
    assert _worst_stretch(points, residual) == pytest.approx(0.02)
    residual[np.abs(along - 0.5) < 0.03] = 0.6
    assert np.median(residual) == pytest.approx(0.02)
    assert _worst_stretch(points, residual) == pytest.approx(0.6)
    assert _worst_stretch(points[::200], residual[::200]) == 0.0  # too few anywhere
    assert _worst_stretch(points[:0], residual[:0]) == 0.0
