"""Contrastive losses between rendered patch features, with their gradients (paper, section 3.3)."""

import numpy as np
from numpy.typing import NDArray

Features = NDArray[np.float32]


def normalised(features: Features) -> tuple[Features, Features]:
    """Rows of unit length (the paper's f~), and the lengths (P, 1)."""
    length = np.maximum(np.linalg.norm(features, axis=1, keepdims=True), 1e-8)
    return features / length, length


def through_normalisation(gradient: Features, unit: Features, length: Features) -> Features:
    """Gradient with respect to features before they were normalised."""
    return (gradient - (gradient * unit).sum(axis=1, keepdims=True) * unit) / length


def positives(patches: NDArray[np.int16], rng: np.random.Generator) -> NDArray[np.intp]:
    """(P,) another sample of each sample's own region; itself where it is alone."""
    order = np.lexsort((rng.random(len(patches)), patches))  # regions together, shuffled inside
    groups = patches[order]
    first = np.searchsorted(groups, groups, "left")
    size = np.searchsorted(groups, groups, "right") - first
    following = first + (np.arange(len(patches)) - first + 1) % size  # a cycle through the region
    result = np.empty(len(patches), np.intp)
    result[order] = order[following]
    return result


def region_weights(patches: NDArray[np.int16]) -> Features:
    """(P,) weights that sum to one, each region's samples sharing an equal part: T has one triplet a mask."""
    _, inverse, counts = np.unique(patches, return_inverse=True, return_counts=True)
    return (1 / (counts[inverse] * len(counts))).astype(np.float32)


def triplet(
    unit: Features, patches: NDArray[np.int16], margin: float, rng: np.random.Generator
) -> tuple[float, Features]:
    """L_tri with the hardest negative among all samples of other regions, and its gradient (P, D).

    max(0, d(a, p) - d(a, n) + m) with the cosine distance d = 1 - f_a . f_b.
    """
    similarity = unit @ unit.T
    others = np.where(patches[:, None] == patches[None], np.float32(-2), similarity)
    negative, positive = others.argmax(axis=1), positives(patches, rng)
    rows = np.arange(len(unit))
    hinge = similarity[rows, negative] - similarity[rows, positive] + margin
    active = (hinge > 0) & (positive != rows) & (others[rows, negative] > -2)
    weights = region_weights(patches) * active
    gradient = weights[:, None] * (unit[negative] - unit[positive])
    _scatter(gradient, negative, weights[:, None] * unit)
    _scatter(gradient, positive, -weights[:, None] * unit)
    return float((weights * hinge).sum()), gradient


def pairwise(
    unit: Features, patches: NDArray[np.int16], margin: float, rng: np.random.Generator
) -> tuple[float, Features]:
    """The ablation without triplets: d(a, p) + max(0, m - d(a, n)) with random, not hardest, negatives."""
    positive = positives(patches, rng)
    rows, negative = np.arange(len(unit)), rng.integers(len(unit), size=len(unit))
    near = 1 - (unit * unit[positive]).sum(axis=1)
    far = 1 - (unit * unit[negative]).sum(axis=1)
    weights = region_weights(patches)
    pull = weights * (positive != rows)
    push = weights * ((far < margin) & (patches != patches[negative]))
    gradient = push[:, None] * unit[negative] - pull[:, None] * unit[positive]
    _scatter(gradient, positive, -pull[:, None] * unit)
    _scatter(gradient, negative, push[:, None] * unit)
    return float((pull * near + push * (margin - far)).sum()), gradient


def _scatter(target: Features, rows: NDArray[np.intp], values: Features) -> None:
    """Add values to rows, which may repeat, in a fixed order."""
    for column in range(target.shape[1]):
        target[:, column] += np.bincount(rows, values[:, column], len(target)).astype(target.dtype)


LOSSES = {"triplet": triplet, "pairwise": pairwise}
