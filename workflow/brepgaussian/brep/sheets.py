"""Bounded faces: each primitive as a sheet a little larger than its support, exact at tangent ends."""

from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.chart import TURN, Chart, chart_of, largest_gap
from brepgaussian.brep.outline import TANGENT_DISTANCE, TANGENT_SINE, clip, cut_at_tangents, octagon
from brepgaussian.brep.patches import Patch
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]

BOX = np.array([[-0.1] * 3, [1.1] * 3])  # a sheet of full extent ends here: the unit frame and a rim
_DOME = 0.5  # cosine between a sphere's middle and its farthest points: a cap that spans 120 degrees
_FEW = 0.01  # of a support's points may be wrong
FULL_TURN_GAP = np.radians(100.0)  # a support with a smaller gap is taken as a full turn
_CLOSED = 2.0  # of reach: a gap as narrow as that between points is none
_EIGHTH = TURN / 8  # half of the quarter turn beyond its support in which an extended sheet may end
_SCAN, _LANES, _GOLDEN_STEPS = 25, 5, 60


@dataclass(frozen=True)
class Sheet:
    """A bounded face to be built.

    Attributes:
        patch: index of its patch.
        chart: its parametrisation.
        limits: u0, u1, v0, v1 of a curved sheet.
        polygon: (K, 2) corners in u, v of a plane sheet, counter-clockwise; None for curved ones.
    """

    patch: int
    chart: Chart
    limits: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    polygon: Array | None = None


def make_sheet(index: int, patches: Sequence[Patch], margin: float, extended: Set[int] = frozenset()) -> Sheet:
    """The sheet of one patch: its support plus `margin`, or all of the unit box if it is one of the `extended`.

    Either ends where a neighbour touches it; a patch that is extended is a neighbour wherever its surface passes.
    """
    patch, extend = patches[index], index in extended
    margin += patch.reach  # points end about this far before the patch does
    if patch.surface.kind == "plane":
        return _plane_sheet(index, patches, margin, extended)
    chart, points = _seamed_chart(index, patches)
    uv = chart.parameters(points)
    start_v = 0.0
    if patch.surface.kind == "torus":  # unroll the tube at its largest gap
        middle, _ = largest_gap(uv[:, 1])
        start_v = middle - TURN
        uv[:, 1] = start_v + np.mod(uv[:, 1] - start_v, TURN)
    u_range = (float(uv[:, 0].min()), float(uv[:, 0].max()))
    v_range = (float(uv[:, 1].min()), float(uv[:, 1].max()))
    scale_u, scale_v = chart.scale(float(np.median(uv[:, 1])))
    sheet = Sheet(index, chart)
    u0, u1 = _ends(sheet, patches, 0, u_range, v_range, margin, scale_u, extended)
    v0, v1 = _ends(sheet, patches, 1, v_range, u_range, margin, scale_v, extended)
    around = (TURN - (u_range[1] - u_range[0])) * scale_u < _CLOSED * patch.reach  # wherever its neighbours touch it
    free_u = (u0[1] and u1[1]) or around
    full_u = free_u and (extend or TURN - (u_range[1] - u_range[0]) < FULL_TURN_GAP or u1[0] - u0[0] > TURN)
    limits_u = (0.0, TURN) if full_u else (max(u0[0], 0.0), min(u1[0], TURN))
    limits_v = _limit_v(patch, v0, v1, margin, extend, start_v)
    return replace(sheet, limits=(*limits_u, *limits_v))


def _seamed_chart(index: int, patches: Sequence[Patch]) -> tuple[Chart, Array]:
    """A chart whose seam lies in the support's largest gap, and the support on the surface."""
    patch = patches[index]
    points = patch.surface.project(patch.xyz)
    axis = _sphere_axis(index, patches) if patch.surface.kind == "sphere" else patch.surface.axis
    chart = chart_of(patch.surface, axis)
    seam, _ = largest_gap(chart.parameters(points)[:, 0])
    x = np.cos(seam) * chart.x + np.sin(seam) * chart.y
    return chart_of(patch.surface, axis, x), points


def _sphere_axis(index: int, patches: Sequence[Patch]) -> Array:
    """The axis of a surface of revolution that a sphere is centred on, else one across the support.

    Neighbours on the axis meet the sphere in circles of constant v; without one, poles and seam are
    kept away from the support, but of a dome: poles on its rim would be where its sheet has no margin.
    """
    patch = patches[index]
    center, radius = patch.surface.origin, patch.surface.radius
    best, best_distance = None, np.inf
    for other in patches:
        if other.surface.kind not in ("cylinder", "cone", "torus"):
            continue
        axis = _axis_through(center, other.surface)
        gap = np.linalg.norm(other.xyz - center, axis=1).min() - radius
        if axis is not None and gap < best_distance:
            best, best_distance = axis, gap
    if best is not None:
        return best
    mean = (patch.xyz - center).mean(axis=0)
    if np.linalg.norm(mean) < 0.1 * radius:
        return np.array([0.0, 0.0, 1.0])
    mean /= np.linalg.norm(mean)
    lowest = np.quantile((patch.xyz - center) @ mean, _FEW) / radius
    return mean if lowest < _DOME else chart_of(patch.surface, mean).x


