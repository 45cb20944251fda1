"""Whether the solid of one explanation of the points takes the place of another one's."""

from brepgaussian.brep.job import Job
from brepgaussian.brep.judgement import against, leaves_points, shape_of, short_of, size
from brepgaussian.brep.polish import Polished
from brepgaussian.settings.brep import BrepSettings


def beyond_doubt(best: Polished, job: Job) -> bool:
    """Whether neither the points, those of patches that its job left out included, nor the images object to a solid."""
    bare = bool(job.left_out) and leaves_points(best.attempt)
    return best.report.get("accepted") is not False and not bare and not best.attempt.verdict.doubts


def same(new: Polished, best: Polished) -> bool:
    """Whether the images accept both solids and they are one and the same, but for seams."""
    accepted = bool(new.report.get("accepted") and best.report.get("accepted"))
    (faces, _, *others), (known, _, *rest) = shape_of(new.attempt), shape_of(best.attempt)
    return accepted and (faces, others) == (known, rest)


def hopeless(job: Job, best: Polished) -> bool:
    """Whether an explanation with as many surfaces as faces of an accepted solid of all points is not worth a try."""
    known = bool(best.report.get("accepted")) and not leaves_points(best.attempt) and not best.attempt.verdict.doubts
    return known and len(job.patches) >= best.attempt.verdict.faces


def worse(new: Polished, old: Polished | None, settings: BrepSettings) -> str:
    """Why another solid is not taken in the place of the present one."""
    if old is None:
        return ""
    if not old.report or not new.report:  # no images: the points decide
        return "" if new.attempt.verdict.score > old.attempt.verdict.score else "the points agree less"
    if new.report.get("accepted") and not old.report.get("accepted"):
        return ""  # of a solid that the images refuse, edges that they seem to show prove little
    if new.attempt.verdict.doubts and not old.attempt.verdict.doubts:
        return "it leaves out patches"
    if new.attempt.verdict.bare > old.attempt.verdict.bare + settings.gate_bare:
        return "more of its area has no points"
    if size(new.attempt) < size(old.attempt):
        return against(new, old, settings)
    return short_of(new, old, settings)
