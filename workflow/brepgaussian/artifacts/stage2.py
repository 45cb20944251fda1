"""`stage2.h5`: a patch feature per surfel and repaired patch ids per view."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.base import Provenance, create_h5, open_h5, put

KIND = "stage2"


@dataclass(frozen=True)
class Stage2:
    """Result of stage 2.

    Attributes:
        features: (N, D) float32 unit-length features of the surfels of `stage1.ply`, in its order.
        patches: (V, H, W) int16 repaired region ids, 0 = none; ids mean the same face in every view
            if `consistent`, else they are per view.
        consistent: whether patch ids agree between views.
    """

    features: NDArray[np.float32]
    patches: NDArray[np.int16]
    consistent: bool = False

    def write(self, path: str | Path, provenance: Provenance) -> None:
        """Write `stage2.h5`."""
        with create_h5(path, KIND, provenance) as file:
            file.attrs["consistent"] = self.consistent
            put(file, "features", self.features, axes="surfel,feature")
            put(file, "patches", self.patches, axes="view,row,column", unit="id, 0 = none")


def read_stage2(path: str | Path) -> Stage2:
    """Read `stage2.h5`."""
    with open_h5(path, KIND) as file:
        return Stage2(file["features"][...], file["patches"][...], bool(file.attrs["consistent"]))
