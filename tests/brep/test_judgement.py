"""What decides between two solids where silhouettes hardly do: the points that one of them leaves out."""

import numpy as np
import pytest
from brepgaussian.brep.job import Attempt
from brepgaussian.brep.judgement import (
    against,
    bears,
    beyond_hope,
    calms,
    completes,
    in_doubt,
    leaves_points,
    mends,
    short_of,
)
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


def test_what_is_beyond_hope_is_never_taken():
    """A solid with that much to object to is refused in the place of an accepted one, and of a refused one."""
    settings = BrepSettings()
    assert beyond_hope(None, settings) == np.inf
    for old in (solid(0.99, 0.02, True), solid(0.99, 0.5)):
        worst = beyond_hope(old, settings) * settings.accept_silhouette_px
        assert short_of(solid(0.99, worst), old, settings)
        assert against(solid(0.99, worst), old, settings)


def test_a_solid_that_leaves_out_a_face_is_worth_other_explanations():
    assert leaves_points(solid(0.96, 0.05, True).attempt)
    assert not leaves_points(solid(0.99, 0.05, True).attempt)


def refused(edges, places=0, iou=0.997):
    """Report of a solid with these medians of its edges (px) and places that views disagree about."""
    table = {"edges": [{"silhouette_px": px} for px in edges], "faces": [{"disputed": places}, {"disputed": 0}]}
    return {"mask_iou": iou, "astray": 0.0, "accepted": False, "refinement": table}


@pytest.mark.parametrize(
    ("new", "old", "taken"),
    [
        (refused([2.0, 2.0, 0.02, 0.02]), refused([2.0, 2.0, 2.0]), True),  # one of three countersinks
        (refused([2.0, 2.0, 1.9]), refused([2.0, 2.0, 2.0]), False),  # a little of everything
        (refused([2.0, 0.02], places=400), refused([2.0, 2.0]), False),  # edges by what views disagree about
        (refused([2.0, 0.02], iou=0.99), refused([2.0, 2.0]), False),
        (refused([2.0, 0.02], places=12), refused([2.0, 2.0], places=8), True),  # chance
        (refused([2.0, 2.0]), refused([2.0, 2.0, 0.05]), False),  # edges within the limit do not count
        ({"mask_iou": 0.999, "astray": 0.0}, refused([2.0]), False),
    ],
)
def test_one_of_several_places_is_mended_though_the_worst_edge_stays(new, old, taken):
    assert mends(new, old, BrepSettings()) == taken


def test_limits_of_nothing_are_no_fault():
    strict = BrepSettings(accept_astray=0.0, accept_iou=1.0, accept_disputed=0.0, accept_silhouette_px=0.0)
    assert mends(refused([2.0, 0.02], iou=0.999), refused([2.0, 2.0]), strict)


def test_nothing_known_against_two_solids_is_no_reason_to_change_one():
    unknown, known = solid(0.99, 0.5).report, refused([0.5])
    assert bears(known, known, BrepSettings())
    assert not any(bears(*pair, BrepSettings()) for pair in ((unknown, unknown), (unknown, known), (known, unknown)))


@pytest.mark.parametrize(
    ("after", "px", "taken"), [(0.0, 0.05, True), (30.0, 0.05, False), (0.0, 1.5, False), (None, 0.05, False)]
)
def test_an_accepted_solid_gets_what_explains_displaced_places(after, px, taken):
    """Nothing else may become worse."""
    settings = BrepSettings()
    old = refused([0.05, 0.05], iou=0.9996) | {"accepted": True, "displaced": settings.accept_displaced}
    new = refused([px, 0.05], iou=0.9996) | {"accepted": True, "displaced": after}
    assert in_doubt(old, settings)
    assert calms(new, old, settings) == taken
    assert not in_doubt(old | {"displaced": settings.accept_displaced / 2}, settings)


@pytest.mark.parametrize(
    ("after", "px", "places", "accepted", "taken"),
    [
        (0.0, 1.5, 0, True, True),  # few samples know the edges of one more rounded corner
        (9.0, 1.5, 0, True, False),
        (0.0, 1.5, 400, True, False),
        (0.0, 1.5, 0, False, False),
        (25.0, 0.05, 0, True, True),  # as good
        (None, 1.5, 0, True, False),
    ],
)
def test_a_corner_that_explains_displaced_places_need_not_fit_as_other_edges_do(after, px, places, accepted, taken):
    settings = BrepSettings()
    old = refused([0.05], iou=0.9996) | {"accepted": True, "displaced": 25.0, "silhouette_px": 0.05}
    new = refused([px], places, iou=0.9996) | {"accepted": accepted, "displaced": after, "silhouette_px": px}
    assert completes(new, old, settings) == taken
