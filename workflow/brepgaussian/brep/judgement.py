"""What the images have against one solid in the place of another."""

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from brepgaussian.brep.job import Attempt
from brepgaussian.brep.polish import Polished, badness, in_limits, wrong_masks
from brepgaussian.brep.refine.accept import IOU_NOISE, PX_NOISE
from brepgaussian.brep.refine.agreement import PLACE_AREA_PX2
from brepgaussian.brep.refine.descent import WINDOWS
from brepgaussian.brep.shown import lost_edges
from brepgaussian.brep.simplify import complexity
from brepgaussian.settings.brep import BrepSettings

Shape = tuple[int, int, int, float]

_SHAPE_DIGITS = 3  # of the volume of two solids that count as one shape
# Standard deviations of a count: which border pixels are wrong is chance, in two triangulations of one solid too.
_COUNT_SIGMAS = 2.0
_WORTH = 0.5  # of the badness that is left by a change that makes a solid no simpler,
_MORE_POINTS = 0.02  # or of all points that it explains besides,
_MENDED = 0.9  # of all objections that are left by a change that adds none
_CALMED = 0.25  # of the displaced area that is left by a change that tells why it was
_CHANCE = 1.0  # but for so many limits, or few places,
_FAR = 4.0  # limits and as many times the badness of another solid beyond which no rebuilding helps
_UNREFINED_PX = WINDOWS[0][0]  # by which edges lie off at most where a solid is not refined yet: the widest search
_NO_WORSE = 1.05  # times the badness, if the images hardly tell the two apart


def against(new: Polished, old: Polished, settings: BrepSettings, smooth: Collection[int] = ()) -> str:
    """What the images have against a simpler solid; empty if nothing.

    Surfaces of the old one that are `smooth`, one fillet, have no edge between them, unless images are sure of it.
    """
    one, other = new.report, old.report
    if one.get("silhouette_px") is None or one.get("mask_iou") is None:
        return str(one.get("refinement_fault") or "it cannot be judged")
    lost = lost_edges(new.attempt.verdict.structure, old.shown, smooth)
    if lost:
        return f"{lost} edges that the images show are not edges of it"
    if other.get("silhouette_px") is None or (one["accepted"] and not other["accepted"]):
        return ""
    if other["accepted"] and not one["accepted"]:
        return "the images do not accept it"
    less = one["mask_iou"] < other["mask_iou"] - _slack(other)  # what silhouettes show is not left out
    if other["accepted"]:
        less |= one["silhouette_px"] > other["silhouette_px"] + PX_NOISE
    else:
        less |= badness(one, settings) > badness(other, settings)
    return f"the images agree less ({one['silhouette_px']:.3f} px, IoU {one['mask_iou']:.5f})" if less else ""


def forlorn(new: Attempt, old: Polished, smooth: Collection[int] = ()) -> str:
    """What the images will have against a simpler solid, whatever its refinement comes to; empty if that is open."""
    lost = lost_edges(new.verdict.structure, old.shown, smooth, _UNREFINED_PX)
    return f"{lost} edges that the images show are far from all of its edges" if lost else ""


def beyond_hope(old: Polished | None, settings: BrepSettings) -> float:
    """Badness of a refined solid from which none comes that is taken in the place of another one."""
    return math.inf if old is None else _FAR * (1 + badness(old.report, settings))


def _slack(report: Mapping[str, Any]) -> float:
    """Loss of IoU that tells nothing: that of a few pixels on the border."""
    pixels = max(int(report.get("mask_pixels", 0)), 1)
    chance = _COUNT_SIGMAS * math.sqrt(max(1 - report["mask_iou"], 0.0) / pixels) if pixels > 1 else 0.0
    return max(IOU_NOISE, chance)


def short_of(new: Polished, old: Polished, settings: BrepSettings) -> str:
    """Why a solid that is no simpler is not worth it: the images must like it much better, or no less if points do."""
    if old.report.get("accepted") and not new.report.get("accepted"):
        return "the images do not accept it"
    if new.report.get("accepted") and not old.report.get("accepted"):
        return ""
    after, before = badness(new.report, settings), badness(old.report, settings)
    telling = explains_more(new.attempt, old.attempt) and (new.report.get("accepted") or after <= _NO_WORSE * before)
    better = after < _WORTH * before or telling
    return "" if better else f"the images agree little better ({after:.1f} for {before:.1f} limits)"


