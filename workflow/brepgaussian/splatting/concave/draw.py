"""The section that an outline of cells, or places on a rim, are a drawing of.

An outline of cells is known to half a cell, and what smooths it rounds its corners; so the simplest section that it
allows is taken.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.optimize import least_squares

from brepgaussian.geometry.pixels import inner_distance
from brepgaussian.splatting.concave.curved_slots import Bent, bent_slot, start_of
from brepgaussian.splatting.concave.sections import LEAST_STRAIGHT, Flatted, Keyed, Polygon, Rounded, Section

Array = NDArray[np.float64]
Cells = NDArray[np.bool_]
Family = tuple[Callable[[Sequence[float]], Section], Sequence[float]]  # sections from parameters, and where to start

_OUTLIER_CELLS = 0.5  # residuals of the cells' borders beyond that count linearly
_ROUNDED_CELLS = 5.0  # from a sharp corner: what opening an outline takes away
_CORRELATED_CELLS = 3.0  # neighbouring cells of an outline err together
_MOST_MEAN = 0.4  # cells by which outline and section differ, along the border: a staircase alone gives a quarter
MOST_FAR = 2.0  # cells by which no place may differ
_CORRELATED_PLACES = 2.0  # neighbouring places of a rim err together
_LEAST_OFF, _MOST_OFF = 0.1, 0.3  # cells: rms of a rim's places, at best, and for a section to go through them
_MOST_MOVED = 3.0  # cells from where the outline was
_LEAST_RADIUS = 3.0  # cells; narrower openings have no section that cells could tell
_NOTCH_CELLS = 2.0  # beyond a circle, or within: a keyway, or a flat
_LEAST_NOTCH = 12  # cells of one
_ROUND = (0.5, 0.2)  # of half the shorter side: radii to begin from; few places lie on small corners
_WIDE_KEYWAY = 0.8  # of the bore: one as wide makes a slot of it
_SURE_CELLS = 0.2  # misfit of a section that only cells tell: .05-.12 where it was right, .3 of an octagon for a bore
_TURN = 0.02  # radians of a section's angle that move its border as much as a cell of its other parameters


def fitted(outline: Cells, opened: Callable[[Cells], Cells]) -> Section | None:
    """The simplest section that an outline of cells (R, C) allows, or None.

    Args:
        outline: inside cells.
        opened: what was done to the outline when it was found; it rounds corners, of sections too.
    """
    border = border_of(outline)
    if len(border) < 4 * _LEAST_RADIUS:
        return None
    center, half, angle = _box(border)
    if half.min() < _LEAST_RADIUS:
        return None
    families = _families(center, half, angle, outline)
    found = _told_by_cells(outline, border, opened, families)
    # a slot along an arc has so many parameters that it is the last to be thought of
    return found or _told_by_cells(outline, border, opened, _bent(outline))


def _told_by_cells(
    outline: Cells, border: Array, opened: Callable[[Cells], Cells], families: Iterable[Family]
) -> Section | None:
    """The simplest section of some families that goes through the cells of an outline and its border, or None."""
    lattice = np.stack(np.meshgrid(*(np.arange(n, dtype=float) for n in outline.shape), indexing="ij"), axis=-1)
    count = len(border) / _CORRELATED_CELLS
    best, score = None, np.inf
    for build, start in families:
        first = nearest(border, build, start)
        again = None
        if first is not None and len(first.shape.corners()):  # once more without what the opening has rounded off
            again = nearest(border[~first.near_corners(border, _ROUNDED_CELLS)], build, start)
        for section in (first, again):
            if section is None:
                continue
            mean, far = _difference(outline, opened(section.signed_distance(lattice) <= 0), len(border))
            value = count * np.log(mean**2 + 1 / 12) + len(start) * np.log(count)  # BIC
            if mean <= _MOST_MEAN and far <= MOST_FAR and value < score:
                best, score = replace(section, misfit=mean), value
    return best


def refitted(border: Array, section: Section, most_off: float = _MOST_OFF) -> Section | None:
    """The simplest section through places of a border (N, 2), in cells, beginning from another section, or None."""
    before = section.border(len(border))
    allowed = [
        found
        for found in _through(border, _near(section), most_off)
        if np.abs(found[0].signed_distance(before)).max() <= _MOST_MOVED
    ]
    return _simplest(allowed)


def around(places: Array) -> Section | None:
    """The simplest rectangle with round corners, a circle too, through places (N, 2) all around an outline, or None."""
    if len(places) < 4 * _LEAST_RADIUS:
        return None
    center, half, angle = _box(places)
    if half.min() < _LEAST_RADIUS:
        return None
    families = _rectangles(float(center[0]), float(center[1]), angle, float(half[0]), float(half[1]))
    return _simplest(_through(places, families, _MOST_MEAN))


def nearest(border: Array, build: Callable[[Sequence[float]], Section], start: Sequence[float]) -> Section | None:
    """The section next to places (N, 2), or None: too few of them, or a section too narrow."""
    if len(border) < len(start):
        return None
    scale = np.ones(len(start))
    if len(start) > 3:
        scale[2] = _TURN
    found = least_squares(
        lambda p: build(p.tolist()).signed_distance(border),
        start,
        loss="soft_l1",
        f_scale=_OUTLIER_CELLS,
        x_scale=scale,
    )
    section = build(found.x.tolist())
    if not np.isfinite(found.x).all() or section.signed_distance(np.array(section.center)) > -_LEAST_RADIUS:
        return None
    shape = section.shape
    if isinstance(shape, Rounded) and 0 < max(shape.half) - shape.radius < LEAST_STRAIGHT:
        return None  # nearly a circle is one
    return section


def _through(border: Array, families: Iterable[Family], most_off: float) -> Iterator[tuple[Section, float]]:
    """Sections that go through places of a border (N, 2) to `most_off` cells, and the evidence against each (BIC)."""
    count = len(border) / _CORRELATED_PLACES
    for build, start in families:
        found = nearest(border, build, start)
        if found is None:
            continue
        off = np.abs(found.signed_distance(border))
        misfit = float(np.sqrt((np.minimum(off, _OUTLIER_CELLS) ** 2).mean()))
        if misfit <= most_off:
            yield replace(found, misfit=misfit), count * np.log(misfit**2 + _LEAST_OFF**2) + len(start) * np.log(count)


def _simplest(found: Iterable[tuple[Section, float]]) -> Section | None:
    return min(found, key=lambda one: one[1], default=(None, np.inf))[0]


def sure_of(section: Section) -> bool:
    """Whether cells alone tell a section: well, and its corners stick out farther than cells err."""
    shape = section.shape
    corners = shape.reach - shape.inner if isinstance(shape, Polygon) else np.inf
    return section.misfit <= _SURE_CELLS and corners > MOST_FAR


def border_of(outline: Cells) -> Array:
    """(N, 2) places on an outline's border, half-way between a cell of it and one beside it."""
    padded = np.pad(outline, 1).astype(np.int8)
    places = []
    for axis in (0, 1):
        change = np.argwhere(np.diff(padded, axis=axis) != 0).astype(float)
        change[:, axis] += 0.5
        places.append(change - 1)
    return np.concatenate(places)


