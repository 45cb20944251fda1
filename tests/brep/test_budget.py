"""Budgets of one object: of searches, of trials, and of all together."""

from dataclasses import replace

from brepgaussian.brep import budget
from brepgaussian.brep.budget import budget_of
from brepgaussian.settings.brep import BrepSettings


def test_trials_and_searches_share_the_work_of_an_object():
    search = budget_of(replace(BrepSettings(), most_work=3, most_refinements=2))
    trials = search.other(10, 10)
    trials.refined(9)
    search.refined(9)
    assert (search.refinements, trials.refinements) == (1, 9)
    assert not search.spent
    search.other(5, 1).refined(9)
    assert search.spent
    assert trials.spent
    assert search.other(5, 5).spent


def test_objects_share_nothing():
    first, second = (budget_of(replace(BrepSettings(), most_work=1)) for _ in range(2))
    first.refined(9)
    assert first.spent
    assert not second.spent


def test_large_solids_count_more():
    work = budget.Work(10)
    left = budget.Budget(10, 10, work)
    left.built(25)
    left.built(5)
    assert left.solids == 8
    left.built(50)
    left.refined(75)
    assert (left.solids, left.refinements, work.refinements) == (6, 7, 7)
    left.built(25, 0)
    assert left.solids == 6
    left.built(200)
    assert left.spent
