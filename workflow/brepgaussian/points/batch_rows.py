"""Batches of surfaces as rows (B, 10) of `geometry.surfaces.surface_to_row`: distances, normals, small steps."""

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.surfaces import ROW_LENGTH

Array = NDArray[np.float64]
PARAMETERS = {"plane": 3, "sphere": 4, "cylinder": 5, "cone": 6, "torus": 7}
MAX_RADIUS = 5.0  # unit frame: five times the object; flatter than that is a plane
SMALL = 1e-9


def new_rows(count: int, origin: Array, axis: Array) -> Array:
    """(B, 10) rows with origins (B, 3) and axes (3,) or (B, 3)."""
    rows = np.zeros((count, ROW_LENGTH))
    rows[:, 0:3], rows[:, 3:6] = origin, axis
    return rows


def evaluate(kind: str, rows: Array, points: Array) -> tuple[Array, Array]:
    """Signed distances (B, M) and outward normals (B, M, 3) of points (B, M, 3) from surfaces (B, 10)."""
    origin, axis = rows[:, None, 0:3], rows[:, None, 3:6]
    sign = 1 - 2 * rows[:, None, 9]
    offset = points - origin
    if kind == "plane":
        normal = np.broadcast_to(axis, offset.shape)
        return sign * (offset * axis).sum(2), sign[..., None] * normal
    radius, minor, angle = rows[:, None, 6], rows[:, None, 7], rows[:, None, 8]
    if kind == "sphere":
        length = np.sqrt((offset**2).sum(2))
        return sign * (length - radius), sign[..., None] * offset / (length + SMALL)[..., None]
    along = (offset * axis).sum(2)
    across = offset - along[..., None] * axis
    rho = np.sqrt((across**2).sum(2))
    radial = across / (rho + SMALL)[..., None]
    if kind == "cylinder":
        return sign * (rho - radius), sign[..., None] * radial
    if kind == "cone":
        cosine, sine = np.cos(angle), np.sin(angle)
        distance = (rho - radius) * cosine - along * sine
        return sign * distance, sign[..., None] * (cosine[..., None] * radial - sine[..., None] * axis)
    out = rho - radius
    length = np.sqrt(out**2 + along**2)
    normal = (out[..., None] * radial + along[..., None] * axis) / (length + SMALL)[..., None]
    return sign * (length - minor), sign[..., None] * normal


def frame(axis: Array) -> tuple[Array, Array]:
    """Two directions (B, 3) that make a right-handed frame with unit axes (B, 3) (Duff et al., JCGT 2017)."""
    sign = np.where(axis[:, 2] >= 0, 1.0, -1.0)
    a = -1.0 / (sign + axis[:, 2])
    b = axis[:, 0] * axis[:, 1] * a
    x = np.stack([1 + sign * axis[:, 0] ** 2 * a, sign * b, -sign * axis[:, 0]], 1)
    return x, np.stack([b, sign + axis[:, 1] ** 2 * a, -axis[:, 1]], 1)


def moved(kind: str, rows: Array, delta: Array) -> Array:
    """Rows after small steps (B, P): shifts, tilts of the axis, radii, angle."""
    moved = rows.copy()
    x, y = frame(rows[:, 3:6])
    if kind == "sphere":
        moved[:, 0:3] += delta[:, 0:3]
        moved[:, 6] += delta[:, 3]
    else:
        moved[:, 0:3] += delta[:, 0, None] * x + delta[:, 1, None] * y
        axis = rows[:, 3:6] + delta[:, 2, None] * x + delta[:, 3, None] * y
        moved[:, 3:6] = axis / np.linalg.norm(axis, axis=1, keepdims=True)
        moved[:, 6] += delta[:, 4]
        if kind == "cone":
            moved[:, 8] = np.clip(moved[:, 8] + delta[:, 5], 0.01, 1.56)
        if kind == "torus":
            moved[:, 0:3] += delta[:, 5, None] * rows[:, 3:6]
            moved[:, 7] = np.clip(moved[:, 7] + delta[:, 6], 1e-4, MAX_RADIUS)
    moved[:, 6] = np.clip(moved[:, 6], 1e-4, MAX_RADIUS)
    return moved
