"""Holes that go on behind a gap: the other half of a split clamp, up to the floor of a counterbore there.

Found from one end, such a hole ends at the gap. On the floor that faces it, far down a narrow pocket, few views show
its other mouth, and none shows background in it; where it has to be is known.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.ends import core_of, is_straight, refuted_there, ring_of
from brepgaussian.splatting.concave.join import distance_between, face_each_other, throat
from brepgaussian.splatting.concave.openings import Images, across
from brepgaussian.splatting.concave.prism import Lattice, Prism
from brepgaussian.splatting.concave.scene import Scene

_NARROWER = 0.8  # of the pocket's radius, at most, the hole has
_BAND_CELLS = 1, 3  # from the rim, on either side, where its step is sought
_LEAST_CELLS = 10  # of either band, that a view sees
_STEP = 2.0  # tolerances
_LEAST_VIEWS = 3  # that see both
_OFF_CELLS = 0.5  # over the floor, off the hull's roughness
_RIMMED = 0.5  # of the views that see both
_LEAST_WALL_CELLS = 3.0  # between the gap and the floor

logger = log.get_logger("stage1")


def onward(images: Images, scene: Scene, tolerance: float, prism: Prism, known: Sequence[Prism]) -> Prism:
    """A hole, or the same up to the floor of a wider pocket that faces it, if views refute that floor there.

    Args:
        images: of all views.
        scene: the hull with all concavities carved that are `known`.
        tolerance: distance by which the axes of one hole may seem to differ.
        prism: one of them.
    """
    if not (prism.through and is_straight(prism)):
        return prism
    for pocket in known:
        if pocket.through or pocket.domed or throat(prism) > _NARROWER * throat(pocket):
            continue
        if not face_each_other(prism, pocket, tolerance):
            continue
        depth = distance_between(prism, pocket) - pocket.depth
        if depth < prism.depth + _LEAST_WALL_CELLS * prism.lattice.pitch:
            continue
        mouth, around, refuted = refuted_there(images, scene, prism, core_of(prism), ring_of(prism), depth)
        rim = _rimmed_share(images, scene, prism, depth)
        on = refuted and rim >= _RIMMED
        logger.info(
            "hole of area %.4f on to a pocket's floor %.4f away: %.0f %% of the views refute that, %.0f %% beside it, "
            "%.0f %% show its rim%s",
            prism.area, depth, 100 * mouth, 100 * around, 100 * rim, "" if on else ": not believed",
        )  # fmt: skip
        if on:
            return replace(prism, depth=depth)
    return prism


def _rimmed_share(images: Images, scene: Scene, prism: Prism, depth: float) -> float:
    """Share of the views of the floor that show a step in grey all around where a hole would meet it."""
    lattice = prism.lattice
    floor = replace(lattice, origin=lattice.origin - depth * lattice.normal, normal=-lattice.normal)
    bands = [ndimage.binary_dilation(prism.outline, iterations=k) for k in _BAND_CELLS]
    inner = [ndimage.binary_erosion(prism.outline, iterations=k) for k in _BAND_CELLS]
    sides = inner[0] & ~inner[1], bands[1] & ~bands[0]
    stack = across(images, scene, floor, sides[0] | sides[1])
    seen = [np.where(_clear(images, scene, floor, side), stack.grey[:, side], np.nan) for side in sides]
    steps = []
    for within, beside in zip(*seen, strict=True):
        some = [band[np.isfinite(band)] for band in (within, beside)]
        if min(len(band) for band in some) >= _LEAST_CELLS:
            steps.append(abs(float(np.median(some[0])) - float(np.median(some[1]))) > _STEP * images.tolerance)
    return float(np.mean(steps)) if len(steps) >= _LEAST_VIEWS else 0.0


def _clear(images: Images, scene: Scene, floor: Lattice, cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(V, N) whether views see cells (R, C) of a pocket's floor past its rim, which is close to it."""
    places = floor.centers()[cells]
    start = places + _OFF_CELLS * floor.pitch * floor.normal
    result = []
    for center in images.views.cameras.centers:
        to_camera = center - start
        to_camera /= np.linalg.norm(to_camera, axis=1, keepdims=True)
        result.append(~scene.occluded(start, to_camera))
    return np.array(result)