def circle_about(outline: Cells) -> Section:
    """The least circle that holds an outline: of a round opening, parts may look like the face around it."""
    import cv2

    (x, y), radius = cv2.minEnclosingCircle(border_of(outline).astype(np.float32))
    return circle((x, y, radius))


def circle(p: Sequence[float]) -> Section:
    """A circle about (p[0], p[1]) of radius p[2], in cells."""
    return Section((p[0], p[1]), 0.0, Rounded((p[2], p[2]), p[2]))


def _hexagon(p: Sequence[float]) -> Section:
    return Section((p[0], p[1]), p[2], Polygon(6, p[3]))


def _octagon(p: Sequence[float]) -> Section:
    return Section((p[0], p[1]), p[2], Polygon(8, p[3]))


def _slot(p: Sequence[float]) -> Section:
    return Section((p[0], p[1]), p[2], Rounded((p[3], p[4]), min(p[3], p[4])))


def _rectangle(p: Sequence[float]) -> Section:
    return Section((p[0], p[1]), p[2], Rounded((p[3], p[4]), 0.0))


def _rounded(p: Sequence[float]) -> Section:
    return Section((p[0], p[1]), p[2], Rounded((p[3], p[4]), min(max(p[5], 0.0), p[3], p[4])))


def _flatted(p: Sequence[float]) -> Section:
    return Section((p[0], p[1]), p[2], Flatted(p[3], p[4]))


def _keyed(p: Sequence[float]) -> Section:
    return Section((p[0], p[1]), p[2], Keyed(p[3], p[4], p[5]))


def _families(center: Array, half: Array, angle: float, outline: Cells) -> Iterator[Family]:
    """What an outline may be, simplest first; `half` the sides of the box around it, the longer one first."""
    x, y, a, b = float(center[0]), float(center[1]), float(half[0]), float(half[1])
    yield from _rectangles(x, y, angle, a, b)
    for build, sides in ((_hexagon, 6), (_octagon, 8)):
        yield from ((build, [x, y, angle + turn, 0.475 * (a + b)]) for turn in (0.0, np.pi / sides))
    yield from _notched(outline)


