"""Tori that cuts have left in pieces: the kernel merges pieces of other surfaces, of a closed tube it may not.

The ring of an eye bolt came out right to a ten-thousandth, in thirteen faces. Such pieces are cut anew out of the whole
torus, by the edges between them and the other faces.
"""

from typing import Any

import networkx as nx
import numpy as np
from OCP.BOPTools import BOPTools_AlgoTools3D
from OCP.BRep import BRep_Tool
from OCP.BRepAlgoAPI import BRepAlgoAPI_Splitter
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.gp import gp_Pnt, gp_Pnt2d
from OCP.IntTools import IntTools_Context
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE

from brepgaussian.brep import occ
from brepgaussian.brep.cells import make_volume
from brepgaussian.errors import StageError
from brepgaussian.geometry.kernel import face_surface
from brepgaussian.primitives.relations import RESIDUALS

_SAME = 1e-6  # unit frame and radians: between pieces of one torus, only rounding is forgiven
_FUZZY = 1e-5  # unit frame: edges of two cuts of one curve
_TURN = 2 * np.pi


def with_whole_tori(solid: Any) -> Any:
    """A solid whose pieces of one torus that lie side by side are one face; as it is where there are none.

    Args:
        solid: an OCC solid, its other faces merged.
    """
    for pieces in _split(solid):
        merged = _merged(solid, pieces)
        solid = solid if merged is None else merged
    return solid


def _split(solid: Any) -> list[list[Any]]:
    """Groups of faces of one torus that share edges."""
    faces = occ.faces(solid)
    index = occ.shape_map(faces)
    found = {k: face_surface(f) for k, f in enumerate(faces) if occ.surface_kind(f) == "torus"}
    torus = {k: surface for k, surface in found.items() if surface is not None}
    graph = nx.Graph()
    for _, around in occ.ancestors(solid, TopAbs_EDGE, TopAbs_FACE):
        ends = sorted({index.FindIndex(face) - 1 for face in around} & torus.keys())
        if len(ends) == 2 and np.abs(RESIDUALS["same"](*(torus[k] for k in ends))).max() < _SAME:
            graph.add_edge(*ends)
    return [[faces[k] for k in sorted(group)] for group in nx.connected_components(graph)]


def _merged(solid: Any, pieces: list[Any]) -> Any | None:
    """The solid with pieces of a torus in as few faces as their border leaves; None if that gives no solid."""
    own = occ.shape_map(pieces)
    border = [
        edge
        for edge, around in occ.ancestors(solid, TopAbs_EDGE, TopAbs_FACE)
        if sum(own.FindIndex(face) > 0 for face in around) == 1 and len(around) == 2 and not occ.is_degenerate(edge)
    ]
    surface = BRep_Tool.Surface_s(pieces[0])
    whole = BRepBuilderAPI_MakeFace(surface, 0.0, _TURN, 0.0, _TURN, _SAME).Face()
    splitter = BRepAlgoAPI_Splitter()
    splitter.SetArguments(occ.shape_list([whole]))
    splitter.SetTools(occ.shape_list(border))
    splitter.SetFuzzyValue(_FUZZY)
    splitter.Build()
    if not splitter.IsDone():
        return None
    kept = [face for face in occ.faces(splitter.Shape()) if _covers(pieces, face)]
    others = [face for face in occ.faces(solid) if own.FindIndex(face) == 0]
    if not kept or len(kept) >= len(pieces):
        return None
    try:
        found = occ.solids(make_volume([*others, *kept], _FUZZY, intersect=True).Shape())
    except StageError:
        return None
    return found[0] if len(found) == 1 and len(occ.faces(found[0])) == len(others) + len(kept) else None


def _covers(pieces: list[Any], face: Any) -> bool:
    """Whether a point within a face lies on one of some pieces."""
    inside, parameters = gp_Pnt(), gp_Pnt2d()
    if BOPTools_AlgoTools3D.PointInFace_s(face, inside, parameters, IntTools_Context()) != 0:
        return False
    vertex = BRepBuilderAPI_MakeVertex(inside).Vertex()
    return any(BRepExtrema_DistShapeShape(vertex, piece).Value() < _FUZZY for piece in pieces)
