"""Edges of a solid rounded off by the kernel."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from scipy.spatial import cKDTree

from brepgaussian.brep import occ
from brepgaussian.brep.blends import Blend, levels, size
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.solid import clean
from brepgaussian.brep.structure import SAMPLE_SPACING, extract
from brepgaussian.errors import StageError

_NEAR_RADII = 2.0  # from a sharp edge to the points of its fillet: (sqrt(2) - 1) radii where faces are square
_BESIDE = 0.5  # of an edge that has points of its fillet beside it


def rounded_off(solid: Any, patches: Sequence[Patch], blends: Sequence[Blend]) -> Any:
    """A solid (TopoDS_Shape) with fillets instead of the sharp edges that they round off.

    Raises:
        StageError: there is no such edge, or the kernel cannot round it.
    """
    surfaces = [p.surface for p in patches]
    for level in levels(blends):
        maker = BRepFilletAPI_MakeFillet(solid)
        sharp = list(_edges(solid, surfaces))
        for blend in level:
            patch = patches[blend.patch]
            radius = size(patch.surface)
            tree = cKDTree(patch.xyz)
            reach = _NEAR_RADII * radius + patch.reach
            beside = [
                edge
                for edge, pair in sharp
                if pair == set(blend.faces)
                and np.mean(tree.query(occ.curve_samples(edge, SAMPLE_SPACING))[0] <= reach) >= _BESIDE
            ]
            if not beside:
                raise StageError(f"patch {patch.primitive} rounds off no edge")
            for edge in beside:
                if not maker.Contour(edge):  # else it goes on from an edge before
                    maker.Add(radius, edge)
        maker.Build()
        found = occ.solids(maker.Shape()) if maker.IsDone() else []
        if len(found) != 1:
            raise StageError("the kernel cannot round the edges off")
        solid = found[0]
    return clean(solid)  # an edge that a seam parts gives two fillets of one surface


def _edges(solid: Any, surfaces: Sequence[Any]) -> Iterator[tuple[Any, set[int]]]:
    """The edges of a solid and the surfaces of the two faces beside each."""
    on = [face.surface for face in extract(solid, surfaces).faces]
    faces = occ.shape_map(occ.faces(solid))
    for edge, around in occ.ancestors(solid, TopAbs_EDGE, TopAbs_FACE):
        if len(around) == 2 and not occ.is_degenerate(edge):
            yield edge, {on[faces.FindIndex(face) - 1] for face in around}