def mends(new: Mapping[str, Any], old: Mapping[str, Any], settings: BrepSettings) -> bool:
    """Whether a solid does away with a good part of all that the images have against another one, and adds nothing.

    The worst edge stays where several places are wrong, and one of them is mended.
    """
    return bears(new, old, settings) and sum(objections(new, settings)) < _MENDED * sum(objections(old, settings))


def bears(new: Mapping[str, Any], old: Mapping[str, Any], settings: BrepSettings) -> bool:
    """Whether the images have nothing against a solid that they do not have against another one, too."""
    after, before = objections(new, settings), objections(old, settings)
    if not after or len(after) != len(before):  # not known of one of them
        return False
    return _no_more(after, before)


def in_doubt(report: Mapping[str, Any], settings: BrepSettings) -> bool:
    """Whether the images refuse a solid, or parallax places so much of it elsewhere that they nearly do."""
    return report.get("accepted") is False or (report.get("displaced") or 0.0) >= settings.accept_displaced > 0


def calms(new: Mapping[str, Any], old: Mapping[str, Any], settings: BrepSettings) -> bool:
    """Whether nothing much is displaced any more of an accepted solid, and nothing else is worse."""
    return _is_calmer(new, old) and bears(new, old, settings)


def completes(new: Mapping[str, Any], old: Mapping[str, Any], settings: BrepSettings) -> bool:
    """Whether the images accept both solids, and one no less than the other; or nothing much is displaced any more.

    Then masks and places may be no worse; edges may: those of a corner like its neighbours' are few samples.
    """
    if as_good(new, old, settings):
        return True
    after, before = objections(new, settings)[1:], objections(old, settings)[1:]
    return _is_calmer(new, old) and len(after) == len(before) > 0 and _no_more(after, before)


def _is_calmer(new: Mapping[str, Any], old: Mapping[str, Any]) -> bool:
    """Whether the images accept both solids, and nothing much of what is displaced of the second is so of the first."""
    accepted = bool(new.get("accepted")) and bool(old.get("accepted"))
    before, after = old.get("displaced"), new.get("displaced")
    return accepted and before is not None and after is not None and after < _CALMED * before


def _no_more(after: Sequence[float], before: Sequence[float]) -> bool:
    """Whether no objection has grown by more than chance."""
    return all(one <= _NO_WORSE * other + _CHANCE for one, other in zip(after, before, strict=True))


def as_good(new: Mapping[str, Any], old: Mapping[str, Any], settings: BrepSettings) -> bool:
    """Whether the images accept both solids, and one no less than the other."""
    accepted = bool(new.get("accepted")) and bool(old.get("accepted"))
    return accepted and badness(new, settings) <= _NO_WORSE * badness(old, settings)


def objections(report: Mapping[str, Any], settings: BrepSettings) -> tuple[float, ...]:
    """All that the images have against a solid, in limits: of its edges, its masks, its places; () if not known."""
    details = report.get("refinement")
    if not details or "edges" not in details or report.get("mask_iou") is None:
        return ()
    medians = [row["silhouette_px"] for row in details["edges"] if row["silhouette_px"] is not None]
    over = [in_limits(px, settings.accept_silhouette_px) for px in medians]
    places = PLACE_AREA_PX2 * sum(row["disputed"] for row in details["faces"])
    return sum(px for px in over if px > 1), wrong_masks(report, settings), in_limits(places, settings.accept_disputed)


def explains_more(new: Attempt, old: Attempt) -> bool:
    """Whether a solid without doubts explains what another one leaves out: pockets that no silhouette shows.

    A patch that has no face in it is a doubt about it, however few its points are.
    """
    return not new.verdict.doubts and (
        new.verdict.on_solid > old.verdict.on_solid + _MORE_POINTS
        or (bool(old.verdict.doubts) and new.verdict.on_solid > old.verdict.on_solid)
    )


def leaves_points(attempt: Attempt) -> bool:
    """Whether a solid leaves more points out than another explanation needs to be worth a try."""
    return attempt.verdict.on_solid < 1 - _MORE_POINTS


def shape_of(attempt: Attempt) -> Shape:
    """What tells two solids apart."""
    verdict = attempt.verdict
    return verdict.faces, verdict.edges, verdict.vertices, round(verdict.volume, _SHAPE_DIGITS)


def size(attempt: Attempt) -> tuple[int, int]:
    """Number of faces, and how complex their surfaces are."""
    structure = attempt.verdict.structure
    assert structure is not None
    return complexity(attempt.surfaces, [f.surface for f in structure.faces])
