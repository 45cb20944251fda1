"""A block that fills the unit frame, and round openings in the middle of its top."""

import numpy as np
from brepgaussian.splatting.concave.prism import Lattice, Prism
from brepgaussian.splatting.concave.volume import Volume

SPACING = 1 / 96
GRID = np.stack(np.meshgrid(*[np.arange(97) / 96] * 3, indexing="ij"), axis=-1)
BLOCK = Volume((0.5 - np.abs(GRID - 0.5)).min(axis=-1).astype(np.float32), np.zeros(3), SPACING)


def disc(radius: float, depth: float, pitch: float) -> Prism:
    """A round blind opening."""
    cells = 2 * round(0.35 / pitch) + 1
    corner = np.array([0.5, 0.5, 1.0]) - cells * pitch / 2 * np.array([1.0, 1.0, 0])
    on = Lattice(corner, *np.eye(3), pitch, (cells, cells))
    outline = np.linalg.norm(on.centers()[..., :2] - 0.5, axis=-1) < radius
    return Prism(on, outline, depth, False, 0.0)
