"""Shoulders: the floor of a wide round opening, where a narrower hole goes on along the same axis.

Rays that look into the hole contradict a flat floor. Where wall and floor throw so much light at each other that both
have one grey, a deeper floor is contradicted by fewer, and so all of a counterbore is opened too deep. That its floor
is a ring is told by a narrower opening that faces it, or by silhouettes, which have pierced the hull below it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian import log
from brepgaussian.splatting.concave.depth import shoulder
from brepgaussian.splatting.concave.join import distance_between, face_each_other, throat
from brepgaussian.splatting.concave.openings import Images, rectify
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.rays import crossings_of
from brepgaussian.splatting.concave.scene import Scene

Array = NDArray[np.float64]

_ROUND = 1.15  # of the radius that its area tells, to an opening's farthest cell
_NARROWER = 0.8  # of the opening's radius, at most, the hole has
_LEAST_HOLLOW = 0.4  # of that radius is looked past where silhouettes have pierced a part of the hole
_PIERCED_CELLS = 3
_SHALLOWER = 0.9  # of the depth of a flat floor; else that is as good

logger = log.get_logger("stage1")


def with_shoulders(images: Images, scene: Scene, prisms: Sequence[Prism], tolerance: float) -> list[Prism]:
    """The same concavities, those with a narrower hole below them down to their shoulder, the hole up to it.

    Args:
        images: of all views.
        scene: the hull, before they are cut.
        prisms: concavities of one hull.
        tolerance: distance by which the axes of one hole may seem to differ.
    """
    left = list(prisms)
    for i, wide in enumerate(prisms):
        if not _is_plain(wide):
            continue
        radius = throat(wide)
        narrow = [
            k
            for k, other in enumerate(left)
            if k != i and (other.endless or other.through) and throat(other) < _NARROWER * radius
            and face_each_other(wide, other, tolerance)
        ]  # fmt: skip
        hollow = max((throat(left[k]) for k in narrow), default=_pierced(scene, wide))
        if not hollow:
            continue
        pitch = wide.lattice.pitch
        stack = rectify(images, scene, wide.lattice)
        centers = images.views.cameras.centers
        depth = shoulder(stack, wide.outline, centers, scene, images.tolerance, hollow / pitch + 1)
        good = depth is not None and depth < _SHALLOWER * wide.depth
        logger.info(
            "opening of area %.4f over a hole of radius %.4f: shoulder %s deep, not %.4f%s",
            wide.area, hollow, "unknown" if depth is None else f"{depth:.4f}", wide.depth, "" if good else ": kept",
        )  # fmt: skip
        if depth is not None and good:
            left[i] = replace(wide, depth=depth, endless=False, ring=bool(narrow))
            for k in narrow:
                through = distance_between(wide, left[k]) - depth
                left[k] = replace(left[k], depth=max(through, left[k].depth), through=True, endless=False)
    return left


def _is_plain(prism: Prism) -> bool:
    """Whether a concavity is round and straight, has a floor, and nothing stands over it."""
    if prism.through or prism.domed or prism.draft or any(prism.tilt) or prism.above:
        return False
    cells = np.argwhere(prism.outline)
    away = np.linalg.norm(cells - cells.mean(axis=0), axis=1).max()
    return bool(away < _ROUND * np.sqrt(len(cells) / np.pi) + 1)


def _pierced(scene: Scene, prism: Prism) -> float:
    """Radius about a concavity's middle within which silhouettes have pierced what lies below; 0 if they haven't."""
    pitch = prism.lattice.pitch
    cells = np.argwhere(prism.outline)
    starts = prism.lattice.centers()[prism.outline]
    lines = np.broadcast_to(-prism.lattice.normal, starts.shape)
    crossings, _ = crossings_of(scene, starts, lines, pitch)
    solid = np.isfinite(crossings).any(axis=1)
    away = np.linalg.norm(cells - cells.mean(axis=0), axis=1)
    radius = np.sqrt(len(cells) / np.pi)
    open_cells = ~solid & (away < _NARROWER * radius)
    if np.count_nonzero(open_cells) < _PIERCED_CELLS or np.count_nonzero(~solid) > np.count_nonzero(open_cells):
        return 0.0
    return float(max(away[open_cells].max(), _LEAST_HOLLOW * radius) * pitch)
