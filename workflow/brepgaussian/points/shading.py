"""What the grey levels say about curvature: on a plane they hardly change, on a bend they change with the normal.

Under a light that is fixed in the world the grey level of a matt surface is a smooth function of its normal.
That function is learnt from the nodes themselves; where it explains nothing (textures), the noise that is
estimated with it makes the term vanish. Gradients, not levels, are compared: light that neighbouring faces
throw on each other changes levels slowly.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_RIDGE = 1e-3
_ROUNDS = 4  # of reweighting
_LEAST_NODES = 60
_STEP = 2e-3  # unit frame; half the distance over which a primitive's predicted grey is differenced


@dataclass(frozen=True)
class Shading:
    """Grey level as a function of the normal: coefficients (10,) of second-order polynomials."""

    coefficients: Array

    def __call__(self, normals: Array) -> Array:
        """(...,) grey levels of (..., 3) unit normals."""
        return _basis(normals) @ self.coefficients


def _basis(n: Array) -> Array:
    x, y, z = np.moveaxis(n, -1, 0)
    return np.stack([np.ones_like(x), x, y, z, x * y, y * z, x * z, x * x - y * y, 3 * z * z - 1, x * y * z], -1)


def fit_shading(normals: Array, grey: Array, trust: Array) -> Shading | None:
    """Robust fit of grey levels (N,), NaN = unknown, to normals (N, 3); None if too few are known."""
    known = np.isfinite(grey) & (trust > 0)
    if known.sum() < _LEAST_NODES:
        return None
    basis, level, base = _basis(normals[known]), grey[known], trust[known]
    weight = base.copy()
    coefficients = np.zeros(basis.shape[1])
    for _ in range(_ROUNDS):
        weighted = basis * weight[:, None]
        normal = weighted.T @ basis + _RIDGE * weight.sum() * np.eye(basis.shape[1])
        coefficients = np.linalg.solve(normal, weighted.T @ level)
        residual = np.abs(level - basis @ coefficients)
        scale = max(float(np.median(residual)), 0.5)
        weight = base / (1 + (residual / (2 * scale)) ** 2)
    return Shading(coefficients)


def gradients(xyz: Array, normals: Array, grey: Array, pairs: NDArray[np.int64], weights: Array) -> Array:
    """(N, 3) tangential gradient of the grey level, levels per unit length; NaN where the neighbours don't tell.

    Args:
        xyz, normals: (N, 3) nodes; grey: (N,) levels, NaN = unknown.
        pairs: (E, 2) neighbours; weights: (E,) trust in a pair, 0 = across a border.
    """
    count = len(xyz)
    u = np.cross(np.eye(3)[np.argmin(np.abs(normals), axis=1)], normals)
    u /= np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-12)
    v = np.cross(normals, u)
    usable = np.isfinite(grey[pairs[:, 0]]) & np.isfinite(grey[pairs[:, 1]]) & (weights > 0)
    i, j = pairs[usable].T
    w = np.concatenate([weights[usable]] * 2)
    one, other = np.concatenate([i, j]), np.concatenate([j, i])
    step, rise = xyz[other] - xyz[one], grey[other] - grey[one]
    a, b = (step * u[one]).sum(1), (step * v[one]).sum(1)

    def total(values: Array) -> Array:
        return np.bincount(one, w * values, minlength=count).astype(np.float64)

    aa, ab, bb, ar, br = total(a * a), total(a * b), total(b * b), total(a * rise), total(b * rise)
    ridge = 1e-2 * (aa + bb)
    aa, bb = aa + ridge, bb + ridge
    det = aa * bb - ab**2
    enough = (total(np.ones_like(a)) >= 3) & (det > 0.05 * (aa + bb) ** 2 / 4)
    det = np.where(enough, det, 1)
    slope: Array = ((bb * ar - ab * br) / det)[:, None] * u + ((aa * br - ab * ar) / det)[:, None] * v
    slope[~enough] = np.nan
    return np.asarray(slope, np.float64)


def predicted_gradients(shading: Shading, normal_at, points: Array, normals: Array) -> Array:  # type: ignore[no-untyped-def]
    """Gradient (B, M, 3) that a primitive predicts at points (B, M, 3); `normal_at` gives its normals there."""
    helper = np.eye(3)[np.argmin(np.abs(normals), axis=2)]
    u = np.cross(helper, normals)
    u /= np.maximum(np.linalg.norm(u, axis=2, keepdims=True), 1e-12)
    v = np.cross(normals, u)
    slope = np.zeros_like(points)
    for direction in (u, v):
        rise = shading(normal_at(points + _STEP * direction)) - shading(normal_at(points - _STEP * direction))
        slope += (rise / (2 * _STEP))[..., None] * direction
    return slope
