"""Sheets as OCC faces."""

from typing import Any

import numpy as np
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakePolygon
from OCP.Geom import (
    Geom_ConicalSurface,
    Geom_CylindricalSurface,
    Geom_SphericalSurface,
    Geom_ToroidalSurface,
)
from OCP.gp import gp_Ax3, gp_Dir, gp_Pln, gp_Pnt

from brepgaussian.brep.chart import Chart
from brepgaussian.brep.sheets import Sheet

_DEGENERATE = 1e-7  # OCC's confusion: an edge shorter than this is a point


def build_face(sheet: Sheet) -> Any:
    """The TopoDS_Face of a sheet.

    Raises:
        ValueError: OCC cannot build it.
    """
    if sheet.polygon is not None:
        return _polygon_face(sheet)
    u0, u1, v0, v1 = sheet.limits
    maker = BRepBuilderAPI_MakeFace(geom_surface(sheet.chart), u0, u1, v0, v1, _DEGENERATE)
    if not maker.IsDone():
        raise ValueError(f"no face from {sheet.chart.surface.kind} with limits {sheet.limits}")
    return maker.Face()


def axes(chart: Chart) -> gp_Ax3:
    """The chart's frame."""
    origin = gp_Pnt(*map(float, chart.surface.origin))
    return gp_Ax3(origin, gp_Dir(*map(float, chart.z)), gp_Dir(*map(float, chart.x)))


def geom_surface(chart: Chart) -> Any:
    """The Geom surface of a curved chart."""
    s, frame = chart.surface, axes(chart)
    if s.kind == "cylinder":
        return Geom_CylindricalSurface(frame, s.radius)
    if s.kind == "cone":
        return Geom_ConicalSurface(frame, s.angle, s.radius)
    if s.kind == "sphere":
        return Geom_SphericalSurface(frame, s.radius)
    return Geom_ToroidalSurface(frame, s.radius, s.minor)


def _polygon_face(sheet: Sheet) -> Any:
    assert sheet.polygon is not None
    maker = BRepBuilderAPI_MakePolygon()
    corners = sheet.chart.evaluate(sheet.polygon[:, 0], sheet.polygon[:, 1])
    for corner in np.asarray(corners):
        maker.Add(gp_Pnt(*map(float, corner)))
    maker.Close()
    face = BRepBuilderAPI_MakeFace(gp_Pln(axes(sheet.chart)), maker.Wire(), True)
    if not face.IsDone():
        raise ValueError("no face from a plane's outline")
    return face.Face()
