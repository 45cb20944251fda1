"""Reading a STEP file into the unit frame, and its health: valid, closed, solids."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.collections import (
    IndexedDataMap_TopoDS_Shape_List_TopoDS_Shape_TopTools_ShapeMapHasher as AncestorMap,
)
from OCP.gp import gp_Trsf
from OCP.IFSelect import IFSelect_RetDone
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SOLID
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS

from brepgaussian.errors import ArtifactError
from brepgaussian.geometry.kernel import sub_shapes

MILLIMETRES = {"mm": 1.0, "m": 1000.0, "arbitrary": 1.0}  # a STEP file is read in millimetres


@dataclass(frozen=True)
class Health:
    """Whether a shape is a solid that other programs can work with.

    Attributes:
        valid: BRepCheck finds no fault in any face, edge or vertex.
        closed: it has faces, and no edge of only one face (seams count twice).
        solids: number of solids.
    """

    valid: bool
    closed: bool
    solids: int


def read_step(path: str | Path, world_from_unit: NDArray[np.float64], unit: str = "arbitrary") -> Any:
    """Read a STEP file and bring it from the world frame into the unit frame.

    Args:
        path: the STEP file, in the world's unit of length.
        world_from_unit: (4, 4) similarity of `views.h5`.
        unit: the world's unit: mm, m or arbitrary (a STEP file without a meaning is in mm).

    Returns:
        The OCC shape, in the unit frame.

    Raises:
        ArtifactError: the file is missing or holds no shape.
    """
    if not Path(path).exists():
        raise ArtifactError("does not exist", file=path, fix="rerun the brep rule")
    reader = STEPControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_RetDone or reader.TransferRoots() < 1:
        raise ArtifactError("is not a readable STEP file", file=path, fix="rerun the brep rule")
    unit_from_world = np.asarray(np.linalg.inv(world_from_unit), np.float64)
    unit_from_world[:3, :3] /= MILLIMETRES[unit]
    return transform(reader.OneShape(), unit_from_world)


def transform(shape: Any, matrix: NDArray[np.float64]) -> Any:
    """A copy of a shape under a (4, 4) similarity."""
    similarity = gp_Trsf()
    similarity.SetValues(*matrix[:3].ravel())
    return BRepBuilderAPI_Transform(shape, similarity, True).Shape()


def check(shape: Any) -> Health:
    """Check a shape."""
    edges = AncestorMap()
    TopExp.MapShapesAndAncestors_s(shape, TopAbs_EDGE, TopAbs_FACE, edges)
    uses = [
        edges.FindFromIndex(i).Extent()
        for i in range(1, edges.Extent() + 1)
        if not BRep_Tool.Degenerated_s(TopoDS.Edge(edges.FindKey(i)))
    ]
    return Health(
        valid=bool(BRepCheck_Analyzer(shape).IsValid()),
        closed=len(uses) > 0 and all(n >= 2 for n in uses),
        solids=len(sub_shapes(shape, TopAbs_SOLID)),
    )
