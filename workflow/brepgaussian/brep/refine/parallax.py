"""Where a solid's surface lies too high or too low, told by parallax (`splatting.parallax`).

Missing fillets and bulges show, which edges and silhouettes of inner corners do not.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.refine.looks import largest_areas, looks
from brepgaussian.brep.refine.visibility import Scene
from brepgaussian.brep.structure import Structure
from brepgaussian.splatting.concave import Images as Shown
from brepgaussian.splatting.parallax import PLACE_PX, SIGMAS, Depths, depths

Array = NDArray[np.float64]

_STRIDE_PX = 2  # between pixels that are asked


@dataclass(frozen=True)
class Displaced:
    """Places that surely lie elsewhere.

    Attributes:
        areas: (F,) of the largest connected ones on each face, px^2.
        depths: of all places that were asked.
    """

    areas: Array
    depths: Depths

    @property
    def area(self) -> float:
        """Of the largest connected ones on a face, px^2."""
        return float(self.areas.max(initial=0))

    @property
    def misfit(self) -> float:
        """Root mean square of the told depths over their errors, each no more than some."""
        found = self.depths
        size = np.minimum(np.abs(found.depth) / found.sigma, SIGMAS)[found.told]
        return float(np.sqrt(np.mean(size**2))) if len(size) else 0.0

    @property
    def places(self) -> Array:
        """(P, 4) centres of those that lie elsewhere (unit frame), and by how many px the surface should be deeper."""
        found = self.depths
        return np.column_stack([found.centres, found.depth])[found.off]


def displaced(scene: Scene, structure: Structure, shown: Shown, poses: Array) -> Displaced:
    """Where a solid's faces surely lie elsewhere; arguments as for `disagreement`."""
    found = depths(looks(scene, structure, shown, poses, _STRIDE_PX), shown.views.cameras.footprint(), shown.tolerance)
    areas = largest_areas(found.places[found.off], len(structure.faces))
    return Displaced(np.asarray(PLACE_PX**2 * areas, float), found)
