"""What lies between a solid with sharp edges and its fillets: neither points nor silhouettes show it.

The solid is arranged without its fillets, so evidence about these places has to be that of sharp edges: a rounded-off
edge is material there although cameras see through it, and the faces beside it go on to the edge without points.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.brep.blends import Blend, size
from brepgaussian.brep.patches import Patch
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]

_NEAR_RADII = 2.0  # from a place to the points of its fillet: (sqrt(2) - 1) radii where faces are square
_ROUNDING = 1e-6  # unit frame; places on a face are in


@dataclass(frozen=True)
class Offcut:
    """The places between a fillet and the sharp edge that it replaces.

    Attributes:
        fillet: the patch; faces: the surfaces that it touches; owners: the indices of their patches.
    """

    fillet: Patch
    faces: tuple[Surface, ...]
    owners: tuple[int, ...]

    @property
    def material(self) -> bool:
        """Whether the solid with sharp edges has material there: on convex edges."""
        return not self.fillet.surface.flipped

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """(N,) whether (N, 3) points lie there, on the faces included."""
        fillet, side = self.fillet.surface, 1.0 if self.material else -1.0
        held = side * fillet.signed_distance(points) > -_ROUNDING
        for face in self.faces:
            depth = -side * face.signed_distance(points)
            held &= (depth > -_ROUNDING) & (depth < size(fillet) + _ROUNDING)
        near = _NEAR_RADII * size(fillet) + self.fillet.reach
        inside = np.flatnonzero(held)
        held[inside] = self._tree.query(points[inside], distance_upper_bound=near)[0] <= near
        return np.asarray(held)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.fillet.xyz)


def offcuts(patches: Sequence[Patch], blends: Sequence[Blend], kept: Sequence[int]) -> tuple[Offcut, ...]:
    """The places beside every fillet of a solid that is arranged without them.

    Args:
        patches: all of them; blends: which are fillets.
        kept: indices of those that the solid is arranged from; `owners` are places in these.
    """
    return tuple(
        Offcut(patches[b.patch], tuple(patches[i].surface for i in b.faces), tuple(kept.index(i) for i in b.faces))
        for b in blends
        if set(b.faces) <= set(kept)
    )
