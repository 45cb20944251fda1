"""Edge instances: the curves in which the primitives of neighbouring patches meet, walked step by step."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.geometry.surfaces import Surface
from brepgaussian.points.graph import Index

Array = NDArray[np.float64]
SHARP = np.sin(np.radians(8.0))  # patches that meet at less are tangent: no edge (an edge is sharp from 10 degrees)
_NEWTON_STEPS = 6
_CONVERGED = 1e-9  # unit frame; a further step would change nothing that a file keeps
_ON_CURVE = 1e-5  # unit frame; a point this near to both surfaces lies on their curve
_BORDER = 2.2  # spacings from a point to the nearest one of the other patch
_SUPPORT = 2.0  # spacings from a curve to the border points that support it
_REACH = 3.5  # spacings beyond the last support where a third patch may end the curve
_TOUCH = 0.1  # spacings from a third patch that a curve touches without crossing it
_SHIFT = 2.0  # spacings from a border point to the curve that it stands for
_LEAST_SHARP = 0.5  # share of a border that lies by the curve: where it is less, the patches are tangent
_GAP = 8.0  # spacings without support that a curve may bridge
_LEAST_DENSITY = 0.7  # border points per spacing of length
_LEAST_SUPPORT = 4  # border points
_MOST_STEPS = 4000
_SHORTEST = 1.5  # spacings


@dataclass(frozen=True)
class Curve:
    """One edge instance.

    Attributes:
        points: (S, 3) ordered; pair: its two patches; closed: whether it is a loop.
        shown: share of the views seeing it that show an edge there; NaN = not looked at.
        scatter: by how much the views differ about where that edge is, px.
    """

    points: Array
    pair: tuple[int, int]
    closed: bool
    shown: float = np.nan
    scatter: float = 0.0


def find_curves(xyz: Array, labels: Index, surfaces: list[Surface], spacing: float, step: float) -> list[Curve]:
    """All sharp curves between neighbouring patches.

    Args:
        xyz: (N, 3) labelled points; labels: (N,) patch of each, -1 = none.
        surfaces: primitive of each patch.
        spacing: typical distance between neighbouring points.
        step: distance between the points of a curve.
    """
    borders = _border_points(xyz, labels, _BORDER * spacing)
    trees = {k: cKDTree(xyz[labels == k]) for k in range(len(surfaces)) if (labels == k).any()}
    curves: list[Curve] = []
    for (a, b), points in borders.items():
        on, valid = project(points, surfaces[a], surfaces[b])
        valid &= np.linalg.norm(on - points, axis=1) < _SHIFT * spacing
        if valid.mean() >= _LEAST_SHARP:
            curves += _walk_all(on[valid], (a, b), surfaces, trees, spacing, step)
    return curves


def _border_points(xyz: Array, labels: Index, reach: float) -> dict[tuple[int, int], Array]:
    """Midpoints between points of two patches that lie within reach of each other, per pair of patches."""
    tree = cKDTree(xyz)
    k = min(16, len(xyz))
    distance, index = tree.query(xyz, k=k, distance_upper_bound=reach)
    rows, columns = np.nonzero(np.isfinite(distance.reshape(len(xyz), k)))
    i, j = rows, index.reshape(len(xyz), k)[rows, columns]
    cross = (labels[i] != labels[j]) & (labels[i] >= 0) & (labels[j] >= 0) & (i < j)
    i, j = i[cross], j[cross]
    low, high = np.minimum(labels[i], labels[j]), np.maximum(labels[i], labels[j])
    middle = (xyz[i] + xyz[j]) / 2
    borders = {}
    count = int(labels.max(initial=0)) + 1
    key = low * count + high
    for value in np.unique(key).tolist():
        borders[divmod(value, count)] = middle[key == value]
    return borders


def project(points: Array, one: Surface, other: Surface) -> tuple[Array, NDArray[np.bool_]]:
    """Nearest points on the intersection of two surfaces by Newton's method; (N,) whether they are on it."""
    points = points.copy()
    for step in range(_NEWTON_STEPS + 1):
        (f1, n1), (f2, n2) = one.field(points), other.field(points)
        cosine = np.einsum("nc,nc->n", n1, n2)
        off = np.maximum(np.abs(f1), np.abs(f2))
        if step == _NEWTON_STEPS or (off < _CONVERGED).all():
            break
        det = np.maximum(1 - cosine**2, 1e-4)
        c1, c2 = (f1 - cosine * f2) / det, (f2 - cosine * f1) / det
        points -= c1[:, None] * n1 + c2[:, None] * n2
    sharp = 1 - cosine**2 > SHARP**2
    return points, sharp & (off < _ON_CURVE)


