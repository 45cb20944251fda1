"""One Gauss-Newton step of all surfaces: robust weights, dense normal equations, prior, constraints."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.refine.constraints import Row
from brepgaussian.brep.refine.observe import Found
from brepgaussian.brep.refine.parameters import COUNT, derivative, difference, prior_sigmas, update
from brepgaussian.brep.refine.samples import pose_rows
from brepgaussian.brep.refine.soundings import Soundings
from brepgaussian.brep.refine.visibility import CREASE, KINDS, OCCLUDING, SILHOUETTE, Seen
from brepgaussian.brep.structure import CONCAVE, Edge, Structure
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.geometry.fit_robust import MAD_TO_SIGMA, TUKEY
from brepgaussian.geometry.rows import distinct
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]

_REWEIGHTINGS = 4  # per linearisation
# Errors that the samples of one edge have in common, px: display curve, shading, what lies behind.
_BIAS = {SILHOUETTE: 0.002, CREASE: 0.02, OCCLUDING: 0.05}
_LOWEST = 0.02  # sine of the angle between two faces whose crease is as low as any
_CONCAVE_BIAS = 0.4  # light between two faces shifts concave edges by a quarter to half a pixel
_ROW_SIGMA = 1e-7  # of constraints (radians, unit frame): as good as exact beside 1e-5 from the images
TONES = 2
TONE_STEP = 50.0  # grey levels
_TONE_SIGMA = 0.3  # px, prior of the tone coefficient
_HELD = 0.03  # of the prior's sigmas: a tenth of a pixel
POSE_SIGMA = (1.0, 1.0, 2e-3)  # prior of a pose correction: px, px, rad


@dataclass(frozen=True)
class State:
    """What is solved for.

    Attributes:
        surfaces: all surfaces.
        tone: (2,) px by which the brighter side of a step of `TONE_STEP` grey levels seems to grow, at creases
            and at occluding edges (light and its display curve are not linear; what lies behind differs).
        poses: (V, 3) image corrections du, dv (px), roll (rad).
    """

    surfaces: tuple[Surface, ...]
    tone: Array
    poses: Array


@dataclass(frozen=True)
class Prior:
    """The state that the points gave, and how far it is trusted (rad, unit frame); what is `held`, much more."""

    surfaces: tuple[Surface, ...]
    angle: float
    length: float
    held: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Step:
    """Outcome of one step.

    Attributes:
        state: the new state.
        largest: largest parameter step over its prior sigma.
        covariance: (P, P) formal covariance of the surfaces' parameters.
        start: (S + 1,) first parameter of each surface.
    """

    state: State
    largest: float
    covariance: Array
    start: NDArray[np.int64]


def residuals(seen: Seen, found: Found, tone: Array) -> Array:
    """(R,) px from the predicted edge to the measured one, less the tone's share."""
    return found.offset - tone_columns(seen, found) @ tone


def tone_columns(seen: Seen, found: Found) -> Array:
    """(R, 2) how much of each tone coefficient an edge sees; nothing for silhouettes."""
    step = found.step[:, None] / TONE_STEP
    return step * (seen.kind[:, None] == np.array([CREASE, OCCLUDING]))


