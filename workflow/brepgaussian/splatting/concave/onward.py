"""Holes that go on behind a gap: the other half of a split clamp, up to the floor of a counterbore there.

Found from one end, such a hole ends at the gap. On the floor that faces it, far down a narrow pocket, few views show
its other mouth, and none shows background in it; where it has to be is known. Or a view sees through all of it: then
silhouettes have left a part of it, narrower than it is.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.ends import PIERCED, Far, core_of, is_straight, refuted_there, ring_of
from brepgaussian.splatting.concave.join import distance_between, face_each_other, throat
from brepgaussian.splatting.concave.openings import Images, across
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.rays import crossings_below
from brepgaussian.splatting.concave.scene import Scene

_NARROWER = 0.8  # of the pocket's radius, at most, the hole has
_BAND_CELLS = 1, 3  # from the rim, on either side, where its step is sought
_LEAST_CELLS = 10  # of either band, that a view sees
_STEP = 2.0  # tolerances
_LEAST_VIEWS = 3  # that see both
_OFF_CELLS = 0.5  # over the floor its views are asked: the pocket's rim is close
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
        mouth, around, refuted = refuted_there(images, scene, prism, core_of(prism), ring_of(prism), Far(depth))
        rim = _rimmed_share(images, scene, prism, depth)
        pierced = _is_pierced(scene, prism, depth)
        on = pierced or (refuted and rim >= _RIMMED)
        logger.info(
            "hole of area %.4f on to a pocket's floor %.4f away: %.0f %% of the views refute that, %.0f %% beside it, "
            "%.0f %% show its rim%s%s",
            prism.area, depth, 100 * mouth, 100 * around, 100 * rim, ", silhouettes have pierced it" if pierced else "",
            "" if on else ": not believed",
        )  # fmt: skip
        if on:
            return replace(prism, depth=depth)
    return prism


def _is_pierced(scene: Scene, prism: Prism, depth: float) -> bool:
    """Whether the hull is empty all along a part of a hole, from where it ends down to a depth."""
    crossings, _ = crossings_below(scene, prism.lattice.centers()[core_of(prism)], prism.lattice)
    ends = np.array([prism.depth, depth]) / prism.lattice.pitch
    between = (crossings > ends[0]) & (crossings < ends[1] - _OFF_CELLS)
    return bool(len(between) and (~between.any(axis=1)).mean() >= PIERCED)


def _rimmed_share(images: Images, scene: Scene, prism: Prism, depth: float) -> float:
    """Share of the views of the floor that show a step in grey all around where a hole would meet it."""
    floor = replace(prism.lowered(depth), normal=-prism.lattice.normal)
    inner, outer = (
        [change(prism.outline, iterations=k) for k in _BAND_CELLS]
        for change in (ndimage.binary_erosion, ndimage.binary_dilation)
    )
    sides = inner[0] & ~inner[1], outer[1] & ~outer[0]
    stack = across(images, scene, floor, sides[0] | sides[1], _OFF_CELLS)
    steps = []
    for grey in stack.grey:
        within, beside = (grey[side][np.isfinite(grey[side])] for side in sides)
        if min(len(within), len(beside)) >= _LEAST_CELLS:
            steps.append(abs(float(np.median(within)) - float(np.median(beside))) > _STEP * images.tolerance)
    return float(np.mean(steps)) if len(steps) >= _LEAST_VIEWS else 0.0
