"""Least-squares and robust fits of one kind of surface, and RANSAC over several kinds."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.fit_refine import PARAMETERS, refine
from brepgaussian.geometry.fit_start import MINIMUM, starts
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEVER = 0.1  # patch extents that one radian of normal error counts when starts are compared
TUKEY = 4.685  # of Tukey's biweight: 95 % efficiency on Gaussian residuals
MAD_TO_SIGMA = 1.4826
ROUNDS = 4  # of reweighting
WRONG_SIDE = np.radians(40.0)  # a normal further off belongs to another face, whatever the noise
MAX_TRIED = 2000  # points that starts are judged on; more change no ranking
SUBSETS = 10  # small random subsets tried as starts of a robust fit
REFINED_STARTS = 3
TRUSTED = 0.7  # share of the points that ranks robust starts: the worst 30 % may be anything
_SMALL = 1e-12


def fit(
    kind: str, points: Array, normals: Array, weights: Array | None = None, initial: Surface | None = None
) -> Surface:
    """Least-squares surface of one kind, oriented by the normals.

    Args:
        kind: plane, cylinder, sphere, cone or torus.
        points: (N, 3).
        normals: (N, 3) outward unit normals; they start the fit and orient its result.
        weights: (N,) non-negative, or None for ones.
        initial: start; without it closed-form guesses are tried.

    Raises:
        ValueError: too few points, or points that determine no surface of this kind.
    """
    points, normals = _checked(kind, points, normals)
    candidates = [initial] if initial is not None else list(starts(kind, points, normals, weights))
    ranked = _ranked(candidates, points, normals, weights)
    fitted = [refine(s, points, weights) for s in ranked[: 1 if kind == "plane" else REFINED_STARTS]]
    if not fitted:
        raise ValueError(f"the points determine no {kind}")
    return oriented(_ranked(fitted, points, normals, weights)[0], points, normals)


def fit_robust(
    kind: str,
    points: Array,
    normals: Array,
    sigma: float = 0.0,
    initial: Surface | None = None,
    rng: np.random.Generator | None = None,
    free: Sequence[int] | None = None,
) -> tuple[Surface, Mask]:
    """Fit that ignores outliers: starts from subsets, then Tukey reweighting.

    Args:
        kind: plane, cylinder, sphere, cone or torus.
        points: (N, 3).
        normals: (N, 3) outward unit normals.
        sigma: noise of the points; the scale of the residuals is never taken as smaller.
        initial: start; without it closed-form guesses of all points and of subsets compete.
        rng: source of the subsets; a fixed one by default.
        free: as in `refine`; the other parameters stay as in `initial`.

    Returns:
        The surface and the (N,) mask of its inliers (Tukey weight above zero, normal on the right side).

    Raises:
        ValueError: as `fit`.
    """
    points, normals = _checked(kind, points, normals)
    rng = np.random.default_rng(0) if rng is None else rng
    few, few_normals = _thinned(points, normals)
    candidates = [initial] if initial is not None else list(_subset_starts(kind, few, few_normals, rng))
    if not candidates:
        raise ValueError(f"the points determine no {kind}")
    ranked = _ranked(candidates, few, few_normals, None, TRUSTED)
    keep = 1 if kind == "plane" or initial is not None else REFINED_STARTS
    if keep > 1:  # a few steps tell which start is good
        short = [_reweighted(s, few, few_normals, sigma, free, rounds=1) for s in ranked[:keep]]
        ranked = _ranked(short, few, few_normals, None, TRUSTED)
    best = _reweighted(ranked[0], few, few_normals, sigma, free)
    if len(few) < len(points):
        best = _reweighted(best, points, normals, sigma, free, rounds=1)
    best = oriented(best, points, normals)
    return best, _tukey(best, points, normals, sigma) > 0


def ransac(
    points: Array,
    normals: Array,
    kinds: Sequence[str],
    tolerance: float,
    angle: float,
    rng: np.random.Generator,
    iterations: int = 100,
    confidence: float = 0.99,
) -> tuple[Surface | None, Mask]:
    """The surface with the most inliers among several kinds, refitted to them.

    Args:
        points: (N, 3).
        normals: (N, 3) outward unit normals.
        kinds: the kinds tried, the simplest first: a later kind must hold more points than its extra
            parameters are worth.
        tolerance: largest distance of an inlier.
        angle: largest angle (radians) between an inlier's normal and the surface's.
        rng: source of the samples.
        iterations: most samples of one kind.
        confidence: stop when a better sample is as improbable as 1 - confidence.

    Returns:
        Surface (None if no kind found a sample) and the (N,) mask of its inliers.
    """
    points, normals = np.asarray(points, float), np.asarray(normals, float)
    few, few_normals = _thinned(points, normals)
    best: Surface | None = None
    best_mask, best_score = np.zeros(len(points), bool), 0.0
    for kind in kinds:
        if len(points) < max(MINIMUM[kind], 2):
            continue
        sample = _best_sample(kind, few, few_normals, tolerance, angle, rng, iterations, confidence)
        if sample is None:
            continue
        surface, mask = _grown(sample, points, normals, tolerance, angle)
        score = float(mask.sum()) * (1 - 0.02 * PARAMETERS[kind])
        if score > best_score:
            best, best_mask, best_score = surface, mask, score
    return best, best_mask


def residuals(surface: Surface, points: Array, normals: Array) -> tuple[Array, Array]:
    """(N,) unsigned distances and (N,) angles in radians between oriented normals."""
    cosine = np.einsum("ij,ij->i", surface.normals(points), normals)
    return np.abs(surface.signed_distance(points)), np.arccos(np.clip(cosine, -1, 1))


def inliers(surface: Surface, points: Array, normals: Array, tolerance: float, angle: float) -> Mask:
    """(N,) points within a distance and an angle (radians) of an oriented surface."""
    distance, turn = residuals(surface, points, normals)
    return (distance <= tolerance) & (turn <= angle)


def oriented(surface: Surface, points: Array, normals: Array) -> Surface:
    """The surface with the outward side that most normals point to; a plane by its axis, never flipped."""
    outward = float(np.median(np.einsum("ij,ij->i", surface.normals(points), normals))) >= 0
    if not outward:
        surface = surface.flip()
    if surface.kind == "plane" and surface.flipped:
        surface = Surface("plane", surface.origin, -surface.axis)
    return surface


def _checked(kind: str, points: Array, normals: Array) -> tuple[Array, Array]:
    points, normals = np.asarray(points, float), np.asarray(normals, float)
    if points.shape != normals.shape or points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points {points.shape} and normals {normals.shape} must both be (N, 3)")
    if len(points) < MINIMUM[kind]:
        raise ValueError(f"a {kind} needs {MINIMUM[kind]} points with normals, not {len(points)}")
    return points, normals


def _thinned(points: Array, normals: Array) -> tuple[Array, Array]:
    step = -(-len(points) // MAX_TRIED)
    return points[::step], normals[::step]


def _ranked(
    candidates: Iterable[Surface], points: Array, normals: Array, weights: Array | None, trusted: float = 1.0
) -> list[Surface]:
    """Candidates by distance and normal agreement, best first; `trusted` < 1 looks at that quantile only."""
    share = np.full(len(points), 1 / len(points)) if weights is None else weights / max(weights.sum(), _SMALL)
    extent = float(np.sqrt(share @ ((points - share @ points) ** 2).sum(1)))
    scores = []
    candidates = list(candidates)
    for surface in candidates:
        distance, turn = residuals(oriented(surface, points, normals), points, normals)
        error = distance**2 + (LEVER * extent * turn) ** 2
        scores.append(float(share @ error) if trusted >= 1 else float(np.quantile(error, trusted)))
    return [candidates[i] for i in np.argsort(scores, kind="stable")]


def _subset_starts(kind: str, points: Array, normals: Array, rng: np.random.Generator) -> Iterable[Surface]:
    if kind == "plane":
        yield from _plane_starts(points, normals)
        return
    yield from starts(kind, points, normals)
    size = min(len(points), 3 * MINIMUM[kind] + 3)
    for _ in range(SUBSETS if size < len(points) else 0):
        chosen = rng.choice(len(points), size, replace=False)
        for surface in starts(kind, points[chosen], normals[chosen]):
            yield surface
            break


def _plane_starts(points: Array, normals: Array) -> Iterable[Surface]:
    """The median normal through the median height: no wrong label turns it."""
    median = np.median(normals, axis=0)
    length = float(np.linalg.norm(median))
    axis = median / length if length > _SMALL else normals[0]
    height = float(np.median(points @ axis))
    middle = np.median(points, axis=0)
    yield Surface("plane", middle + (height - middle @ axis) * axis, axis)


def _reweighted(
    surface: Surface,
    points: Array,
    normals: Array,
    sigma: float,
    free: Sequence[int] | None = None,
    rounds: int = ROUNDS,
) -> Surface:
    for number in range(rounds):
        weights = _tukey(surface, points, normals, sigma)
        if np.count_nonzero(weights) < PARAMETERS[surface.kind]:
            return surface
        surface = refine(surface, points, weights, iterations=8 if number + 1 < rounds else 20, free=free)
    return surface


def _tukey(surface: Surface, points: Array, normals: Array, sigma: float) -> Array:
    """(N,) Tukey weights of the distances; zero where the normal belongs to another face."""
    distance, turn = residuals(oriented(surface, points, normals), points, normals)
    aligned = turn < max(WRONG_SIDE, 2 * float(np.median(turn)))
    if not aligned.any():
        return np.zeros(len(points))
    scale = max(sigma, MAD_TO_SIGMA * float(np.median(distance[aligned])), _SMALL)
    ratio = np.minimum(distance / (TUKEY * scale), 1)
    return np.where(aligned, (1 - ratio**2) ** 2, 0.0)


def _best_sample(
    kind: str,
    points: Array,
    normals: Array,
    tolerance: float,
    angle: float,
    rng: np.random.Generator,
    iterations: int,
    confidence: float,
) -> Surface | None:
    """The minimal sample (plus one point for noise) that holds the most points, near ones counting more."""
    best, best_score, needed = None, 0.0, float(iterations)
    size = min(len(points), MINIMUM[kind] + (0 if kind == "plane" else 1))
    done = 0
    while done < min(needed, iterations):
        done += 1
        chosen = rng.choice(len(points), size, replace=False)
        for surface in starts(kind, points[chosen], normals[chosen]):
            candidate = oriented(surface, points[chosen], normals[chosen])
            distance, turn = residuals(candidate, points, normals)
            near = (distance <= tolerance) & (turn <= angle)
            score = float((1 - (distance[near] / max(tolerance, _SMALL)) ** 2).sum())
            if score > best_score:
                best, best_score = candidate, score
                share = min(max(float(near.mean()), 1e-3), 1 - 1e-9)
                needed = max(np.log(1 - confidence) / np.log(1 - share**size + 1e-15), 3.0)
            break  # the first guess of a sample is its best; more samples pay more than more guesses
    return best


def _grown(surface: Surface, points: Array, normals: Array, tolerance: float, angle: float) -> tuple[Surface, Mask]:
    """Refit to the inliers until their number stops growing."""
    mask = inliers(surface, points, normals, tolerance, angle)
    for _ in range(3):
        if mask.sum() < PARAMETERS[surface.kind]:
            break
        candidate = oriented(refine(surface, points[mask], iterations=10), points[mask], normals[mask])
        grown = inliers(candidate, points, normals, tolerance, angle)
        if grown.sum() < mask.sum():
            break
        more = grown.sum() > mask.sum()
        surface, mask = candidate, grown
        if not more:
            break
    return surface, mask
