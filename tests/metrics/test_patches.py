"""Segmentation scores against hand-computed cases and a slow reference."""

from itertools import permutations

import numpy as np
import pytest
from brepgaussian.metrics import patches
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp


def square(z: float, n: int = 20) -> np.ndarray:
    grid = np.linspace(0, 1, n)
    x, y = np.meshgrid(grid, grid)
    return np.column_stack([x.ravel(), y.ravel(), np.full(n * n, z)])


def labelled(*sets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.concatenate(sets), np.concatenate([np.full(len(s), i) for i, s in enumerate(sets)])


def test_perfect_labels_score_one():
    points, labels = labelled(square(0), square(0.5), square(1))
    for score in patches.score_labels(points, labels, points, labels[::1]).values():
        assert score == patches.Score(1, 1, 1, 1)


def test_names_of_labels_do_not_matter_and_unassigned_points_are_not_scored():
    points, labels = labelled(square(0), square(0.5))
    stray = np.array([[9.0, 9, 9]])
    got = patches.score_labels(np.concatenate([points, stray]), np.concatenate([10 - labels, [-1]]), points, labels)
    assert got[0.01] == patches.Score(1, 1, 1, 1)


def test_one_of_three_faces_missing():
    truth, truth_labels = labelled(square(0), square(0.5), square(1))
    points, labels = labelled(square(0), square(0.5))
    score = patches.score_labels(points, labels, truth, truth_labels)[0.02]
    assert score.precision == 1
    assert score.recall == pytest.approx(2 / 3)
    assert score.f1 == pytest.approx(0.8)
    assert score.strict_f1 == pytest.approx(2 * 2 / (2 + 3))


def test_a_shift_of_five_percent_is_forgiven_by_the_papers_threshold_only():
    truth, labels = labelled(square(0), square(1))
    scores = patches.score_labels(truth + np.array([0, 0, 0.05]), labels, truth, labels)
    assert [scores[tau].f1 for tau in patches.TAUS] == [1, 0, 0]
    assert [scores[tau].strict_f1 for tau in patches.TAUS] == [1, 0, 0]


def test_fragments_have_precision_one_but_one_strict_match_at_most():
    whole = square(0, 40)
    quarters = (whole[:, 0] > 0.5) * 2 + (whole[:, 1] > 0.5)
    score = patches.score_labels(whole, quarters, whole, np.zeros(len(whole), int))[0.08]
    assert score.precision == 1
    assert score.recall == 0  # no fragment covers the face
    assert score.strict_f1 == 0


def test_duplicate_patch_costs_strict_f1_only():
    points, labels = labelled(square(0), square(0))
    score = patches.score_labels(points, labels, square(0), np.zeros(400, int))[0.01]
    assert score.f1 == 1
    assert score.strict_f1 == pytest.approx(2 / 3)


def test_nothing_predicted_or_nothing_true():
    points, labels = labelled(square(0))
    nothing, none = np.zeros((0, 3)), np.zeros(0, int)
    missing = patches.score_labels(nothing, none, points, labels)[0.08]
    assert (missing.recall, missing.f1, missing.strict_f1) == (0, 0, 0)
    assert np.isnan(missing.precision)
    invented = patches.score_labels(points, labels, nothing, none)[0.08]
    assert (invented.precision, invented.f1) == (0, 0)
    assert np.isnan(patches.score_labels(nothing, none, nothing, none)[0.08].f1)


def test_mean_distance_by_hand():
    sources = [np.array([[0.0, 0, 0], [10, 0, 0]])]
    targets = [np.array([[0.0, 0, 3], [10, 4, 0]]), np.array([[0.0, 0, 0]])]
    np.testing.assert_allclose(patches.mean_distances(sources, targets), [[3.5, 5]])
    np.testing.assert_allclose(patches.mean_distances(targets, sources), [[3.5], [0]])
    assert patches.mean_distances(sources, targets, cutoff=1)[0, 1] == np.inf


def test_columns_are_those_of_the_table():
    points, labels = labelled(square(0))
    row = patches.columns("edge", patches.score_labels(points, labels, points, labels))
    assert (
        list(row)
        == (
            "edge_precision_008 edge_recall_008 edge_f1_008 edge_f1_002 edge_f1_001 "
            "edge_strict_f1_008 edge_strict_f1_002 edge_strict_f1_001"
        ).split()
    )


@settings(max_examples=40, deadline=None)
@given(hnp.arrays(float, st.tuples(st.integers(1, 5), st.integers(1, 5)), elements=st.floats(0, 0.2)))
def test_matching_is_the_largest_one(symmetric):
    """Against all permutations."""
    small, large = sorted(symmetric.shape)
    square_ = symmetric if symmetric.shape[0] == small else symmetric.T
    best = max(
        sum(square_[i, j] <= 0.08 for i, j in enumerate(columns)) for columns in permutations(range(large), small)
    )
    assert len(patches.match(symmetric, 0.08)) == best


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**31))
def test_cutoff_changes_no_score(seed):
    rng = np.random.default_rng(seed)
    points, truth = rng.random((80, 3)), rng.random((90, 3)) * [1, 1, 0.1]
    labels, truth_labels = rng.integers(-1, 6, 80), rng.integers(0, 7, 90)
    sources, targets = patches.split(points, labels), patches.split(truth, truth_labels)
    slow = np.array(
        [[np.linalg.norm(s[:, None] - t[None], axis=2).min(axis=1).mean() for t in targets] for s in sources]
    )
    np.testing.assert_allclose(patches.mean_distances(sources, targets), slow, atol=1e-12)
    back = patches.mean_distances(targets, sources).T
    fast = patches.score_labels(points, labels, truth, truth_labels)
    for tau in patches.TAUS:
        assert fast[tau] == patches.score_distances(slow, back, tau)
