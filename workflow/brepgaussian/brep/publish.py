"""The solid in files: STEP and GLB in the user's frame, read back before they are published."""

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
from OCP.gp import gp_Trsf
from OCP.IFSelect import IFSelect_RetDone
from OCP.Interface import Interface_Static
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Reader, STEPControl_Writer
from OCP.TCollection import TCollection_HAsciiString

from brepgaussian.artifacts.base import atomic
from brepgaussian.brep import occ, solid
from brepgaussian.errors import StageError

Array = NDArray[np.float64]

_STEP_UNIT = {"mm": "MM", "m": "M", "arbitrary": "MM"}  # STEP knows no unitless length
_METRE_FACTOR = 1000.0  # OCC's shapes are in mm: a world in metres is scaled for the writer
_TIME = "1970-01-01T00:00:00"  # equal input, equal bytes
_VOLUME_TOLERANCE = 1e-4  # relative; edges have a width, and a face of cover_lid (2.7e-5) comes back with another
_DEFLECTION, _ANGLE = 1e-3, 0.25  # of the viewer's mesh, unit frame
_FINE = 1e-4  # of a solid's size: deflection of a mesh whose volume is compared


def write_step(data: bytes, world_from_unit: Array, unit: str, name: str, path: str) -> None:
    """Write a solid (OCC bytes, unit frame) as STEP in the user's frame and unit, and compare what is read back.

    Raises:
        StageError: the file does not hold the same valid solid.
    """
    shape = transform(occ.from_bytes(data), world_from_unit)
    scale = _METRE_FACTOR if unit == "m" else 1.0
    if scale != 1.0:
        shape = transform(shape, np.diag([scale, scale, scale, 1.0]))
    with atomic(path) as temporary:
        _write(shape, _STEP_UNIT[unit], name, temporary)
        read = _read(temporary)
        _compare(shape, read)
        # Edges as wide as what they bound are valid in one scale and not in another: whoever scales the part, as the
        # metrics do, finds it broken.
        if not solid.is_valid(transform(read, np.diag([*[1 / (scale * _size(world_from_unit))] * 3, 1.0]))):
            raise StageError("the STEP that was read back is valid in its own scale only")


def check_step(data: bytes, world_from_unit: Array, unit: str) -> None:
    """Write and compare as `write_step` does, and keep nothing.

    Raises:
        StageError: a file would not hold the same valid solid.
    """
    with TemporaryDirectory() as folder:
        write_step(data, world_from_unit, unit, "check", str(Path(folder) / "check.step"))


def transform(shape: Any, matrix: Array) -> Any:
    """A solid moved by a (4, 4) similarity; its geometry is rewritten, no location is left.

    Raises:
        StageError: the matrix is no similarity.
    """
    linear = matrix[:3, :3]
    scale = _size(matrix)
    if not np.allclose(linear @ linear.T, scale**2 * np.eye(3), rtol=1e-6, atol=1e-9 * scale**2):
        raise StageError("world_from_unit is no similarity", fix="check the transformation of the views")
    move = gp_Trsf()
    rows = [float(v) for v in matrix[:3].ravel()]
    move.SetValues(*rows)
    result = BRepBuilderAPI_Transform(shape, move, True).Shape()
    return occ.typed(result)


def _size(similarity: Array) -> float:
    """The scale of a (4, 4) similarity."""
    return float(np.cbrt(abs(np.linalg.det(similarity[:3, :3]))))


def _write(shape: Any, unit: str, name: str, path: Path) -> None:
    writer = STEPControl_Writer()
    Interface_Static.SetCVal_s("write.step.schema", "AP214IS")
    Interface_Static.SetCVal_s("write.step.unit", unit)
    Interface_Static.SetCVal_s("write.step.product.name", name)
    Interface_Static.SetIVal_s("write.step.assembly", 0)
    if writer.Transfer(shape, STEPControl_AsIs) != IFSelect_RetDone:
        raise StageError("OCC cannot translate the solid to STEP")
    header = APIHeaderSection_MakeHeader(writer.Model())
    header.SetName(TCollection_HAsciiString(name))
    header.SetTimeStamp(TCollection_HAsciiString(_TIME))
    if writer.Write(str(path)) != IFSelect_RetDone:
        raise StageError("OCC cannot write the STEP file")
    _neutralise(path, name)


def _neutralise(path: Path, name: str) -> None:
    """Remove what OCC takes from the session: the product's running number and the time."""
    text = path.read_text(encoding="utf-8")
    quoted = name.replace("\\", "").replace("'", "''")
    text = re.sub(r"= PRODUCT\('[^']*','[^']*'", lambda _: f"= PRODUCT('{quoted}','{quoted}'", text)
    text = re.sub(r"'Open CASCADE STEP translator [^']*'", lambda _: f"'{quoted}'", text)
    text = re.sub(r"'\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d'", f"'{_TIME}'", text)
    path.write_text(text, encoding="utf-8")


def _read(path: Path) -> Any:
    reader = STEPControl_Reader()
    Interface_Static.SetCVal_s("xstep.cascade.unit", "MM")
    if reader.ReadFile(str(path)) != IFSelect_RetDone:
        raise StageError("the written STEP cannot be read back")
    reader.TransferRoots()
    return reader.OneShape()


def _compare(shape: Any, read: Any) -> None:
    """Raise if the solid that was read back differs."""
    if len(occ.solids(read)) != 1 or not solid.is_valid(read) or solid.free_edges(read):
        raise StageError("the STEP that was read back is not one closed valid solid")
    if len(occ.faces(read)) != len(occ.faces(shape)):
        raise StageError("the STEP that was read back has another number of faces")
    exact = np.isclose(occ.volume(read), occ.volume(shape), rtol=_VOLUME_TOLERANCE)
    if not (exact or np.isclose(_meshed_volume(read), _meshed_volume(shape), rtol=_VOLUME_TOLERANCE)):
        raise StageError("the STEP that was read back has another volume")


def write_glb(data: bytes, world_from_unit: Array, name: str, path: str) -> None:
    """Write a tessellation for viewers: one mesh, world frame, flat-shaded per face."""
    import trimesh

    shape = occ.from_bytes(data)
    occ.tessellate(shape, _DEFLECTION, _ANGLE)
    nodes, triangles, _ = occ.mesh_of(shape)
    world = nodes @ world_from_unit[:3, :3].T + world_from_unit[:3, 3]
    mesh = trimesh.Trimesh(world, triangles, process=False)
    scene = trimesh.Scene()
    scene.add_geometry(mesh, node_name=name, geom_name=name)
    with atomic(path) as temporary:
        temporary.write_bytes(scene.export(file_type="glb"))


def _meshed_volume(shape: Any) -> float:
    """Volume of a solid's triangles: of faces whose edges end beside a vertex, by its width, integrals are off."""
    import trimesh

    size = float(np.ptp(occ.bounds(shape), axis=0).max())
    occ.tessellate(shape, _FINE * size, _ANGLE)
    nodes, triangles, _ = occ.mesh_of(shape)
    return abs(float(trimesh.Trimesh(nodes, triangles, process=False).volume))
