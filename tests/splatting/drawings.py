"""Sections of all kinds drawn in cells, concavities along them, and what views show of their rims."""

import numpy as np
from brepgaussian.splatting.concave.curved_slots import Bent
from brepgaussian.splatting.concave.openings import Stack
from brepgaussian.splatting.concave.prism import Lattice, Prism
from brepgaussian.splatting.concave.sections import Flatted, Keyed, Polygon, Rounded, Section
from scipy import ndimage

SHAPE, PITCH = (90, 100), 0.005
CENTER = (43.2, 51.7)
SECTIONS = {
    "circle": Section(CENTER, 0.0, Rounded((17.3, 17.3), 17.3)),
    "small circle": Section(CENTER, 0.0, Rounded((5.2, 5.2), 5.2)),
    "slot": Section(CENTER, 0.4, Rounded((30.5, 9.8), 9.8)),
    "rectangle": Section(CENTER, -0.3, Rounded((27.4, 14.6), 0.0)),
    "pocket": Section(CENTER, 1.2, Rounded((28.1, 20.3), 9.4)),
    "hexagon": Section(CENTER, 0.2, Polygon(6, 16.2)),
    "octagon": Section(CENTER, 0.1, Polygon(8, 22.3)),
    "keyed": Section(CENTER, 2.2, Keyed(18.4, 5.6, 25.3)),
    "bent slot": Section(CENTER, 2.6, Bent(34.0, 6.3, 0.85)),
    "flatted": Section(CENTER, -0.7, Flatted(17.8, 11.2)),
}
GRID = np.stack(np.indices(SHAPE), axis=-1).astype(float)


def raster(section: Section) -> np.ndarray:
    return section.signed_distance(GRID) < 0


def opened(cells: np.ndarray) -> np.ndarray:
    return ndimage.binary_opening(cells, iterations=3)


def chewed(cells: np.ndarray, seed: int) -> np.ndarray:
    """Cells with a border that runs half a cell to and fro, smoothly as the views' do."""
    noise = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=cells.shape), 2.0)
    noise *= 0.5 / noise.std()
    signed = ndimage.distance_transform_edt(cells) - ndimage.distance_transform_edt(~cells)
    return opened(signed + noise > 0)


def prism_of(section: Section, depth: float = 0.2, flipped: bool = False) -> Prism:
    """A concavity below z = 0, or above z = -depth if flipped."""
    sign = -1.0 if flipped else 1.0
    origin = np.array([0.0, 0.0, -depth if flipped else 0.0])
    lattice = Lattice(
        origin, np.array([1.0, 0.0, 0.0]), np.array([0.0, sign, 0.0]), np.array([0.0, 0.0, sign]), PITCH, SHAPE
    )
    return Prism(lattice, raster(section), depth, True, 0.0)


def basis_of(prism: Prism) -> np.ndarray:
    return np.stack([prism.lattice.first, prism.lattice.second])


def placed(prism: Prism, cells: np.ndarray, depth: float | np.ndarray = 0.0) -> np.ndarray:
    """(N, 3) places of fractional cells (N, 2), below a prism's lattice."""
    below = np.broadcast_to(np.asarray(depth, float), len(cells))[:, None] * prism.lattice.normal
    return prism.lattice.origin + PITCH * (cells + 0.5) @ basis_of(prism) - below


def rim_seen(section: Section, height: float, views: int = 12) -> tuple[Stack, np.ndarray]:
    """What cameras around an opening show on a lattice that lies `height` cells below the plane; their centres.

    The plane is bright. Below it is a floor with stripes, which parallax moves from view to view.
    """
    prism = prism_of(section)
    lattice, turn = prism.lattice, 2 * np.pi * np.arange(views) / views
    centers = placed(prism, np.array([CENTER])) + 2 * np.column_stack([np.cos(turn), np.sin(turn), np.ones(views)])
    grey = []
    for center in centers:
        sight = center - lattice.centers()
        lean = np.stack([sight @ lattice.first, sight @ lattice.second], axis=-1) / (sight @ lattice.normal)[..., None]
        inside = section.signed_distance(GRID + height * lean)  # where the ray through a cell meets the plane
        below = 120 + 25 * np.sin((GRID - 20 * lean)[..., 0] / 4)
        grey.append(below + (200 - below) * np.clip(inside + 0.5, 0, 1))
    levels = np.array(grey, np.float32)
    return Stack(lattice, np.ones(SHAPE, bool), np.zeros(levels.shape, np.uint8), levels, np.zeros(SHAPE)), centers
