"""From the facets between inside and outside to one clean solid."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepLib import BRepLib
from OCP.BRepTools import BRepTools
from OCP.ShapeFix import ShapeFix_Shape
from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopoDS import TopoDS

from brepgaussian.brep import occ
from brepgaussian.brep.cells import OUTSIDE, Arrangement, make_volume
from brepgaussian.brep.tori import with_whole_tori
from brepgaussian.errors import StageError

_UNIFY_LINEAR = 1e-6  # facets of one sheet share its surface: only rounding is forgiven
_UNIFY_ANGULAR = 1e-6


def boundary(arrangement: Arrangement, inside: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Indices of the facets with one side in an inside cell and the other not."""
    with_air = np.append(inside, False)  # OUTSIDE is -1: the last entry
    assert OUTSIDE == -1
    return np.flatnonzero(with_air[arrangement.front] != with_air[arrangement.back])


def solid_from_facets(facets: Sequence[Any]) -> Any:
    """Close facets that fit together into one solid with merged faces.

    Raises:
        StageError: they enclose no volume, or several.
    """
    if not facets:
        raise StageError("no cell is inside")
    found = occ.solids(make_volume(facets, 0.0, intersect=False).Shape())
    if not found:
        raise StageError("the facets enclose no volume")
    if len(found) > 1:
        found.sort(key=occ.volume, reverse=True)
        raise StageError(f"the facets enclose {len(found)} separate volumes")
    return clean(found[0])


def clean(solid: Any) -> Any:
    """Merge faces and edges of one surface or curve, drop internal edges, orient outwards."""
    unify = ShapeUpgrade_UnifySameDomain(with_whole_tori(solid), True, True, False)
    unify.SetLinearTolerance(_UNIFY_LINEAR)
    unify.SetAngularTolerance(_UNIFY_ANGULAR)
    unify.AllowInternalEdges(False)
    unify.Build()
    shape = unify.Shape()
    BRepTools.RemoveInternals_s(shape, True)
    found = occ.solids(shape)
    if len(found) != 1:
        raise StageError(f"merging faces left {len(found)} solids")
    result = found[0]
    if not BRepCheck_Analyzer(result).IsValid():
        fix = ShapeFix_Shape(result)
        fix.Perform()
        fixed = occ.solids(fix.Shape())
        result = fixed[0] if len(fixed) == 1 else result
    if occ.volume(result) < 0:
        result = TopoDS.Solid(result.Reversed())
    BRepLib.SameParameter_s(result, True)
    return result


def is_valid(shape: Any) -> bool:
    """BRepCheck on geometry and topology."""
    return bool(BRepCheck_Analyzer(shape, True).IsValid())


def free_edges(shape: Any) -> int:
    """Edges that do not lie between exactly two uses of faces (a seam lies twice in one face)."""
    count = 0
    for edge, around in occ.ancestors(shape, TopAbs_EDGE, TopAbs_FACE):
        if occ.is_degenerate(edge):
            continue
        if len(around) == 1 and occ.is_seam(edge, around[0]):
            continue
        count += len(around) != 2
    return count


def shortest_edge(shape: Any) -> float:
    """Length of the shortest edge (a chord sum over eight pieces)."""
    lengths = [
        np.linalg.norm(np.diff(occ.curve_samples(edge, np.inf, 9), axis=0), axis=1).sum()
        for edge in occ.shapes(shape, TopAbs_EDGE)
        if not occ.is_degenerate(edge)
    ]
    return float(min(lengths, default=0.0))
