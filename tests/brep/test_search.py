"""The search among attempts: those of other explanations are reported, not chosen from."""

import numpy as np
from brepgaussian.brep.job import Attempt, Job
from brepgaussian.brep.polish import _left_out
from brepgaussian.brep.search import Search
from brepgaussian.brep.verdict import Verdict
from brepgaussian.settings.brep import BrepSettings


def attempt(rung, explained=(1.0, 1.0), shape=b"solid", faces=6):
    verdict = Verdict((), explained=explained, explained_all=float(np.mean(explained)), iou=0.99, faces=faces)
    return Attempt(rung, shape, verdict)


def search(*tried, beside=()):
    job = Job((), (), np.zeros((0, 3)), (), None, BrepSettings())
    return Search(worker=None, job=job, start=0.0, views=None, tried=list(tried), beside=list(beside))


def test_attempts_of_other_explanations_are_not_chosen_from():
    own, other = attempt("support"), attempt("afresh wide", faces=7)
    assert search(own, beside=[other]).choose() is own
    assert search(beside=[other]).choose() is None
    assert search(own, beside=[other])._rivals(own) == []


def test_a_rebuilt_solid_leaves_out_a_patch_that_had_a_face():
    before = attempt("support", (1.0, 0.95, 0.5))
    assert _left_out(before, attempt("support", (1.0, 0.92, 0.0)), 0.9) == ""
    assert "1" in _left_out(before, attempt("support", (1.0, 0.2, 0.9)), 0.9)
