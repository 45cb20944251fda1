"""Pockets whose rim is broken by a notch: through it silhouettes have opened a part of the lid, and what is left of the
lid has no rim on that side.

Where the hull lies below a face's plane, within the face's outline, nothing is; all of it that touches what views
refute belongs to one opening, as far as the rest of the lid spans it. The notch itself goes on beyond that.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.morphology import convex_hull_image

from brepgaussian.splatting.concave.draw import around, border_of
from brepgaussian.splatting.concave.openings import (
    OPENING_CELLS,
    SURFACE_SHARE,
    Images,
    Stack,
    across,
    is_framed,
    openings,
    rectify,
)
from brepgaussian.splatting.concave.scene import Scene

Outline = NDArray[np.bool_]

_GONE_CELLS = 2.5  # below the plane the hull is gone: as far as it may be off where it is a face
_TOUCH_CELLS = 6  # between what is gone and what is refuted, which keeps clear of the face's border
_FRAME_CELLS = 24  # around what is left of the face: a rim may be no part of it, where it is narrow
_RIM_CELLS = 4  # between an opening's border and cells of the rim that are clear of its blur
_LEAST_LID = 0.2  # of an opening is lid; what silhouettes have opened altogether needs no more
_LEAST_GONE = 0.02  # of an opening is gone


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
    found = []
    for opening in openings(whole, least_area):
        # beside the notch remnants of the lid hang on its walls
        lid = ndimage.binary_opening(opening & face.refuted, iterations=OPENING_CELLS)
        if lid.sum() < max(_LEAST_LID * opening.sum(), 1):
            continue
        outline = _completed(ndimage.binary_fill_holes(opening & convex_hull_image(lid)), opening, whole)
        if (outline & gone).sum() >= _LEAST_GONE * outline.sum() and is_framed(whole, outline):
            found.append(outline)
    return (face, whole, found) if found else (stack, stack, [])


def _completed(outline: Outline, opening: Outline, stack: Stack) -> Outline:
    """An outline (R, C) with the corners that silhouettes have opened, if the rim that is left tells a section."""
    places = border_of(outline)
    face = _agreed_face(stack, opening)
    beside = ndimage.distance_transform_edt(~face) if face.any() else np.full(face.shape, np.inf)
    cells = np.clip(np.round(places).astype(int), 0, np.array(face.shape) - 1)
    section = around(places[beside[tuple(cells.T)] <= _RIM_CELLS])
    if section is None:
        return outline & stack.domain
    lattice = np.moveaxis(np.indices(outline.shape), 0, -1).astype(float)
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
    open_[within] = scene.signed_distance(stack.lattice.centers()[within]) > _GONE_CELLS * pitch
    labels, _ = ndimage.label(ndimage.binary_dilation(open_, iterations=int(_GONE_CELLS)) & within)
    beside = ndimage.binary_dilation(stack.refuted, iterations=_TOUCH_CELLS)
    touching = np.unique(labels[beside & (labels > 0)])
    return np.isin(labels, touching)
