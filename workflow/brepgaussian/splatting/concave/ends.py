"""Where a hole ends that rays tell no floor of: at a face behind it, if views refute that in the same place."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.log import get_logger
from brepgaussian.splatting.concave.openings import Images, refuted_share
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.rays import crossings_below
from brepgaussian.splatting.concave.scene import Scene

Array = NDArray[np.float64]

_CORE_CELLS = 1  # from an outline's border, clear of its blur
_RING_CELLS = (3, 6)  # beside an outline, of face around a far mouth
_FLAT_CELLS = 2.0  # by which the far face may lie askew
_MOSTLY = 0.5  # of the cells around: the far face may be the top of a boss, of which the hole is not in the middle
_PIERCED = 0.1  # of a hole's own cells, that silhouettes leave empty all the way
_REFUTED = 0.25  # share of the views that show something else than a lid on the far mouth: twice what opens a lid
_AROUND = 0.5  # of that share, at most, beside the mouth: there is a face

logger = get_logger("stage1")


def lengthened(images: Images, scene: Scene, prism: Prism) -> Prism:
    """A straight hole without a floor that rays tell, or the same through to the face behind it that is open there.

    A long narrow hole is seen through from nowhere, and its walls look alike all the way down.

    Args:
        images: of all views.
        scene: the hull with the hole cut as deep as it was found.
        prism: the hole.
    """
    straight = prism.endless and not prism.through and is_straight(prism)
    core = core_of(prism)
    if not straight or not core.any():
        return prism
    ring = ring_of(prism)
    far, pierced = _behind(scene, prism, core, ring)
    if far is None:
        return prism
    mouth, around, refuted = refuted_there(images, scene, prism, core, ring, far)
    open_there = pierced or refuted
    logger.info(
        "hole of area %.4f without a floor: %.0f %% of the views refute the face %.4f behind it, %.0f %% beside it%s%s",
        prism.area, 100 * mouth, far, 100 * around, ", silhouettes have pierced it" if pierced else "",
        ": through" if open_there else "",
    )  # fmt: skip
    return replace(prism, depth=far, through=True, endless=False) if open_there else prism


def is_straight(prism: Prism) -> bool:
    """Whether a hole's walls go straight down, below a countersink."""
    return not (prism.tapered or any(prism.tilt))


def core_of(prism: Prism) -> NDArray[np.bool_]:
    """(R, C) the cells of its opening, clear of the border's blur."""
    return np.asarray(ndimage.binary_erosion(prism.outline, iterations=_CORE_CELLS))


def ring_of(prism: Prism) -> NDArray[np.bool_]:
    """(R, C) cells around its opening, where a face would be."""
    near, wide = (ndimage.binary_dilation(prism.outline, iterations=n) for n in _RING_CELLS)
    return np.asarray(wide & ~near)


def refuted_there(
    images: Images, scene: Scene, prism: Prism, core: NDArray[np.bool_], ring: NDArray[np.bool_], depth: float
) -> tuple[float, float, bool]:
    """Share of the views that refute a face at a depth of a hole, and beside it; whether that tells a mouth there."""
    mouth, around = (_refuted(images, scene, prism, cells, depth) for cells in (core, ring))
    return mouth, around, mouth >= _REFUTED and around <= _AROUND * mouth


def _behind(scene: Scene, prism: Prism, core: NDArray[np.bool_], ring: NDArray[np.bool_]) -> tuple[float | None, bool]:
    """Depth of the flat face behind a hole, by a ring of cells (R, C) around it; None if there is none.

    And whether the hull is empty all along a part of its core (R, C): then it goes through.
    """
    beside, within = (_left(scene, prism, cells) for cells in (ring, core))
    middle = float(np.median(beside)) if len(beside) else 0.0
    if middle == 0 or (np.abs(beside - middle) <= _FLAT_CELLS).mean() < _MOSTLY:
        return None, False
    return middle * prism.lattice.pitch, bool((within == 0).mean() >= _PIERCED)


def _left(scene: Scene, prism: Prism, cells: NDArray[np.bool_]) -> Array:
    """(N,) depth, in cells, at which lines down from some cells (R, C) leave the hull; 0 = they do not meet it."""
    starts = prism.lattice.centers()[cells]
    crossings, _ = crossings_below(scene, starts, prism.lattice)
    beyond = np.isfinite(crossings) & (crossings > prism.depth / prism.lattice.pitch + _FLAT_CELLS)
    return np.asarray(np.where(beyond, crossings, 0.0).max(axis=1, initial=0.0))


def _refuted(images: Images, scene: Scene, prism: Prism, cells: NDArray[np.bool_], depth: float) -> float:
    """Median share of the views that show something else than the others at cells (R, C) of the face behind a hole."""
    normal = -prism.lattice.normal
    places = prism.lattice.centers()[cells] + depth * normal
    on_face = np.isfinite(scene.near(places, _FLAT_CELLS * prism.lattice.pitch))
    places = places[on_face]
    if not len(places):
        return 0.0
    normals = np.broadcast_to(normal, places.shape)
    return float(np.median(refuted_share(images, scene, places, normals, prism.lattice.pitch)))