def _axis_through(center: Array, surface: Surface) -> Array | None:
    """(3,) the axis about which a surface is round at a sphere's centre: its own, or that of a bent tube there."""
    offset = center - surface.origin
    height = float(offset @ surface.axis)
    arm = offset - height * surface.axis
    lever = float(np.linalg.norm(arm))
    if lever < TANGENT_DISTANCE:
        return surface.axis
    if surface.kind == "torus" and np.hypot(height, lever - surface.radius) < TANGENT_DISTANCE:
        return np.asarray(np.cross(surface.axis, arm / lever))
    return None


def _ends(
    sheet: Sheet,
    patches: Sequence[Patch],
    which: int,
    own: tuple[float, float],
    across: tuple[float, float],
    margin: float,
    scale: float,
    extended: Set[int],
) -> tuple[tuple[float, bool], tuple[float, bool]]:
    """Lower and upper end of one parameter, each with whether it is free (not tangent to a neighbour).

    An extended sheet may end up to a quarter turn beyond its support.
    """
    window = (1.5 * margin + patches[sheet.patch].reach) / scale
    window = min(window, 0.45 * max(own[1] - own[0], 1e-9) + patches[sheet.patch].reach / scale)
    result = []
    for end, outward in ((own[0], -1.0), (own[1], 1.0)):
        found = _tangent_end(sheet, patches, which, end, window, across, extended)
        if found is None and which == 0 and sheet.patch in extended:
            far = end + outward * (window + _EIGHTH)
            found = _tangent_end(sheet, patches, which, far, _EIGHTH, across, extended)
        result.append((end + outward * margin / scale, True) if found is None else (found, False))
    return result[0], result[1]


def _tangent_end(
    sheet: Sheet,
    patches: Sequence[Patch],
    which: int,
    end: float,
    window: float,
    across: tuple[float, float],
    extended: Set[int],
) -> float | None:
    """Parameter near `end` along which another patch is tangent to this one; the nearest to `end`."""
    lanes = np.linspace(across[0], across[1], _LANES)
    scan = np.linspace(end - window, end + window, _SCAN)
    best: float | None = None
    length = window * max(sheet.chart.scale(v)[which] for v in (across if which == 0 else (end - window, end + window)))
    for other_index in sorted({*_beside(patches, sheet.patch, length), *extended} - {sheet.patch}):
        other = patches[other_index]
        sines = _sine(sheet, other, which, scan, lanes)
        least = int(np.argmin(sines))
        if sines[least] > np.sin(2.5 * (scan[1] - scan[0]) + 0.05) or sines.max() < TANGENT_SINE:
            continue
        line = _lines(sheet.chart, which, scan[least : least + 1], lanes)
        if np.abs(other.surface.signed_distance(line)).max() > 4 * length / _SCAN:
            continue  # parallel there, and elsewhere: within a step of a tangency surfaces are that near
        low, high = scan[max(least - 1, 0)], scan[min(least + 1, _SCAN - 1)]
        at = _golden(partial(_sine_at, sheet, other, which, lanes), low, high)
        if _sine(sheet, other, which, np.array([at]), lanes)[0] > TANGENT_SINE:
            continue
        line = _lines(sheet.chart, which, np.array([at]), lanes)
        if np.abs(other.surface.signed_distance(line)).max() > TANGENT_DISTANCE:
            continue
        reach = 2 * max(other.reach, patches[sheet.patch].reach)
        elsewhere = np.linalg.norm(other.xyz[:, None] - line, axis=2).min() > reach + 2 * other.sigma
        if elsewhere and other_index not in extended:
            continue  # the same surface elsewhere
        if best is None or abs(at - end) < abs(best - end):
            best = at
    return best


def _beside(patches: Sequence[Patch], index: int, length: float) -> list[int]:
    """Patches whose points may lie at an end of one patch that is moved by up to `length`."""
    low, high = patches[index].box
    found = []
    for k, other in enumerate(patches):
        apart = 2 * (length + max(other.reach, patches[index].reach) + other.sigma)
        if k != index and (other.box[0] <= high + apart).all() and (other.box[1] >= low - apart).all():
            found.append(k)
    return found


