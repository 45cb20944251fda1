"""Pockets whose rim is broken by a notch: through it silhouettes have opened a part of the lid, and what is left of the
lid has no rim on that side.

Where the hull lies below a face's plane, within the face's outline, nothing is; all of it that touches what views
refute belongs to one opening, as far as the rest of the lid spans it. The notch itself goes on beyond that.
"""

from collections.abc import Iterator
from itertools import islice, product

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.morphology import convex_hull_image

from brepgaussian.geometry.pixels import inner_distance
from brepgaussian.splatting.concave.draw import around, border_of, circle, nearest
from brepgaussian.splatting.concave.openings import (
    OPENING_CELLS,
    REFUTED_SHARE,
    SURFACE_SHARE,
    Images,
    Stack,
    across,
    is_framed,
    openings,
    rectify,
    refuted_share,
)
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.sections import Rounded, Section

Array = NDArray[np.float64]
Outline = NDArray[np.bool_]

_GONE_CELLS = 2.5  # below the plane the hull is gone: as far as it may be off where it is a face
_TOUCH_CELLS = 6  # between what is gone and what is refuted, which keeps clear of the face's border
_FRAME_CELLS = 24  # around what is left of the face: a rim may be no part of it, where it is narrow
_RIM_CELLS = 4  # between an opening's border and cells of the rim that are clear of its blur
_LEAST_LID = 0.2  # of an opening is lid; what silhouettes have opened altogether needs no more
_LEAST_GONE = 0.02  # of an opening is gone
_NOTCHES = 0.5  # of the largest radius of a disc in an opening: narrower parts of it are notches
_LEAST_SIDE = 0.2  # of each side of such an opening is rim
_CORNER = np.sqrt(2) - 1  # of a disc's radius, from it to the tip of a right angle that it lies in
_MOSTLY_REFUTED = 0.5  # of the hull below an opening: .94 measured where silhouettes had opened a pot's upper half
_PLACES = 2000  # of that hull are looked at
_NEAR_CELLS = 2.5  # from a disc's border: as far as an outline of cells is wrong
_ROUNDS = 3  # of fits to what lies near
_LEAST_TOLD = 0.4  # of a disc's border: one inscribed into a rectangle touches it in a few cells


def broken_rims(images: Images, scene: Scene, stack: Stack, least_area: float) -> tuple[Stack, Stack, list[Outline]]:
    """A planar face with a frame around it, the same with what silhouettes have opened of it, and outlines (R, C) of
    openings that this is a part of; if there are none, the face as it came, twice.

    Args:
        images: of all views.
        scene: the hull.
        stack: what the views show on what is left of the face.
        least_area: of an opening.
    """
    if _gone(scene, stack).sum() * stack.lattice.pitch**2 < least_area:
        return stack, stack, []
    face = rectify(images, scene, stack.lattice.widened(_FRAME_CELLS))
    gone = _gone(scene, face)
    whole = across(images, scene, face.lattice, face.domain | gone)
    found: list[Outline] = []
    for opening in openings(whole, least_area):
        likely = _outlines(images, scene, face, whole, opening, least_area)
        framed = (o for o in likely if (o & gone).sum() >= _LEAST_GONE * o.sum() and is_framed(whole, o))
        found += islice(framed, 1)
    return (face, whole, found) if found else (stack, stack, [])


def _outlines(
    images: Images, scene: Scene, face: Stack, whole: Stack, opening: Outline, least_area: float
) -> Iterator[Outline]:
    """(R, C) what an opening may be without the notches through its rim, likeliest first."""
    # beside the notch remnants of the lid hang on its walls
    lid = ndimage.binary_opening(opening & face.refuted, iterations=OPENING_CELLS)
    if lid.sum() >= max(_LEAST_LID * opening.sum(), 1):
        yield _completed(ndimage.binary_fill_holes(opening & convex_hull_image(lid)), opening, whole)
        # what is left of the lid may span a part of the opening only: two notches have opened an end of it
        yield from _rimmed(_without_notches(opening, whole), opening, whole)
    elif lid.sum() * face.lattice.pitch**2 >= least_area:
        yield _inscribed(opening, whole)  # slots that cross it have left little of the lid
    else:
        outlines = _rimmed(_disc(opening, whole) or _without_notches(opening, whole), opening, whole)
        yield from (outline for outline in outlines if _refuted_below(images, scene, whole, outline))


def _completed(outline: Outline, opening: Outline, stack: Stack) -> Outline:
    """An outline (R, C) with the corners that silhouettes have opened, if the rim that is left tells a section."""
    section = around(_rim(border_of(outline), opening, stack))
    return outline & stack.domain if section is None else _within(section, opening, stack)


def _inscribed(opening: Outline, stack: Stack) -> Outline:
    """(R, C) the largest disc in an opening, if arcs of the rim lie on its border; else nothing."""
    disc = _disc(opening, stack)
    return np.zeros_like(opening) if disc is None else _within(disc, opening, stack)


