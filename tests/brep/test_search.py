"""The search among attempts: those of other explanations are reported, not chosen from."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.brep.budget import Budget, budget_of
from brepgaussian.brep.job import Attempt, Job
from brepgaussian.brep.judgement import shape_of
from brepgaussian.brep.likeness import left_out
from brepgaussian.brep.polish import Polished
from brepgaussian.brep.rivals import beyond_doubt, hopeless, worse
from brepgaussian.brep.search import Search
from brepgaussian.brep.shown import ShownEdge
from brepgaussian.brep.verdict import Verdict
from brepgaussian.brep.worker import WorkerError, WorkerTimeout
from brepgaussian.settings.brep import BrepSettings


def attempt(rung, explained=(1.0, 1.0), shape=b"solid", faces=6):
    verdict = Verdict((), explained=explained, explained_all=float(np.mean(explained)), iou=0.99, faces=faces)
    return Attempt(rung, shape, verdict)


def search(*tried, beside=()):
    job = Job((), (), np.zeros((0, 3)), (), None, BrepSettings())
    return Search(
        worker=None, job=job, budget=budget_of(job.settings), views=None, tried=list(tried), beside=list(beside)
    )


def test_attempts_of_other_explanations_are_not_chosen_from():
    own, other = attempt("support"), attempt("afresh wide", faces=7)
    assert search(own, beside=[other]).choose() is own
    assert search(beside=[other]).choose() is None
    assert search(own, beside=[other])._rivals(own) == []


class Kernel:
    """Answers every call with the same solid, or fails; counts the calls."""

    def __init__(self, error=None):
        self.calls, self.error = 0, error

    def call(self, function, arguments, limit_s):
        self.calls += 1
        if self.error is not None:
            raise self.error
        return attempt(arguments[1].name, (0.95, 0.2), faces=self.calls)


def climbed(kernel, solids):
    job = Job((SimpleNamespace(xyz=np.zeros((5, 3))),) * 2, (), np.zeros((0, 3)), (), None, BrepSettings())
    result = Search(kernel, job, Budget(solids, 5), None)
    result._first()
    return result


def test_the_search_ends_when_its_solids_are_counted_up():
    ladder = climbed(Kernel(WorkerError("fails")), 100)
    assert ladder.worker.calls == len(ladder.tried) > 3
    assert climbed(Kernel(WorkerError("fails")), 2).worker.calls == 2
    assert climbed(Kernel(WorkerError("fails")), 0).tried == []


def test_a_hanging_kernel_ends_the_search_sooner():
    assert climbed(Kernel(WorkerTimeout("hangs")), 20).worker.calls == 2


def test_a_rebuilt_solid_leaves_out_a_patch_that_had_a_face():
    before = attempt("support", (1.0, 0.95, 0.5))
    assert left_out(before, attempt("support", (1.0, 0.92, 0.0)), 0.9) == ""
    assert "1" in left_out(before, attempt("support", (1.0, 0.2, 0.9)), 0.9)


def judged(faces, on_solid=1.0, doubts=(), bare=0.0, accepted=True):
    verdict = Verdict((), doubts, on_solid=on_solid, faces=faces, bare=bare)
    return Polished(
        Attempt("support", b"solid", verdict), {"accepted": accepted, "silhouette_px": 0.05, "mask_iou": 0.9995}
    )


def explanation(patches, left_out=0):
    return Job((None,) * patches, (), np.zeros((0, 3)), (), None, BrepSettings(), left_out=(None,) * left_out)


def test_what_ends_the_search():
    assert beyond_doubt(judged(6), explanation(6))
    assert beyond_doubt(judged(6, on_solid=0.9), explanation(6))  # points that are off their own faces
    assert not beyond_doubt(judged(6, on_solid=0.9), explanation(6, left_out=2))  # fillets taken for skins
    assert not beyond_doubt(judged(6, doubts=("patch 3",)), explanation(6))
    assert not beyond_doubt(judged(6, accepted=False), explanation(6))


def test_a_solid_with_a_doubt_is_worth_explanations_of_as_many_surfaces():
    assert hopeless(explanation(7), judged(6))
    assert not hopeless(explanation(5), judged(6))
    assert not hopeless(explanation(7), judged(6, doubts=("patch 3",)))
    assert not hopeless(explanation(7), judged(6, on_solid=0.9))


def test_a_solid_that_leaves_something_out_replaces_none_that_does_not():
    settings = BrepSettings()
    assert "leaves out" in worse(judged(5, doubts=("patch 3",)), judged(6), settings)
    assert "no points" in worse(judged(5, bare=0.06), judged(6, bare=0.03), settings)
    assert (
        worse(judged(5, doubts=("patch 3",)), judged(6, accepted=False), settings) == ""
    )  # the images refuse the other


def looked_at(doubts):
    """How many of two other explanations are looked at beside an accepted solid that came from one with doubts."""
    source = attempt("extended")
    source = replace(source, verdict=replace(source.verdict, doubts=doubts))
    refined = judged(6)
    one = search(source)
    one.polished[shape_of(source)] = refined
    left = [explanation(7), explanation(7)]  # of more surfaces than the solid has faces: not worth a try
    one.others = (left.pop() for _ in range(2))
    assert one._against_others(refined) == (one, refined)
    return 2 - len(left)


def test_what_the_points_objected_to_is_compared_with_other_explanations_though_the_images_accept_it():
    assert looked_at(("patch 3 is explained to 12%",)) == 2
    assert looked_at(()) == 1


def compared(second):
    """What is left of one accepted solid with doubts beside the solids of two other explanations, and how many of them
    were asked for."""
    source = attempt("extended")
    source = replace(source, verdict=replace(source.verdict, doubts=("patch 3 is explained to 12%",)))
    one, asked = search(source), []
    one.polished[shape_of(source)] = first = judged(6)
    other = replace(explanation(5), patches=(SimpleNamespace(surface=SimpleNamespace(kind="plane")),) * 5)
    one.others = (asked.append(k) or other for k in range(2))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Search, "_first", lambda self, names: second)
        patch.setattr("brepgaussian.brep.search.worse", lambda *_: "the images agree little better")
        return one._against_others(first)[1], len(asked)


def test_two_explanations_that_come_to_the_same_solid_end_the_search():
    better = judged(6)
    better.report["silhouette_px"] = 0.02
    assert compared(better) == (better, 1)
    assert compared(judged(6, accepted=False))[1] == 2
    assert compared(judged(7))[1] == 2


@pytest.mark.parametrize(("accepted", "asked"), [(True, 7), (False, 20)])
def test_explanations_beside_an_accepted_solid_are_tried_a_few_times_only(monkeypatch, accepted, asked):
    source = attempt("extended")
    source = replace(source, verdict=replace(source.verdict, doubts=("patch 3 is explained to 12%",)))
    one, left = search(source), list(range(20))
    one.polished[shape_of(source)] = first = judged(6, accepted=accepted)
    other = replace(explanation(5), patches=(SimpleNamespace(surface=SimpleNamespace(kind="plane")),) * 5)
    one.others = (left.pop() * 0 or other for _ in range(20))
    monkeypatch.setattr(Search, "_first", lambda self, names: judged(7))
    monkeypatch.setattr("brepgaussian.brep.search.worse", lambda *_: "the images agree little better")
    assert one._against_others(first)[1] is first
    assert 20 - len(left) == asked


def doubted(few):
    """How many of two other explanations are asked for beside an accepted solid that explains one label not at all."""
    points = [SimpleNamespace(xyz=np.zeros((n, 3)), surface=SimpleNamespace(kind="plane")) for n in (1000, few)]
    job = replace(explanation(2), patches=tuple(points))
    one, asked, best = search(), [], judged(6, doubts=("patch 1 is explained to 0%",))
    one.job = job
    best = replace(best, attempt=replace(best.attempt, verdict=replace(best.attempt.verdict, explained=(1.0, 0.0))))
    one.others = (asked.append(k) or job for k in range(2))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Search, "_first", lambda self, names: best)
        patch.setattr("brepgaussian.brep.search.worse", lambda *_: "the images agree little better")
        one._against_others(best)
    return len(asked)


def test_a_label_of_few_points_that_has_no_face_in_two_explanations_ends_the_search():
    assert doubted(few=10) == 1
    assert doubted(few=500) == 2


@pytest.mark.parametrize(("accepted", "faces", "refined"), [(True, 5, 0), (True, 6, 1), (False, 5, 1)])
def test_a_simpler_solid_without_edges_that_images_show_is_not_refined_beside_an_accepted_one(accepted, faces, refined):
    edge = ShownEdge(np.zeros((4, 3)), 0.05, 40, 0.001)
    rival, asked = replace(judged(6, accepted=accepted), shown=(edge,)), []
    one = replace(search(), rival=rival)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("brepgaussian.brep.search.size", lambda a: a.verdict.faces)
        patch.setattr("brepgaussian.brep.search.polish", lambda *a: asked.append(a) or judged(faces))
        found = one._polished(attempt("support", faces=faces), None, None)
    assert len(asked) == refined
    assert bool(found.report.get("accepted")) == bool(refined)


class Rungs:
    """Builds a solid of another shape on every rung, which leaves out some patches of few points."""

    def __init__(self, *left_out):
        self.left_out = iter(left_out)

    def call(self, function, arguments, limit_s):
        gone = next(self.left_out)
        made = attempt(arguments[1].name, tuple(0.0 if k in gone else 1.0 for k in range(4)), faces=6 + len(gone))
        doubts = tuple(f"patch {k} is explained to 0%" for k in sorted(gone))
        return replace(
            made, verdict=replace(made.verdict, doubts=doubts, explained_all=0.99, volume=next(self.volumes))
        )

    volumes = iter(np.linspace(0.1, 0.9, 100))


@pytest.mark.parametrize(
    ("left_out", "refined"),
    [
        ([{2}, {2}, {2}, set()], 1),  # the last one has no doubts: it is chosen
        ([{2, 3}, {3}, {2, 3}, set()], 2),  # fewer are left out than of what was refused
        ([{2}, {3}, {2, 3}, set()], 2),  # others are
        ([{2}, {2}, {0}, set()], 1),  # not so few points
    ],
)
def test_solids_that_leave_out_what_a_refused_one_did_are_not_refined(monkeypatch, left_out, refined):
    patches = tuple(SimpleNamespace(xyz=np.zeros((n, 3)), caps=()) for n in (500, 480, 10, 10))
    job = Job(patches, (), np.zeros((0, 3)), (0,), None, BrepSettings())
    one, asked = replace(search(), worker=Rungs(*left_out), job=job, views=SimpleNamespace()), []

    def polished(worker, job, rung, found, *_):
        asked.append(found)
        return Polished(found, {"accepted": False, "silhouette_px": 3.0, "mask_iou": 0.9})

    monkeypatch.setattr("brepgaussian.brep.search.polish", polished)
    one._ladder = [SimpleNamespace(name=f"rung {k}") for k in range(len(left_out))]
    one._climb(to_the_end=False)
    assert len(one.tried) == len(left_out)
    assert len(asked) == refined
