"""Where a hole ends that rays tell no floor of: at a face behind it, if views refute that in the same place.

The face may lean: a spout's hole enters a pot's side.
"""

from dataclasses import dataclass, replace

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
_LEAN_CELLS, _FITS = 12.0, 4  # from a leaning plane while it is sought, and how often
_MOSTLY = 0.5  # of the cells around: the far face may be the top of a boss, of which the hole is not in the middle
PIERCED = 0.1  # of a hole's own cells, that silhouettes leave empty all the way
_REFUTED = 0.25  # share of the views that show something else than a lid on the far mouth: twice what opens a lid
_AROUND = 0.5  # of that share, at most, beside the mouth: there is a face
_CLEAN = 0.1  # the same where half as many views do

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
    for nearest in (False, True):
        far, pierced = _behind(scene, prism, core, ring, nearest)
        if far is None:
            continue
        mouth, around, refuted = refuted_there(images, scene, prism, core, ring, far)
        depth = far.deepest(prism)
        logger.info(
            "hole of area %.4f without a floor: %.0f %% of the views refute the face %.4f behind it, "
            "%.0f %% beside it%s%s",
            prism.area, 100 * mouth, depth, 100 * around, ", silhouettes have pierced it" if pierced else "",
            ": through" if pierced or refuted else "",
        )  # fmt: skip
        if pierced or refuted:
            return replace(prism, depth=depth, through=True, endless=False)
    return prism


@dataclass(frozen=True)
class Far:
    """A plane behind a hole: its depth, unit frame, below row 0 and column 0, and more for each row and column."""

    depth: float
    slope: tuple[float, float] = (0.0, 0.0)

    def at(self, prism: Prism, cells: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Depths (N,) below cells (R, C), and the plane's unit normal (3,), away from the hole."""
        lattice = prism.lattice
        across = np.array(self.slope)
        normal = -lattice.normal - (across[0] * lattice.first + across[1] * lattice.second) / lattice.pitch
        return self.depth + np.argwhere(cells) @ across, normal / np.linalg.norm(normal)

    def deepest(self, prism: Prism) -> float:
        """Under the hole."""
        return float(self.at(prism, prism.outline)[0].max())


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
    images: Images, scene: Scene, prism: Prism, core: NDArray[np.bool_], ring: NDArray[np.bool_], far: Far
) -> tuple[float, float, bool]:
    """Share of the views that refute a face behind a hole, and beside it; whether that tells a mouth there."""
    mouth, around = (_refuted(images, scene, prism, cells, far) for cells in (core, ring))
    clean = mouth >= _REFUTED / 2 and around <= _CLEAN * mouth
    return mouth, around, clean or (mouth >= _REFUTED and around <= _AROUND * mouth)


def _behind(
    scene: Scene, prism: Prism, core: NDArray[np.bool_], ring: NDArray[np.bool_], nearest: bool
) -> tuple[Far | None, bool]:
    """The plane behind a hole, by a ring of cells (R, C) around it; None if there is none.

    And whether the hull is empty all along a part of its core (R, C): then it goes through. The `nearest` plane may
    lean; the farthest one is parallel to the mouth.
    """
    beside, within = (_left(scene, prism, cells, nearest) for cells in (ring, core))
    middle = float(np.median(beside)) if len(beside) else 0.0
    if middle == 0:
        return None, False
    pitch, places = prism.lattice.pitch, np.argwhere(ring)
    design = np.column_stack([np.ones(len(places)), places]).astype(float)
    plane = np.array([middle, 0.0, 0.0])
    for _ in range(_FITS if nearest else 0):
        on = (beside > 0) & (np.abs(beside - design @ plane) <= _LEAN_CELLS)
        if np.count_nonzero(on) < len(plane):
            return None, False
        plane = np.linalg.lstsq(design[on], beside[on], rcond=None)[0]
    if (np.abs(beside - design @ plane) <= _FLAT_CELLS).mean() < _MOSTLY:
        return None, False
    slope = (float(plane[1]) * pitch, float(plane[2]) * pitch)
    return Far(float(plane[0]) * pitch, slope), bool((within == 0).mean() >= PIERCED)


def _left(scene: Scene, prism: Prism, cells: NDArray[np.bool_], nearest: bool) -> Array:
    """(N,) depth, in cells, at which lines down from some cells (R, C) leave the hull; 0 = they do not meet it."""
    starts = prism.lattice.centers()[cells]
    crossings, _ = crossings_below(scene, starts, prism.lattice)
    beyond = np.isfinite(crossings) & (crossings > prism.depth / prism.lattice.pitch + _FLAT_CELLS)
    if nearest:
        first = np.where(beyond, crossings, np.inf).min(axis=1, initial=np.inf)
        return np.asarray(np.where(np.isfinite(first), first, 0.0))
    return np.asarray(np.where(beyond, crossings, 0.0).max(axis=1, initial=0.0))


def _refuted(images: Images, scene: Scene, prism: Prism, cells: NDArray[np.bool_], far: Far) -> float:
    """Median share of the views that show something else than the others at cells (R, C) of the face behind a hole."""
    depths, normal = far.at(prism, cells)
    places = prism.lattice.centers()[cells] - depths[:, None] * prism.lattice.normal
    on_face = np.isfinite(scene.near(places, _FLAT_CELLS * prism.lattice.pitch))
    places = places[on_face]
    if not len(places):
        return 0.0
    normals = np.broadcast_to(normal, places.shape)
    return float(np.median(refuted_share(images, scene, places, normals, prism.lattice.pitch)))