def _disc(opening: Outline, stack: Stack) -> Section | None:
    """The largest disc in an opening (R, C), if arcs of the rim lie on its border."""
    away = inner_distance(opening)
    disc = circle([*(float(k) for k in np.unravel_index(int(np.argmax(away)), away.shape)), float(away.max())])
    rim = _rim(border_of(opening), opening, stack)
    for _ in range(_ROUNDS):
        arcs = rim[np.abs(disc.signed_distance(rim)) <= _NEAR_CELLS]
        found = nearest(arcs, circle, [*disc.center, _radius(disc)])
        if found is None:
            return None
        disc = found
    radius = _radius(disc)
    turns = np.unique(np.round(np.arctan2(*(arcs - disc.center).T) * radius))  # one place for each cell of the border
    told = len(turns) / (2 * np.pi * radius)
    return disc if told >= _LEAST_TOLD else None


def _without_notches(opening: Outline, stack: Stack) -> Section | None:
    """The rectangle with round corners that the rim of an opening (R, C) tells, but for narrow notches through it."""
    away = inner_distance(opening)
    reach = _NOTCHES * float(away.max())
    if not reach:
        return None
    beside = ndimage.distance_transform_edt(~(away > reach)) - reach  # what a disc of that radius fits into
    places = border_of(opening)
    cells = np.clip(np.round(places).astype(int), 0, np.array(opening.shape) - 1)
    return around(_rim(places[beside[tuple(cells.T)] <= _CORNER * reach + 1], opening, stack))


def _rimmed(section: Section | None, opening: Outline, stack: Stack) -> list[Outline]:
    """(R, C) what of a section is open, if it has a rim on all sides; else none."""
    if section is None or not _walled_in(section, _rim(border_of(opening), opening, stack)):
        return []
    return [_within(section, opening, stack)]


def _walled_in(section: Section, rim: Array) -> bool:
    """Whether places (N, 2) of a rim lie on all four sides of a section: at a slot's end, one of them is open."""
    assert isinstance(section.shape, Rounded)
    half = np.array(section.shape.half)
    at = section.local(rim[np.abs(section.signed_distance(rim)) <= _NEAR_CELLS])
    axis = np.argmax(np.abs(at) / half, axis=1)
    for side, sign in product((0, 1), (1, -1)):
        on = (axis == side) & (sign * at[:, side] > 0)
        if len(np.unique(np.round(at[on, 1 - side]))) < _LEAST_SIDE * 2 * half[1 - side]:
            return False
    return True


def _refuted_below(images: Images, scene: Scene, stack: Stack, outline: Outline) -> bool:
    """Whether the hull below an outline (R, C), of which silhouettes have opened the lid altogether, is no floor."""
    cells = stack.surface()[outline]
    cells = cells[:: max(len(cells) // _PLACES, 1)]
    down = np.broadcast_to(-stack.lattice.normal, cells.shape)
    far, normals = scene.hits(cells, down)
    met = np.isfinite(far)
    places = cells[met] + far[met, None] * down[met]
    share = refuted_share(images, scene, places, normals[met].astype(float), stack.lattice.pitch)
    return bool(met.any() and (share > REFUTED_SHARE).mean() >= _MOSTLY_REFUTED)


def _radius(disc: Section) -> float:
    return -float(disc.signed_distance(np.array(disc.center)))


def _rim(places: Array, opening: Outline, stack: Stack) -> Array:
    """Those of places (N, 2) on an opening's border that lie beside a face that views agree about."""
    face = _agreed_face(stack, opening)
    beside = ndimage.distance_transform_edt(~face) if face.any() else np.full(face.shape, np.inf)
    cells = np.clip(np.round(places).astype(int), 0, np.array(face.shape) - 1)
    return places[beside[tuple(cells.T)] <= _RIM_CELLS]


def _within(section: Section, opening: Outline, stack: Stack) -> Outline:
    """(R, C) what of a section is open."""
    lattice = np.moveaxis(np.indices(opening.shape), 0, -1).astype(float)
    return np.asarray(section.signed_distance(lattice) <= 0) & ndimage.binary_fill_holes(opening) & stack.domain


def _agreed_face(stack: Stack, opening: Outline) -> Outline:
    """(R, C) cells around an opening that nearly all views agree about."""
    near = ndimage.binary_dilation(opening, iterations=2 * _RIM_CELLS) & ~opening & stack.domain
    return np.asarray(near & (stack.agreement >= SURFACE_SHARE))


def _gone(scene: Scene, stack: Stack) -> Outline:
    """(R, C) cells within a face's outline over which the hull is gone, beside what views refute."""
    pitch = stack.lattice.pitch
    if not stack.refuted.any():
        return np.zeros(stack.domain.shape, bool)
    within = convex_hull_image(stack.domain) & ~stack.domain
    open_ = np.zeros(within.shape, bool)
    open_[within] = scene.near(stack.lattice.centers()[within], _GONE_CELLS * pitch) == np.inf
    labels, _ = ndimage.label(ndimage.binary_dilation(open_, iterations=int(_GONE_CELLS)) & within)
    beside = ndimage.binary_dilation(stack.refuted, iterations=_TOUCH_CELLS)
    touching = np.unique(labels[beside & (labels > 0)])
    return np.isin(labels, touching)