def _lines(chart: Chart, which: int, at: Array, lanes: Array) -> Array:
    """(T * L, 3) points of lines of constant parameter."""
    a, b = np.meshgrid(at, lanes, indexing="ij")
    u, v = (a, b) if which == 0 else (b, a)
    return chart.evaluate(u.ravel(), v.ravel())


def _sine(sheet: Sheet, other: Patch, which: int, at: Array, lanes: Array) -> Array:
    """(T,) largest sine between the normals of two surfaces along lines of constant parameter."""
    points = _lines(sheet.chart, which, at, lanes)
    a, b = sheet.chart.surface.normals(points).T, other.surface.normals(points).T
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    return np.asarray(np.sqrt(x * x + y * y + z * z).reshape(len(at), len(lanes)).max(axis=1), float)


def _sine_at(sheet: Sheet, other: Patch, which: int, lanes: Array, at: float) -> float:
    return float(_sine(sheet, other, which, np.array([at]), lanes)[0])


def _golden(function: Callable[[float], float], low: float, high: float) -> float:
    """Golden-section minimum: the sine is V-shaped at a tangency, so it is found to rounding."""
    ratio = (np.sqrt(5) - 1) / 2
    a, b = low, high
    c, d = b - ratio * (b - a), a + ratio * (b - a)
    at_c, at_d = function(c), function(d)
    for _ in range(_GOLDEN_STEPS):
        if at_c < at_d:
            b, d, at_d = d, c, at_c
            c = b - ratio * (b - a)
            at_c = function(c)
        else:
            a, c, at_c = c, d, at_d
            d = a + ratio * (b - a)
            at_d = function(d)
    return 0.5 * (a + b)


def _limit_v(
    patch: Patch, v0: tuple[float, bool], v1: tuple[float, bool], margin: float, extend: bool, start_v: float
) -> tuple[float, float]:
    """Keep v within the surface: a cone's apex, a sphere's poles, a torus' turn."""
    surface = patch.surface
    low, high = v0[0], v1[0]
    if extend:
        ends = {"sphere": (-np.pi / 2, np.pi / 2), "torus": (start_v, start_v + TURN)}
        full = ends[surface.kind] if surface.kind in ends else _box_range(patch)
        low, high = (full[0] if v0[1] else low), (full[1] if v1[1] else high)
    if surface.kind == "cone":
        apex = -surface.radius / np.sin(surface.angle)
        low = apex if low < apex + margin and v0[1] else low
    if surface.kind == "sphere":
        snap = margin / surface.radius
        low = -np.pi / 2 if v0[1] and low < -np.pi / 2 + snap else low
        high = np.pi / 2 if v1[1] and high > np.pi / 2 - snap else high
    if surface.kind == "torus" and v0[1] and v1[1] and high - low > TURN - FULL_TURN_GAP:
        low, high = 0.0, TURN  # OCC finds no cells with the seam of a whole tube anywhere else
    return low, high


def _box_range(patch: Patch) -> tuple[float, float]:
    """Range of v (a length) of a cylinder or cone within the box."""
    corners = np.array(np.meshgrid(*BOX.T)).reshape(3, -1).T
    along = (corners - patch.surface.origin) @ patch.surface.axis
    slant = np.cos(patch.surface.angle)
    far = float(np.abs(BOX).max() * np.sqrt(3) + np.linalg.norm(patch.surface.origin))  # of a very flat cone
    return max(float(along.min() / slant), -far), min(float(along.max() / slant), far)


def _plane_sheet(index: int, patches: Sequence[Patch], margin: float, extended: Set[int]) -> Sheet:
    """An octagon around the support, aligned with its narrowest rectangle, or the plane's cut of the box."""
    patch = patches[index]
    chart = chart_of(patch.surface)
    uv = chart.parameters(patch.xyz)
    if index in extended:
        half = np.linalg.norm(BOX[1] - BOX[0])
        middle = chart.parameters(patch.surface.project(BOX.mean(axis=0)[None]))[0]
        square = middle + half * np.array([[-1.0, -1.0], [1, -1], [1, 1], [-1, 1]])
        polygon = square
        for axis in range(3):
            for side, sign in ((0, -1.0), (1, 1.0)):
                gradient = sign * np.array([chart.x[axis], chart.y[axis]])
                bound = sign * (BOX[side, axis] - patch.surface.origin[axis])
                polygon = clip(polygon, gradient, bound)
        if len(polygon) >= 3:
            near = [other for k, other in enumerate(patches) if k != index]
            return Sheet(index, chart, polygon=cut_at_tangents(polygon, chart, patch, near, extended=True))
    polygon = octagon(uv, margin)
    beside = [patches[k] for k in _beside(patches, index, margin)]
    return Sheet(index, chart, polygon=cut_at_tangents(polygon, chart, patch, beside))
