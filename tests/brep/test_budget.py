"""Budgets of one object: of searches, of trials, and of all together."""

from dataclasses import replace

from brepgaussian.brep.budget import budget_of
from brepgaussian.settings.brep import BrepSettings


def test_trials_and_searches_share_the_work_of_an_object():
    search = budget_of(replace(BrepSettings(), most_work=3, most_refinements=2))
    trials = search.other(10, 10)
    trials.refined()
    search.refined()
    assert (search.refinements, trials.refinements) == (1, 9)
    assert not search.spent
    search.other(5, 1).refined()
    assert search.spent
    assert trials.spent
    assert search.other(5, 5).spent


def test_objects_share_nothing():
    first, second = (budget_of(replace(BrepSettings(), most_work=1)) for _ in range(2))
    first.refined()
    assert first.spent
    assert not second.spent
