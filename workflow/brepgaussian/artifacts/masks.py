"""`masks.h5`: an edge map and patch ids per view."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.base import Provenance, create_h5, open_h5, put

KIND = "masks"


@dataclass(frozen=True)
class Masks:
    """Edge and patch masks of all views.

    Attributes:
        edges: (V, H, W) uint8 edge probability, 0..255 (one-to-few pixels wide).
        patches: (V, H, W) int16 region id, 0 = background or unassigned, ids start at 1 in each view.
        noise: (V,) float32 standard deviation of the image noise, grey levels.
    """

    edges: NDArray[np.uint8]
    patches: NDArray[np.int16]
    noise: NDArray[np.float32]

    def write(self, path: str | Path, provenance: Provenance) -> None:
        """Write `masks.h5`."""
        with create_h5(path, KIND, provenance) as file:
            put(file, "edges", self.edges, axes="view,row,column", unit="probability 0..255")
            put(file, "patches", self.patches, axes="view,row,column", unit="id, 0 = none")
            put(file, "noise", self.noise, axes="view", unit="grey level 0..255")


def read_masks(path: str | Path) -> Masks:
    """Read `masks.h5`."""
    with open_h5(path, KIND) as file:
        return Masks(file["edges"][...], file["patches"][...], file["noise"][...])