def step(
    state: State,
    prior: Prior,
    seen: Seen,
    found: Found,
    structure: Structure,
    cameras: Cameras,
    rows: Sequence[Row],
    free_poses: bool,
    soundings: Soundings | None = None,
) -> Step:
    """Solve the linearised problem with iterated Tukey weights and move the surfaces."""
    start = np.concatenate([[0], np.cumsum([COUNT[s.kind] for s in state.surfaces])]).astype(int)
    tone_at, pose_at = start[-1], start[-1] + TONES
    size = pose_at + (3 * len(cameras) if free_poses else 0)
    used = np.nonzero(np.isfinite(found.offset))[0]
    problem = _Problem(state, seen, found, used, start, cameras, size, free_poses)
    fixed, target = _fixed_rows(state, prior, start, size, rows, free_poses)
    offset = residuals(seen, found, state.tone)[used]
    sigma, bias = found.sigma[used], _biases(seen, structure, state.surfaces)[used]
    kind, group = seen.kind[used], seen.rays.group[used]
    delta, matrix = np.zeros(size), fixed
    for _ in range(_REWEIGHTINGS):
        now = offset - problem.predict(delta)
        weight = _capped(_weights(now / sigma, kind, group) / sigma**2, group, kind, bias)
        matrix, right = problem.normal(weight, offset)
        matrix += fixed
        if soundings is not None:
            below = soundings.normal(state.surfaces, start, size, delta)
            matrix, right = matrix + below[0], right + below[1]
        delta = np.linalg.solve(matrix, right + target)
    surfaces = tuple(update(s, delta[a:b]) for s, a, b in zip(state.surfaces, start[:-1], start[1:], strict=True))
    poses = state.poses + (delta[pose_at:].reshape(-1, 3) if free_poses else 0.0)
    scale = np.concatenate([prior_sigmas(s.kind, prior.angle, prior.length) for s in state.surfaces])
    largest = float(np.abs(delta[: start[-1]] / scale).max(initial=0.0))
    return Step(
        State(surfaces, state.tone + delta[tone_at:pose_at], poses),
        largest,
        np.asarray(np.linalg.inv(matrix)[: start[-1], : start[-1]], np.float64),
        start,
    )


def _biases(seen: Seen, structure: Structure, surfaces: Sequence[Surface]) -> Array:
    """(R,) px, error that all samples of an edge may have in common.

    What else changes the light beside a crease shifts its step by more, the lower that step is.
    """
    faces = len(structure.faces)
    concave = np.array([e.convexity == CONCAVE for e in structure.edges] + [False] * faces)
    heights = np.array([_height(e, surfaces) for e in structure.edges] + [1.0] * faces)
    common = np.array([_BIAS[k] for k in range(len(KINDS))])[seen.kind]
    common = common / np.where(seen.kind == CREASE, heights[seen.rays.group], 1.0)
    return np.where(concave[seen.rays.group] & (seen.kind != SILHOUETTE), _CONCAVE_BIAS, common)


def _height(edge: Edge, surfaces: Sequence[Surface]) -> float:
    """Sine of the angle between the two faces at an edge, in the median along it; 1 where one of them is no surface."""
    if min(edge.surfaces) < 0:
        return 1.0
    one, other = (surfaces[i].normals(edge.polyline) for i in edge.surfaces)
    return max(float(np.median(np.linalg.norm(np.cross(one, other), axis=1))), _LOWEST)


def _capped(weight: Array, group: NDArray, kind: NDArray, bias: Array) -> Array:
    """Weights of an edge scaled so that all its samples together are no surer than their common error."""
    key = group * len(KINDS) + kind
    total = np.bincount(key, weight)[key]
    return weight / (1 + total * bias**2)


def _weights(z: Array, kind: NDArray, group: NDArray) -> Array:
    """Tukey weights of normalised residuals, over the squared robust scale (at least 1) of their kind.

    The cut-off follows the scale of the row's own edge where that is larger: an edge that is off as a whole
    is no outlier.
    """
    weight, size = np.zeros(len(z)), np.abs(z)
    for which in range(len(KINDS)):
        rows = np.flatnonzero(kind == which)
        if len(rows) == 0:
            continue
        scale = max(1.0, MAD_TO_SIGMA * float(np.median(size[rows])))
        reach = TUKEY * np.maximum(scale, MAD_TO_SIGMA * _medians(size[rows], group[rows]))
        weight[rows] = np.clip(1 - (size[rows] / reach) ** 2, 0, None) ** 2 / scale**2
    return weight


