"""Closed-form first guesses of surfaces from points with normals: linear algebra only, no iteration.

Each guess needs few points (it serves RANSAC samples too) and returns None where the points do not
determine the surface. Normals may point outwards or inwards, as long as they agree with each other.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.surfaces import Surface, cone, cylinder, plane, sphere, torus, unit

Array = NDArray[np.float64]
MINIMUM = {"plane": 1, "sphere": 2, "cylinder": 2, "cone": 3, "torus": 4}  # points with normals

_SMALL = 1e-12
_FLAT = 1e-9  # variance of unit normals below which they are parallel


def starts(kind: str, points: Array, normals: Array, weights: Array | None = None) -> Iterator[Surface]:
    """First guesses of one kind, best guess of the axis first.

    Args:
        kind: plane, cylinder, sphere, cone or torus.
        points: (N, 3) with N >= `MINIMUM[kind]`.
        normals: (N, 3) unit.
        weights: (N,) or None.
    """
    share = np.full(len(points), 1 / len(points)) if weights is None else weights / max(weights.sum(), _SMALL)
    if kind == "plane":
        yield plane(share @ points, _plane_normal(points, normals, share))
    elif kind == "sphere":
        guess = _sphere(points, normals, share)
        if guess is not None:
            yield guess
    else:
        make = {"cylinder": cylinder_about, "cone": cone_about, "torus": torus_about}[kind]
        for axis, through in _axes(kind, points, normals, share):
            guess = make(axis, points, normals, share, through)
            if guess is not None:
                yield guess


def _plane_normal(points: Array, normals: Array, share: Array) -> Array:
    """Direction of least spread, or the mean normal where the points are too few or lie on a line."""
    mean = share @ normals
    mean = mean if np.linalg.norm(mean) > _SMALL else normals[0]
    offset = points - share @ points
    spread, directions = np.linalg.eigh((offset * share[:, None]).T @ offset)
    if spread[1] < 1e-4 * max(spread[2], _SMALL) or len(points) < 4:
        return unit(mean)
    return directions[:, 0] if directions[:, 0] @ mean >= 0 else -directions[:, 0]


def _sphere(points: Array, normals: Array, share: Array) -> Surface | None:
    """p = centre + s n in the least-squares sense; s is negative where normals point to the centre."""
    middle, mean = share @ points, share @ normals
    variance = share @ ((normals - mean) ** 2).sum(1)
    if variance < _FLAT:
        return None
    reach = float(share @ ((points - middle) * (normals - mean)).sum(1) / variance)
    return sphere(middle - reach * mean, max(abs(reach), _SMALL), flipped=reach < 0)


def _axes(kind: str, points: Array, normals: Array, share: Array) -> Iterator[tuple[Array, Array | None]]:
    """Candidate axis directions, each with a point on the axis where one is known."""
    mean = share @ normals
    centred = normals - mean
    about_zero = np.linalg.eigh((normals * share[:, None]).T @ normals)[1]
    about_mean = np.linalg.eigh((centred * share[:, None]).T @ centred)[1]
    offset = points - share @ points
    spread = np.linalg.eigh((offset * share[:, None]).T @ offset)[1]
    if kind == "cylinder":
        yield about_zero[:, 0], None
        yield about_mean[:, 0], None
        yield spread[:, 2], None
        return
    if kind == "cone":
        yield about_mean[:, 0], None
        yield about_zero[:, 0], None
    yield from _revolution(points, normals, share)
    if kind == "torus":
        yield about_mean[:, 0], None
        yield spread[:, 0], None


def _revolution(points: Array, normals: Array, share: Array) -> list[tuple[Array, Array]]:
    """Axes of revolution: the lines that the normal lines meet (Pottmann and Wallner, line geometry).

    With the Pluecker coordinates (n, p x n) of a normal line and (a, m) of the axis, a.(p x n) + m.n = 0.
    """
    middle = share @ points
    extent = max(float(np.sqrt(share @ ((points - middle) ** 2).sum(1))), _SMALL)
    moment = np.cross((points - middle) / extent, normals)
    weighted = share[:, None]
    aa, am, mm = (moment * weighted).T @ moment, (moment * weighted).T @ normals, (normals * weighted).T @ normals
    solve = np.linalg.solve(mm + 1e-6 * np.eye(3), am.T)  # m = -solve @ a
    directions = np.linalg.eigh(aa - am @ solve)[1]
    lines = []
    for column in (0, 1):
        axis = directions[:, column]
        lines.append((axis, middle + extent * np.cross(axis, -solve @ axis)))
    return lines


def cylinder_about(
    axis: Array, points: Array, normals: Array, share: Array, through: Array | None = None
) -> Surface | None:
    """The cylinder of a given axis direction: a circle fit to positions and normals across the axis."""
    across_axis = _across(axis, normals, share)
    if across_axis is None:
        return None
    radial, share = across_axis
    across = points - (points @ axis)[:, None] * axis
    if through is not None:
        reach = float(share @ ((across - through + (through @ axis) * axis) * radial).sum(1))
        return cylinder(through, axis, max(abs(reach), _SMALL), flipped=reach < 0)
    middle, mean = share @ across, share @ radial
    variance = share @ ((radial - mean) ** 2).sum(1)
    if variance < _FLAT:
        return None
    reach = float(share @ ((across - middle) * (radial - mean)).sum(1) / variance)
    centre = middle - reach * mean + (share @ (points @ axis)) * axis
    return cylinder(centre, axis, max(abs(reach), _SMALL), flipped=reach < 0)


def _across(axis: Array, normals: Array, share: Array) -> tuple[Array, Array] | None:
    """Unit directions (N, 3) of normals across an axis, and shares (N,) without the normals along it."""
    across = normals - (normals @ axis)[:, None] * axis
    length = np.linalg.norm(across, axis=1)
    share = share * (length > 0.1)
    if share.sum() < _SMALL:
        return None
    return across / np.maximum(length, _SMALL)[:, None], share / share.sum()


def cone_about(
    axis: Array, points: Array, normals: Array, share: Array, through: Array | None = None
) -> Surface | None:
    """The cone of a given axis direction: p = c + (r + k t) u across the axis, linear in c, r and k.

    u is the direction of the normal across the axis and t the position along it.
    """
    across_axis = _across(axis, normals, share)
    if across_axis is None:
        return None
    radial, share = across_axis
    middle = share @ points
    offset = points - middle if through is None else points - (through + ((middle - through) @ axis) * axis)
    along = offset @ axis
    across = offset - along[:, None] * axis
    if through is None:
        x = unit(np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis))
        y = np.cross(axis, x)
        rows = []
        for direction, (one, two) in ((x, (1.0, 0.0)), (y, (0.0, 1.0))):
            u = radial @ direction
            rows.append(
                (np.column_stack([np.full(len(u), one), np.full(len(u), two), u, along * u]), across @ direction)
            )
        matrix = np.concatenate([r[0] for r in rows])
        right = np.concatenate([r[1] for r in rows])
        weighted = matrix * np.concatenate([share, share])[:, None]
        normal = weighted.T @ matrix
        normal[np.diag_indices(4)] += 1e-12 * max(float(np.trace(normal)), _SMALL)
        c_x, c_y, radius, slope = np.linalg.solve(normal, weighted.T @ right)
        origin = middle + c_x * x + c_y * y
    else:
        origin = through + ((middle - through) @ axis) * axis
        reach = (across * radial).sum(1)
        centred = along - share @ along
        slope = float(share @ (centred * reach) / max(float(share @ centred**2), _SMALL))
        radius = float(share @ reach - slope * (share @ along))
    flipped = radius < 0
    if flipped:
        radius, slope = -radius, -slope
    if radius < _SMALL or not np.isfinite(slope):
        return None
    if slope < 0:
        axis, slope = -axis, -slope
    return cone(origin, axis, radius, float(np.clip(np.arctan(slope), 1e-3, np.pi / 2 - 1e-3)), flipped=bool(flipped))


def torus_about(
    axis: Array, points: Array, normals: Array, share: Array, through: Array | None = None
) -> Surface | None:
    """The torus of a given axis direction: a circle in the half plane (distance from the axis, height)."""
    if through is None:
        line = cylinder_about(axis, points, normals, share)
        if line is None:
            return None
        through = line.origin
    offset = points - through
    along = offset @ axis
    across = offset - along[:, None] * axis
    rho = np.linalg.norm(across, axis=1)
    radial = across / np.maximum(rho, _SMALL)[:, None]
    profile = np.column_stack([rho, along])  # (N, 2)
    slope = np.column_stack([(normals * radial).sum(1), normals @ axis])  # (N, 2) normals in the half plane
    middle, mean = share @ profile, share @ slope
    variance = share @ ((slope - mean) ** 2).sum(1)
    if variance < _FLAT:
        return None
    reach = float(share @ ((profile - middle) * (slope - mean)).sum(1) / variance)
    centre = middle - reach * mean
    if centre[0] <= _SMALL:
        return None
    return torus(through + centre[1] * axis, axis, float(centre[0]), max(abs(reach), _SMALL), flipped=reach < 0)
