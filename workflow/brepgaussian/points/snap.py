"""Curves moved onto the edges that the images show: every view measures how far a curve lies beside its edge."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.cameras import Cameras
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.points.curves import Curve
from brepgaussian.points.votes import visible

Array = NDArray[np.float64]
_ROUNDS = 3
_WINDOWS_PX = (6.0, 4.0, 3.0)  # how far beside a curve its edge is searched, per round
_SAMPLE_PX = 0.5
_PEAK_PX = 1.5  # half the width of an edge over which its centre is averaged
_LEAST_EDGE = 64  # of 255
_CENTRE_PULL = 0.6  # of the window: an edge farther off must be stronger
_FORESHORTENED = 0.35  # of a curve's length in the image against its longest: seen end-on it has no side
_MEASURE_PX = 1.0  # standard deviation of one view's measurement
_PRIOR = 0.004  # unit frame; standard deviation of a curve of two fitted surfaces
_OUTLIER_PX = 2.0
_SMOOTH = 0.02  # unit frame; neighbouring samples of a curve share their measurements over this length
_LEAST_VIEWS = 3.0
_MOST = 0.02  # unit frame; the largest shift that is believed
_TANGENT = np.cos(np.radians(15.0))  # curved primitives, as fitted to tangent faces, meet at up to this angle
_SHALLOW = np.cos(np.radians(30.0))  # below it an edge must be seen: true ones are in .9 of the views, false ones in .7
_LEAST_SHOWN = 0.8


@dataclass(frozen=True)
class _Measured:
    """What the views say about points of curves.

    Attributes:
        hessian, gradient: (N, 3, 3), (N, 3) normal equations of the shift of each point.
        seen, found: (N,) how many views see it, and how many an edge beside it.
        energy, weight: (N,) weighted squares of how far the edge lies beside it, px^2, and sum of the weights.
    """

    hessian: Array
    gradient: Array
    seen: Array
    found: Array
    energy: Array
    weight: Array

    @classmethod
    def nothing(cls, count: int) -> "_Measured":
        """No view sees any of them."""
        counts = (np.zeros(count) for _ in range(4))
        return cls(np.zeros((count, 3, 3)), np.zeros((count, 3)), *counts)

    def left(self, shift: Array) -> Array:
        """(N,) the energy that is left after a shift (N, 3)."""
        bent = np.einsum("ni,nij,nj->n", shift, self.hessian, shift)
        return np.asarray(np.maximum(self.energy - 2 * (self.gradient * shift).sum(axis=1) + bent, 0))


def snap(
    curves: list[Curve],
    surfaces: list[Surface],
    cameras: Cameras,
    edges: NDArray[np.uint8],
    dense: Array,
    spacing: float,
) -> list[Curve]:
    """Shift the points of curves across their tangents to where the edge maps have their edges.

    Args:
        curves: on the intersections of their surfaces.
        surfaces: primitive of each label.
        cameras: V views.
        edges: (V, H, W) edge probability, 0..255.
        dense: (M, 3) points that hide others.
        spacing: typical distance between neighbours in `dense`.
    """
    if not curves:
        return curves
    start = np.concatenate([c.points for c in curves])
    sizes = [len(c.points) for c in curves]
    tangents = np.concatenate([_tangents(c) for c in curves])
    facing = [np.concatenate([surfaces[c.pair[k]].normals(c.points) for c in curves]) for k in (0, 1)]
    points = start.copy()
    said, left = _Measured.nothing(len(points)), np.zeros(len(points))
    for window in _WINDOWS_PX[:_ROUNDS]:
        said = _measure(points, tangents, facing, cameras, edges, dense, spacing, window)
        # the prior pulls back to where the surfaces meet; nothing moves along the curve
        prior = np.eye(3) / _PRIOR**2
        along = tangents[:, :, None] * tangents[:, None, :] * 1e9
        shift = np.zeros_like(points)
        first = 0
        for curve, size in zip(curves, sizes, strict=True):
            part = slice(first, first + size)
            kernel = _kernel(curve)
            h, g, n = (
                _blur(values[part], kernel, curve.closed) for values in (said.hessian, said.gradient, said.found)
            )
            g = g + (start[part] - points[part]) @ prior
            move = np.linalg.solve(h + prior + along[part], g[..., None])[..., 0]
            move[n < _LEAST_VIEWS] = 0
            shift[part] = move
            first += size
        left = said.left(shift)
        points = points + shift
        far = np.linalg.norm(points - start, axis=1)
        points = start + (points - start) * np.minimum(1, _MOST / np.maximum(far, 1e-12))[:, None]
    cuts = np.cumsum(sizes)[:-1]
    parts = (np.split(values, cuts) for values in (points, said.seen, said.found, left, said.weight))
    return [
        replace(
            curve,
            points=moved,
            shown=float(found.sum() / seen.sum()) if seen.any() else np.nan,
            scatter=float(np.sqrt(energy.sum() / weight.sum())) if weight.any() else 0.0,
        )
        for curve, moved, seen, found, energy, weight in zip(curves, *parts, strict=True)
    ]


def believed(curves: list[Curve], surfaces: list[Surface]) -> list[Curve]:
    """The curves without those of patches that are tangent: these meet at small angles, where no view shows an edge."""
    kept = []
    for curve in curves:
        one, other = (surfaces[k] for k in curve.pair)
        cosine = float(np.median((one.normals(curve.points) * other.normals(curve.points)).sum(axis=1)))
        tangent = cosine > _TANGENT and (one.kind, other.kind) != ("plane", "plane")
        if not tangent and not (cosine > _SHALLOW and curve.shown < _LEAST_SHOWN):
            kept.append(curve)
    return kept


def _tangents(curve: Curve) -> Array:
    p = curve.points
    step = np.roll(p, -1, axis=0) - np.roll(p, 1, axis=0) if curve.closed else np.gradient(p, axis=0)
    return step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12)


def _kernel(curve: Curve) -> Array:
    step = np.median(np.linalg.norm(np.diff(curve.points, axis=0), axis=1))
    reach = int(min(np.ceil(2 * _SMOOTH / max(step, 1e-9)), max(1, (len(curve.points) - 1) // 2)))
    offset = np.arange(-reach, reach + 1) * step
    kernel = np.exp(-0.5 * (offset / _SMOOTH) ** 2)
    return np.asarray(kernel / kernel.max(), np.float64)


def _blur(values: Array, kernel: Array, closed: bool) -> Array:
    """Weighted sums along a curve; an open one is not continued beyond its ends."""
    reach = len(kernel) // 2
    flat = values.reshape(len(values), -1)
    pad = "wrap" if closed else "constant"
    padded = np.pad(flat, ((reach, reach), (0, 0)), mode=pad)  # type: ignore[call-overload]
    summed = sum(kernel[k] * padded[k : k + len(flat)] for k in range(len(kernel)))
    return np.asarray(summed).reshape(values.shape)


def _measure(
    points: Array, tangents: Array, facing: list[Array], cameras: Cameras, edges: NDArray[np.uint8], dense: Array,
    spacing: float, window: float,
) -> _Measured:  # fmt: skip
    """What all views say about points of curves, N in all."""
    said = _Measured.nothing(len(points))
    offsets = np.arange(-window - _PEAK_PX, window + _PEAK_PX + 1e-9, _SAMPLE_PX)
    for view, center in enumerate(cameras.centers):
        sight = center - points
        sees = np.maximum((sight * facing[0]).sum(1), (sight * facing[1]).sum(1)) > 0
        index = np.flatnonzero(sees)
        index = index[visible(cameras, view, points[index], dense, spacing)]
        if not len(index):
            continue
        jacobian, pixels = _jacobian(cameras, view, points[index])
        along = np.einsum("nij,nj->ni", jacobian, tangents[index])
        length = np.linalg.norm(along, axis=1)
        full = cameras.intrinsics[view, :2].mean() / np.linalg.norm(sight[index], axis=1)
        keep = length > _FORESHORTENED * full
        if not keep.any():  # OpenCV refuses to sample nothing
            continue
        index, jacobian, pixels = index[keep], jacobian[keep], pixels[keep]
        across = np.column_stack([-along[keep, 1], along[keep, 0]]) / length[keep, None]
        where = pixels[:, None] + offsets[None, :, None] * across[:, None]  # (n, K, 2)
        level = cv2.remap(
            edges[view], (where[..., 0] - 0.5).astype(np.float32), (where[..., 1] - 0.5).astype(np.float32),
            cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0.0,
        ).astype(np.float64).reshape(len(index), -1)  # fmt: skip
        delta, strength = _peaks(level, offsets, window)
        weight = np.where(strength > 0, strength / _MEASURE_PX**2, 0) / (1 + (delta / _OUTLIER_PX) ** 2)
        row = np.einsum("ni,nij->nj", across, jacobian)
        said.hessian[index] += weight[:, None, None] * row[:, :, None] * row[:, None, :]
        said.gradient[index] += (weight * delta)[:, None] * row
        said.seen[index] += 1
        said.found[index] += strength > 0
        said.energy[index] += weight * delta**2
        said.weight[index] += weight
    return said


def _jacobian(cameras: Cameras, view: int, points: Array) -> tuple[Array, Array]:
    """(N, 2, 3) derivatives of the pixel position, and (N, 2) positions."""
    pose = cameras.cam_from_unit[view]
    camera = points @ pose[:3, :3].T + pose[:3, 3]
    fx, fy, _, _ = cameras.intrinsics[view]
    z = camera[:, 2]
    zero = np.zeros(len(points))
    rows = np.stack(
        [
            np.stack([fx / z, zero, -fx * camera[:, 0] / z**2], -1),
            np.stack([zero, fy / z, -fy * camera[:, 1] / z**2], -1),
        ],
        axis=1,
    )
    return rows @ pose[:3, :3], cameras.project(view, points)[0]


def _peaks(level: Array, offsets: Array, window: float) -> tuple[Array, Array]:
    """Sub-pixel offset of the edge beside each point, and its strength 0..1, 0 = none."""
    inside = np.abs(offsets) <= window
    pulled = np.where(inside, level * np.exp(-0.5 * (offsets / (_CENTRE_PULL * window)) ** 2), 0)
    best = pulled.argmax(1)
    near = np.abs(offsets[None] - offsets[best][:, None]) <= _PEAK_PX + 1e-9
    mass = np.where(near, level, 0)
    total = mass.sum(1)
    delta = (mass * offsets).sum(1) / np.maximum(total, 1e-9)
    peak = level[np.arange(len(level)), best]
    return delta, np.where(peak >= _LEAST_EDGE, peak / 255, 0)
