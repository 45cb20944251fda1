"""Counterbores in curved faces: where a hole that goes through comes out wider than it is.

Of the counterbore's lid, what the hole leaves is a narrow ring, about which no place is clear of edges: no spot of a
curved face. But where the hole comes out is known, and in which direction; the mouth, seen along that, is round.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.curved import spot_around
from brepgaussian.splatting.concave.depth import looked_into
from brepgaussian.splatting.concave.draw import circle
from brepgaussian.splatting.concave.join import throat
from brepgaussian.splatting.concave.openings import SURELY_SHARE, Images, Stack, is_framed, opened, rectify
from brepgaussian.splatting.concave.planes import PARALLEL, PITCH_PIXELS, Plane
from brepgaussian.splatting.concave.prism import Prism, plane_axes
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.shapes import Opening, Shape
from brepgaussian.splatting.concave.shoulders import is_round

Array = NDArray[np.float64]

_WIDTHS = (2.5, 2.0, 1.5)  # of a hole, within which its mouth is sought: counterbores for screws are 1.6 to 2.2
_NARROWEST = 1.15  # times; less is a rim that is off
_BESIDE = 1.2  # of a hole's radius: there the face about its mouth is looked for
_PLACES = 32  # on a circle
_BEYOND = 3.0  # unit frame; clear of the object
_RAYS = 60_000
_DEPTHS, _FINER = 36, 9  # tried at first, and about the best of them
_LEAST_RISE = 0.01  # of the disagreement, below the floor: .02-.03 measured where it is told
_BLUR_CELLS = 1  # about an opening on a face that is exact
_GROWS = np.arange(-2.0, 2.1, 0.5)  # cells by which an outline may be off
_MOST_LEFT = 0.6  # of the disagreement on the lid
_NOTHING = 1e-9  # of a disagreement
_LEAST_WALL_CELLS = 3.0  # of the counterbore, where it is shallowest

logger = log.get_logger("stage1")


def counterbored(
    images: Images, scene: Scene, cell: float, known: Sequence[Prism], planes: Sequence[Plane] = ()
) -> list[Prism]:
    """The counterbores of known holes that come out in curved faces, down to their shoulders.

    Args:
        images: of all views.
        scene: the hull, with all that is known cut.
        cell: its resolution.
        known: concavities of it.
        planes: of faces that views have confirmed, in which there are other ways to find one.
    """
    found: list[Prism] = []
    for hole in filter(_is_straight, known):
        for middle, way in _mouths(hole, scene, planes, 2 * cell):
            if any(_is_about(other, middle, way) for other in found):
                continue  # a hole may be known twice, from either end
            prism = _about(images, scene, cell, middle, way, throat(hole))
            if prism is not None:
                found.append(prism)
    return found


def _is_about(prism: Prism, middle: Array, way: Array) -> bool:
    """Whether a concavity that opens along a way (3,) goes around a place (3,)."""
    cells, _ = prism.lattice.coordinates(middle[None])
    return bool(way @ prism.lattice.normal > 0 and prism.lateral(cells)[0] < 0)


def _is_straight(hole: Prism) -> bool:
    """Whether a concavity is a round hole that goes through, of one width all along."""
    if not hole.through or hole.domed or hole.tapered or hole.islands or any(hole.tilt) or hole.above:
        return False
    return is_round(hole.outline)


def _mouths(hole: Prism, scene: Scene, planes: Sequence[Plane], near: float) -> Iterator[tuple[Array, Array]]:
    """Where a hole comes out of the hull's curved faces: (3,) middle of the mouth, (3,) direction out of the solid.

    Those are all that are not `near` one of the planes.
    """
    normal, middle = hole.lattice.normal, hole.middle
    for way in (normal, -normal):
        beyond = _ring(middle + _BEYOND * way, way, _BESIDE * throat(hole))
        far = scene.distances(beyond, np.broadcast_to(-way, beyond.shape))
        if np.isfinite(far).all() and not _is_flat(beyond - far[:, None] * way, way, planes, near):
            yield middle + (_BEYOND - float(far.mean())) * way, way


def _is_flat(rim: Array, way: Array, planes: Sequence[Plane], near: float) -> bool:
    """Whether places (N, 3) about a mouth lie on a plane across the hole's direction (3,)."""
    across = [plane for plane in planes if plane.normal @ way > PARALLEL]
    return any(bool((np.abs(rim @ plane.normal - plane.offset) < near).all()) for plane in across)