def _medians(values: Array, group: NDArray) -> Array:
    """(R,) median of the values of each row's group: thousands of groups are too many for a call each."""
    ordered = values[np.lexsort((values, group))]
    _, inverse, count = np.unique(group, return_inverse=True, return_counts=True)
    first = np.cumsum(count) - count
    median = (ordered[first + (count - 1) // 2] + ordered[first + count // 2]) / 2
    return median[inverse.reshape(-1)]


class _Problem:
    """Linear model of the offsets, in blocks of rows that share their surfaces."""

    def __init__(
        self,
        state: State,
        seen: Seen,
        found: Found,
        used: NDArray,
        start: NDArray,
        cameras: Cameras,
        size: int,
        free_poses: bool,
    ) -> None:
        rays = seen.rays.take(used)
        self._size, self._start, self._free = size, start, free_poses
        self._tone = tone_columns(seen, found)[used]
        self._view, self._pose = rays.view, pose_rows(rays, cameras)
        pairs, inverse, count = distinct(rays.table)
        self._blocks: list[tuple[NDArray, NDArray, Array]] = []  # rows, columns, derivatives
        order = np.argsort(inverse, kind="stable")
        ends = np.cumsum(count)
        for pair, low, high in zip(pairs, ends - count, ends, strict=True):
            rows = order[low:high]
            columns, parts = [], []
            for k, index in enumerate(pair):
                if index >= 0:
                    slope = derivative(state.surfaces[index], rays.points[rows])
                    parts.append(-rays.lever[rows, k, None] * slope)
                    columns.append(np.arange(start[index], start[index + 1]))
            columns.append(start[-1] + np.arange(TONES))
            parts.append(self._tone[rows])
            self._blocks.append((rows, np.concatenate(columns), np.concatenate(parts, axis=1)))

    def predict(self, delta: Array) -> Array:
        """(R,) change of the predicted offsets by a step."""
        result = np.zeros(len(self._tone))
        for rows, columns, slope in self._blocks:
            result[rows] = slope @ delta[columns]
        if self._free:
            result += np.einsum("rk,rk->r", self._pose, delta[self._start[-1] + TONES :].reshape(-1, 3)[self._view])
        return result

    def normal(self, weight: Array, offset: Array) -> tuple[Array, Array]:
        """J^T W J and J^T W r."""
        matrix, right = np.zeros((self._size, self._size)), np.zeros(self._size)
        first = self._start[-1] + TONES
        for rows, columns, slope in self._blocks:
            weighted = slope * weight[rows, None]
            matrix[np.ix_(columns, columns)] += slope.T @ weighted
            right[columns] += weighted.T @ offset[rows]
            if self._free:
                for k in range(3):
                    cross = np.zeros((matrix.shape[0] - first) // 3 * len(columns)).reshape(-1, len(columns))
                    np.add.at(cross, self._view[rows], weighted * self._pose[rows, k, None])
                    matrix[np.ix_(first + k + 3 * np.arange(len(cross)), columns)] += cross
        if self._free:
            matrix[:first, first:] = matrix[first:, :first].T
            views = (self._size - first) // 3
            for k in range(3):
                at = first + k + 3 * np.arange(views)
                right[at] += np.bincount(self._view, weight * self._pose[:, k] * offset, views)
                for m in range(3):
                    product = np.bincount(self._view, weight * self._pose[:, k] * self._pose[:, m], views)
                    matrix[at, first + m + 3 * np.arange(views)] += product
        return matrix, right


def _fixed_rows(
    state: State, prior: Prior, start: NDArray, size: int, rows: Sequence[Row], free_poses: bool
) -> tuple[Array, Array]:
    """Normal equations of prior and constraints."""
    matrix, right = np.zeros((size, size)), np.zeros(size)
    for index, (now, before) in enumerate(zip(state.surfaces, prior.surfaces, strict=True)):
        span = np.arange(start[index], start[index + 1])
        firm = _HELD if index in prior.held else 1.0
        weight = (firm * prior_sigmas(now.kind, prior.angle, prior.length)) ** -2.0
        matrix[span, span] += weight
        right[span] -= weight * difference(before, now)
    span = start[-1] + np.arange(TONES)
    matrix[span, span] += _TONE_SIGMA**-2
    right[span] -= _TONE_SIGMA**-2 * state.tone
    if free_poses:
        span = np.arange(start[-1] + TONES, size)
        weight = np.tile(np.array(POSE_SIGMA) ** -2.0, len(state.poses))
        matrix[span, span] += weight
        right[span] -= weight * state.poses.reshape(-1)
    for columns, value in rows:
        at = np.concatenate([np.arange(start[i], start[i + 1]) for i in columns])
        slope = np.concatenate(list(columns.values())) / _ROW_SIGMA
        matrix[np.ix_(at, at)] += np.outer(slope, slope)
        right[at] -= slope * (value / _ROW_SIGMA)
    return matrix, right