def _along(point: Array, one: Surface, other: Surface) -> tuple[Array, float]:
    """(3,) tangent of the intersection of two surfaces at a point (3,) on it, and the sine of their angle."""
    (a, b, c), (u, v, w) = one.normals(point[None])[0].tolist(), other.normals(point[None])[0].tolist()
    tangent = np.array((b * w - c * v, c * u - a * w, a * v - b * u))  # np.cross takes ten times as long
    sine = math.sqrt(float(tangent @ tangent))
    return tangent / (sine or 1.0), sine


def _walk_all(
    on: Array, pair: tuple[int, int], surfaces: list[Surface], trees: dict[int, cKDTree], spacing: float, step: float
) -> list[Curve]:
    """Walk from a border point not yet passed, until all are passed."""
    curves: list[Curve] = []
    left = np.ones(len(on), bool)
    if not len(on):
        return curves
    support = cKDTree(on)
    crowd = support.query(on, k=min(4, len(on)))[0].reshape(len(on), -1)[:, -1]
    reach = _SUPPORT * spacing
    while left.any():
        start = int(np.argmin(np.where(left, crowd, np.inf)))  # where the border is densest, not at a stray point
        path, closed = walk(on[start], surfaces[pair[0]], surfaces[pair[1]], support, reach, _GAP * spacing, step)
        passed = left & (cKDTree(path).query(on)[0] < reach)
        passed[start] = True
        left &= ~passed
        supported = support.query(path)[0] < reach
        for piece, whole in _pieces(path, supported, closed, pair, surfaces, trees, spacing):
            count = int((cKDTree(piece).query(on[passed])[0] < reach).sum())
            if count < _LEAST_SUPPORT:
                continue
            if not whole:
                piece = _trim(piece, pair, surfaces, trees, on, spacing, step)
            length = np.linalg.norm(np.diff(piece, axis=0), axis=1).sum()
            if len(piece) >= 2 and length >= _SHORTEST * spacing and count >= _LEAST_DENSITY * length / spacing:
                curves.append(Curve(piece, pair, whole))
    return curves


def _pieces(
    path: Array, supported: NDArray[np.bool_], closed: bool, pair: tuple[int, int], surfaces: list[Surface],
    trees: dict[int, cKDTree], spacing: float,
) -> list[tuple[Array, bool]]:  # fmt: skip
    """Cut a path at the stretches without support that a third patch crosses; others are gaps in the points."""
    bridged = supported.copy()
    count = len(path)
    if supported.all() or not supported.any():
        return [(path, closed)]
    shift = int(np.flatnonzero(supported)[0]) if closed else 0
    order = np.roll(np.arange(count), -shift)  # a closed path then starts with support
    flags = supported[order]
    runs = np.flatnonzero(np.diff(np.concatenate([[0], (~flags).astype(int), [0]])))
    for first, last in runs.reshape(-1, 2):
        index = np.arange(first - 1, last + 1)
        index = order[index % count] if closed else order[np.clip(index, 0, count - 1)]
        if not _crossed(path[index], pair, surfaces, trees, spacing):
            bridged[index] = True
    if bridged.all():
        return [(path, closed)]
    shift = int(np.flatnonzero(~bridged)[0]) if closed else 0
    order = np.roll(np.arange(count), -shift)
    flags = bridged[order]
    spans = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]]))).reshape(-1, 2)
    return [(path[order[first:last]], False) for first, last in spans.tolist()]


def _crossed(
    stretch: Array, pair: tuple[int, int], surfaces: list[Surface], trees: dict[int, cKDTree], spacing: float
) -> bool:
    """Whether a third patch, present there, crosses a stretch of a path."""
    for k, tree in trees.items():
        if k in pair or not (tree.query(stretch)[0] < 2 * _BORDER * spacing).any():
            continue
        value = surfaces[k].signed_distance(stretch)
        if (value[:-1] * value[1:] <= 0).any():
            return True
    return False