def _about(images: Images, scene: Scene, cell: float, middle: Array, way: Array, radius: float) -> Prism | None:
    """The counterbore about the mouth of a hole of some radius, None if there is none."""
    pitch = PITCH_PIXELS * images.views.cameras.footprint()
    for times in _WIDTHS:  # the face is told by what is clear of the mouth, and may be narrow itself
        spot = spot_around(_ring(middle, way, times * radius), scene, cell, pitch, way)
        stack = None if spot is None else rectify(images, scene, spot.lattice, spot.relief)
        outline = None if stack is None else _mouth(stack)
        if stack is None or outline is None or not (is_round(outline) and is_framed(stack, outline)):
            continue
        wide = float(np.sqrt(np.count_nonzero(outline) / np.pi)) * pitch
        if not _NARROWEST * radius < wide < _WIDTHS[0] * radius:
            continue
        prism, share = _down_to_shoulder(images, scene, stack, outline, radius)
        good = prism is not None and share < _MOST_LEFT
        logger.info(
            "hole of radius %.4f comes out %.4f wide, shoulder %s deep: views disagree by %.2f of a lid's%s",
            radius, wide, "unknown" if prism is None else f"{prism.depth:.4f}", share, "" if good else ": not believed",
        )  # fmt: skip
        return prism if good else None
    return None


def _ring(middle: Array, way: Array, radius: float) -> Array:
    """(N, 3) places on a circle."""
    angle = np.linspace(0, 2 * np.pi, _PLACES, endpoint=False)
    first, second = plane_axes(way)
    return np.asarray(middle + radius * (np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second))


def _mouth(stack: Stack) -> NDArray[np.bool_]:
    """(R, C) the opening in a lattice's middle; the face about it is exact, so all of what is refuted belongs to it."""
    whole = ndimage.binary_fill_holes(stack.refuted_by(SURELY_SHARE)) & stack.domain
    labels, _ = ndimage.label(opened(ndimage.binary_erosion(whole, iterations=_BLUR_CELLS)))
    label = labels[tuple(n // 2 for n in labels.shape)]
    return np.asarray(labels == label) if label else np.zeros_like(whole)


def _down_to_shoulder(
    images: Images, scene: Scene, stack: Stack, outline: NDArray[np.bool_], radius: float
) -> tuple[Prism | None, float]:
    """A counterbore about a hole of some radius, and the share of the lid's disagreement that it leaves.

    None where its floor is not told: no depth is better than all deeper ones.
    """
    looked = looked_into(stack, outline, images.views.cameras.centers, scene)
    if looked is None:
        return None, 1.0
    opening = Opening(looked[0], _RAYS, outline, looked[1], images.tolerance, looked[2])
    opening.keep_clear(0.0)
    least = Shape(opening.face + _LEAST_WALL_CELLS, hollow=radius / stack.lattice.pitch + 1)
    if least.depth >= opening.deepest:
        return None, 1.0
    shape = _deepest_told(opening, least)
    if shape is None:
        return None, 1.0
    opening.keep_clear(None)
    best = min((replace(shape, grow=float(grow)) for grow in _GROWS), key=opening.cost)
    opening.keep_clear(best.grow)
    left, error = opening.score(best)
    wide = np.asarray(ndimage.distance_transform_edt(~outline) - ndimage.distance_transform_edt(outline) < best.grow)
    section = circle((*np.argwhere(wide).mean(axis=0), np.sqrt(np.count_nonzero(wide) / np.pi)))
    prism = Prism(stack.lattice, wide, best.depth * stack.lattice.pitch, False, error, section=section, ring=True)
    return prism, left / max(opening.closed(), _NOTHING)


def _deepest_told(opening: Opening, least: Shape) -> Shape | None:
    """The depth of the floor about a hole about which views disagree least, from a `least` one on; None if it is all.

    Where wall and floor have one grey, deeper floors are contradicted by fewer rays: then it tells nothing.
    """
    depths = np.geomspace(least.depth, opening.deepest, _DEPTHS)
    costs = np.array([opening.score(replace(least, depth=float(depth)))[0] for depth in depths])
    best = int(np.argmin(costs))
    if best == 0 or costs[best:].max() < (1 + _LEAST_RISE) * costs[best]:
        return None
    near = np.linspace(depths[best - 1], depths[min(best + 1, _DEPTHS - 1)], _FINER)
    return min((replace(least, depth=float(depth)) for depth in near), key=lambda s: opening.score(s)[0])
