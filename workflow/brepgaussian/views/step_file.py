"""Reading of a user's STEP file: one solid, in mm."""

from pathlib import Path
from typing import Any

from brepgaussian.errors import InputError


def read_solid(path: Path) -> Any:
    """Read the one solid of a STEP file; the kernel converts the file's unit to mm.

    Raises:
        InputError: the file is missing or unreadable, or holds no solid or several.
    """
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.BRepLib import BRepLib
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_SOLID
    from OCP.TopoDS import TopoDS

    from brepgaussian.geometry.kernel import sub_shapes

    if not path.is_file():
        raise InputError("does not exist", file=path, fix="give the path of a STEP file")
    if b"ISO-10303-21" not in path.read_bytes()[:4096]:
        raise InputError("is not a STEP file", file=path, fix="export the part as STEP (AP203, AP214 or AP242)")
    quiet()
    reader = STEPControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_RetDone or reader.TransferRoots() < 1:
        raise InputError("is a damaged or empty STEP file", file=path, fix="export the part again")
    solids = sub_shapes(reader.OneShape(), TopAbs_SOLID)
    if len(solids) != 1:
        count = "no solid" if not solids else f"{len(solids)} solids"
        how = "sew its surfaces to a closed solid" if not solids else "give a file for each solid"
        raise InputError(f"holds {count}", file=path, fix=f"{how} in your CAD program")
    solid = TopoDS.Solid(solids[0])
    if not BRepCheck_Analyzer(solid).IsValid():
        raise InputError("holds an invalid solid (BRepCheck)", file=path, fix="heal the part in your CAD program")
    BRepLib.OrientClosedSolid_s(solid)
    return solid


def quiet() -> None:
    """Keep the kernel's transfer messages out of the log; errors are raised by us."""
    from OCP.Message import Message

    messenger = Message.DefaultMessenger_s()
    for printer in list(messenger.Printers()):
        messenger.RemovePrinter(printer)
