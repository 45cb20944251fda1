"""What decides between two solids where silhouettes hardly do: the points that one of them leaves out."""

import pytest
from brepgaussian.brep.job import Attempt
from brepgaussian.brep.judgement import against, leaves_points, short_of
from brepgaussian.brep.polish import Polished
from brepgaussian.brep.verdict import Verdict
from brepgaussian.settings.brep import BrepSettings


def solid(on_solid, px, accepted=False, doubts=()):
    attempt = Attempt("support", b"solid", Verdict((), doubts, on_solid=on_solid))
    return Polished(attempt, {"silhouette_px": px, "mask_iou": 0.9995, "accepted": accepted})


@pytest.mark.parametrize(
    ("new", "old", "taken"),
    [
        (solid(0.99, 0.51), solid(0.90, 0.50), True),  # a pocket that no silhouette shows
        (solid(0.99, 0.51, doubts=("patch 3",)), solid(0.90, 0.50), False),
        (solid(0.91, 0.51), solid(0.90, 0.50), False),
        (solid(0.91, 0.51), solid(0.90, 0.50, doubts=("patch 3",)), True),  # a small face that the other lacks
        (solid(0.90, 0.51), solid(0.90, 0.50, doubts=("patch 3",)), False),
        (solid(0.99, 0.80), solid(0.90, 0.50), False),  # the images tell the two apart
        (solid(0.99, 0.05, True), solid(0.95, 0.03, True), True),
        (solid(0.99, 0.50), solid(0.90, 0.05, True), False),
        (solid(0.90, 0.05, True), solid(0.99, 0.50), True),
        (solid(0.90, 0.02), solid(0.90, 0.90), True),
    ],
)
def test_points_decide_where_the_images_do_not(new, old, taken):
    assert (short_of(new, old, BrepSettings()) == "") == taken


@pytest.mark.parametrize(
    ("pixels", "lost", "taken"), [(80_000, 1e-4, True), (80_000, 3e-4, False), (8_000_000, 1e-4, False)]
)
def test_a_few_pixels_on_the_border_do_not_refuse_a_simpler_solid(pixels, lost, taken):
    old, new = solid(0.99, 0.02, True), solid(0.99, 0.02, True)
    old.report["mask_pixels"] = pixels
    new.report["mask_iou"] -= lost
    assert (against(new, old, BrepSettings()) == "") == taken


def test_a_solid_that_leaves_out_a_face_is_worth_other_explanations():
    assert leaves_points(solid(0.96, 0.05, True).attempt)
    assert not leaves_points(solid(0.99, 0.05, True).attempt)