def walk(
    start: Array, one: Surface, other: Surface, support: cKDTree, reach: float, gap: float, step: float
) -> tuple[Array, bool]:
    """Walk along the intersection of two surfaces from a point on it, both ways, as far as there is support.

    Args:
        start: (3,) on both surfaces.
        one, other: the surfaces.
        support: border points; reach: distance at which they support the path.
        gap: length without support after which the walk stops.
        step: distance between the points of the path.

    Returns:
        (S, 3) ordered points, the ends supported, and whether they close.
    """
    halves = []
    for sign in (1.0, -1.0):
        path = [start]
        last = 0
        heading: Array | None = None
        while len(path) < _MOST_STEPS and (len(path) - 1 - last) * step <= gap:
            here = path[-1]
            tangent, sine = _along(here, one, other)
            if sine < SHARP / 2:
                break
            if heading is None:
                tangent = sign * tangent
            elif tangent @ heading < 0:
                tangent = -tangent
            heading = tangent
            there, valid = project((here + step * tangent)[None], one, other)
            if not valid[0] or np.linalg.norm(there[0] - here) > 2 * step:
                break
            path.append(there[0])
            if support.query(there[0], distance_upper_bound=reach)[0] < np.inf:
                last = len(path) - 1
            if len(path) > 6 and np.linalg.norm(there[0] - start) < 0.75 * step:
                return np.array(path[:-1]), True
        halves.append(path[: last + 1])
    return np.array(halves[1][:0:-1] + halves[0]), False


def _trim(
    path: Array, pair: tuple[int, int], surfaces: list[Surface], trees: dict[int, cKDTree], on: Array, spacing: float,
    step: float,
) -> Array:  # fmt: skip
    """End an open curve where a third patch crosses it; else at its last support."""
    one, other = surfaces[pair[0]], surfaces[pair[1]]
    for _ in range(2):  # one end, then the other
        tail = extended(path, one, other, _REACH * spacing, step)
        length = len(path)
        whole = np.concatenate([path, tail])
        window = max(0, length - 1 - int(2 * _REACH * spacing / step))
        middle = min(max(window, length // 2), length - 1)
        best, best_off = None, np.inf
        for k, tree in trees.items():
            if k in pair:
                continue
            near = tree.query(whole[middle:])[0] < 2 * _BORDER * spacing
            if not near.any():
                continue
            value = surfaces[k].signed_distance(whole[middle:])
            for c, t in _meetings(value, near, _TOUCH * spacing):
                off = abs(middle + c + t - (length - 1 - _SUPPORT * spacing / step / 2))
                if off < best_off:
                    corner = whole[middle + c] * (1 - t) + whole[middle + c + 1] * t
                    best, best_off = (middle + int(c), corner), off
        if best is not None:
            path = np.concatenate([whole[: best[0] + 1], best[1][None]])
        else:
            keep = cKDTree(on).query(path)[0] < spacing
            last = int(np.flatnonzero(keep)[-1]) if keep.any() else length - 1
            path = path[: last + 1]
        path = path[::-1]
        if len(path) < 2:
            break
    return path


def _meetings(value: Array, near: NDArray[np.bool_], touch: float) -> Iterator[tuple[int, float]]:
    """Steps of a path, and shares of them, at which it crosses a patch or touches it: (S,) distances from that."""
    crossed = (value[:-1] * value[1:] <= 0) & near[:-1]
    for c in np.flatnonzero(crossed):
        yield int(c), float(value[c] / (value[c] - value[c + 1])) if value[c] != value[c + 1] else 0.0
    off = np.abs(value)
    least = (off[1:-1] <= off[:-2]) & (off[1:-1] < off[2:]) & (off[1:-1] < touch) & near[1:-1]
    yield from ((int(c) + 1, 0.0) for c in np.flatnonzero(least) if not crossed[c : c + 2].any())


def extended(path: Array, one: Surface, other: Surface, reach: float, step: float) -> Array:
    """(S, 3) points by which a path (N, 3) on two surfaces goes on past its end, as far as `reach`."""
    tail: list[Array] = []
    here = path[-1]
    heading = path[-1] - path[-2] if len(path) > 1 else None
    while len(tail) * step < reach:
        tangent, sine = _along(here, one, other)
        if sine < SHARP / 2 or heading is None:
            break
        tangent = tangent * (1 if tangent @ heading > 0 else -1)
        there, valid = project((here + step * tangent)[None], one, other)
        if not valid[0]:
            break
        here, heading = there[0], tangent
        tail.append(here)
    return np.array(tail).reshape(-1, 3)
