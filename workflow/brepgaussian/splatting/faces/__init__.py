"""Planar faces that the images confirm: where regions of the masks agree over all views. See `docs/splatting.md`."""

from brepgaussian.splatting.faces.assign import assign, planes
from brepgaussian.splatting.faces.confirm import Face
from brepgaussian.splatting.faces.fillets import Fillet, round_edges
from brepgaussian.splatting.faces.flatten import flatten_faces
from brepgaussian.splatting.faces.tie import tied

__all__ = ["Face", "Fillet", "assign", "flatten_faces", "planes", "round_edges", "tied"]
