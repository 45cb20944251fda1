"""Patch and edge segmentation: the paper's directed precision, recall and F1, and a strict F1.

A patch (or an edge) is a set of points. The same functions score both.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

PAPER_TAU = 0.08  # unit lengths; the paper's threshold
TAUS = (0.08, 0.02, 0.01)  # the paper's threshold and two that do not forgive a 5 % shift
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Score:
    """Scores at one threshold; NaN where undefined (nothing predicted and nothing true)."""

    precision: float
    recall: float
    f1: float
    strict_f1: float


def score_labels(
    points: NDArray[np.floating],
    labels: NDArray[np.integer],
    truth_points: NDArray[np.floating],
    truth_labels: NDArray[np.integer],
    taus: Sequence[float] = TAUS,
) -> dict[float, Score]:
    """Score labelled points against labelled true points.

    Args:
        points: (N, 3) predicted points; labels: (N,) their patch, negative = unassigned, not scored.
        truth_points: (M, 3) points of the truth; truth_labels: (M,) their patch.
        taus: thresholds, unit lengths.

    Returns:
        A `Score` per threshold.
    """
    predicted, truth = split(points, labels), split(truth_points, truth_labels)
    cutoff = max(taus)
    forward = mean_distances(predicted, truth, cutoff)  # (S, G)
    backward = mean_distances(truth, predicted, cutoff).T  # (S, G)
    return {tau: score_distances(forward, backward, tau) for tau in taus}


def split(points: NDArray[np.floating], labels: NDArray[np.integer]) -> list[Array]:
    """One (n, 3) array per label that occurs, in the order of the labels; negative labels are left out."""
    points, labels = np.asarray(points, float), np.asarray(labels)
    keep = labels >= 0
    points, labels = points[keep], labels[keep]
    order = np.argsort(labels, kind="stable")
    starts = np.unique(labels[order], return_index=True)[1]
    return np.split(points[order], starts[1:]) if len(order) else []


def mean_distances(sources: Sequence[Array], targets: Sequence[Array], cutoff: float = np.inf) -> Array:
    """(S, G) mean distance from every point of a source to its nearest point of a target (paper, section 4.2).

    A pair whose bounding boxes alone keep the mean above `cutoff` is infinite: it cannot match.
    """
    distances = np.full((len(sources), len(targets)), np.inf)
    for j, target in enumerate(targets):
        low, high = target.min(axis=0), target.max(axis=0)
        tree: cKDTree | None = None
        for i, source in enumerate(sources):
            to_box = np.maximum(np.maximum(low - source, source - high), 0)  # (n, 3)
            if np.linalg.norm(to_box, axis=1).mean() > cutoff:
                continue
            tree = tree or cKDTree(target)
            distances[i, j] = tree.query(source)[0].mean()
    return distances


def score_distances(forward: Array, backward: Array, tau: float) -> Score:
    """Scores at one threshold.

    Args:
        forward: (S, G) D(S_i, G_j); backward: (S, G) D(G_j, S_i).
        tau: threshold.
    """
    predicted, true = forward.shape
    if predicted == 0 and true == 0:
        return Score(np.nan, np.nan, np.nan, np.nan)
    if predicted == 0 or true == 0:
        return Score(0.0 if predicted else np.nan, 0.0 if true else np.nan, 0.0, 0.0)
    precision = float((forward.min(axis=1) <= tau).mean())
    recall = float((backward.min(axis=0) <= tau).mean())
    f1 = 2 * precision * recall / (precision + recall) if precision + recall > 0 else 0.0
    strict = 2 * len(match(np.maximum(forward, backward), tau)) / (predicted + true)
    return Score(precision, recall, f1, strict)


def match(symmetric: Array, tau: float) -> list[tuple[int, int]]:
    """The largest one-to-one assignment of pairs at most `tau` apart, of least total distance.

    Args:
        symmetric: (S, G) the larger of the two directed distances.
        tau: threshold.
    """
    never = (min(symmetric.shape) + 1) * max(tau, np.finfo(float).tiny)  # dearer than all allowed pairs together
    rows, columns = linear_sum_assignment(np.where(symmetric <= tau, symmetric, never))
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if symmetric[i, j] <= tau]


def columns(prefix: str, scores: dict[float, Score], paper_tau: float = PAPER_TAU) -> dict[str, float]:
    """Columns of `metrics.csv`: precision, recall and F1 at the paper's tau, F1 and strict F1 at every tau."""
    paper = scores[paper_tau]
    row = {
        f"{prefix}_precision_{suffix(paper_tau)}": paper.precision,
        f"{prefix}_recall_{suffix(paper_tau)}": paper.recall,
    }
    row |= {f"{prefix}_f1_{suffix(tau)}": score.f1 for tau, score in scores.items()}
    row |= {f"{prefix}_strict_f1_{suffix(tau)}": score.strict_f1 for tau, score in scores.items()}
    return row


def suffix(tau: float) -> str:
    """`008` for 0.08."""
    return f"{round(tau * 100):03d}"