def _bent(outline: Cells) -> Iterator[Family]:
    """A slot along an arc, if an outline may be one."""
    start = start_of(outline)
    if start is not None:
        yield bent_slot, start


def _rectangles(x: float, y: float, angle: float, a: float, b: float) -> Iterator[Family]:
    """Rectangles with round corners, from a circle on; `a` and `b` half their sides, the longer one first."""
    yield circle, [x, y, (a + b) / 2]
    yield _slot, [x, y, angle, a, b]
    yield _rectangle, [x, y, angle, a, b]
    for share in _ROUND:
        yield _rounded, [x, y, angle, a, b, share * b]


def _near(section: Section) -> Iterator[Family]:
    """What a section may be, more exactly."""
    (x, y), angle, shape = section.center, section.angle, section.shape
    if isinstance(shape, Rounded):
        (a, b), turned = shape.half, angle
        if b > a:
            a, b, turned = b, a, angle + np.pi / 2
        yield from _rectangles(x, y, turned, a, b)
        yield _rounded, [x, y, turned, a, b, shape.radius]  # few places lie on small corners: from far they are missed
    elif isinstance(shape, Polygon):
        yield (_hexagon if shape.sides == 6 else _octagon), [x, y, angle, shape.inner]
        yield circle, [x, y, (shape.inner + shape.reach) / 2]  # cells hardly tell them apart
    elif isinstance(shape, Bent):
        yield bent_slot, [x, y, angle, shape.bend, shape.width, shape.bend * shape.sweep]
    elif isinstance(shape, Flatted):
        yield _flatted, [x, y, angle, shape.radius, shape.flat]
    elif isinstance(shape, Keyed):
        yield _keyed, [x, y, angle, shape.radius, shape.width, shape.end]
        if shape.width > _WIDE_KEYWAY * shape.radius:  # cells hardly tell it from a slot
            middle, length = (shape.end - shape.radius) / 2, (shape.end + shape.radius) / 2
            yield from _rectangles(x + middle * np.cos(angle), y + middle * np.sin(angle), angle, length, shape.radius)


def _notched(outline: Cells) -> Iterator[Family]:
    """Circles with a flat or with a keyway, where the outline has less or more than the circle on one side."""
    inside = inner_distance(outline)
    middle = np.array(np.unravel_index(int(np.argmax(inside)), outline.shape), float)  # of the largest disc in it
    radius = float(inside.max())
    away = np.linalg.norm(np.moveaxis(np.indices(outline.shape), 0, -1) - middle, axis=-1)
    key = _largest(outline & (away > radius + _NOTCH_CELLS))
    if key.sum() >= _LEAST_NOTCH:
        way = np.argwhere(key).mean(axis=0) - middle
        end = float(away[key].max())
        width = float(key.sum()) / max(end - radius - _NOTCH_CELLS, 1.0) / 2
        yield _keyed, [*middle, float(np.arctan2(way[1], way[0])), radius, width, end]
    border = border_of(outline)
    around = nearest(border, circle, [*middle, radius])
    if around is None or not isinstance(around.shape, Rounded):
        return
    grid = np.moveaxis(np.indices(outline.shape), 0, -1).astype(float)
    missing = _largest(~outline & (around.signed_distance(grid) < -_NOTCH_CELLS / 2))
    if missing.sum() >= _LEAST_NOTCH:
        cells = np.argwhere(missing) - np.array(around.center)
        way = cells.mean(axis=0) / np.linalg.norm(cells.mean(axis=0))
        flat = float((cells @ way).min())
        yield _flatted, [*around.center, float(np.arctan2(way[1], way[0])), around.shape.radius, flat]


def _largest(cells: Cells) -> Cells:
    labels, count = ndimage.label(cells)
    return np.asarray(labels == 1 + int(np.argmax(np.bincount(labels.ravel())[1:]))) if count else cells


def _box(border: Array) -> tuple[Array, Array, float]:
    """Centre (2,), half sides (2,), longer first, and angle of the least rectangle around places (N, 2)."""
    import cv2

    (x, y), (w, h), degrees = cv2.minAreaRect(border.astype(np.float32))
    angle = np.radians(degrees)
    if h > w:
        w, h, angle = h, w, angle + np.pi / 2
    return np.array([x, y]), np.array([w, h]) / 2, float(angle)


def _difference(outline: Cells, other: Cells, border: int) -> tuple[float, float]:
    """By how many cells two outlines differ along a border of `border` cells, and at most."""
    wrong = outline ^ other
    if not other.any():
        return np.inf, np.inf
    away = np.maximum(ndimage.distance_transform_edt(outline), ndimage.distance_transform_edt(~outline))
    return float(wrong.sum()) / border, float((away * wrong).max())
