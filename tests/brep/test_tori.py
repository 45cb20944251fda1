"""Pieces of a torus that cuts have left become one face again."""

import numpy as np
import pytest
from brepgaussian.brep import occ
from brepgaussian.brep.cells import make_volume
from brepgaussian.brep.solid import clean, is_valid
from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeTorus
from OCP.gp import gp_Ax2, gp_Dir, gp_Pln, gp_Pnt
from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID


def ring():
    return BRepPrimAPI_MakeTorus(gp_Ax2(gp_Pnt(0.5, 0.5, 0.5), gp_Dir(0, 1, 0)), 0.3, 0.08).Solid()


def eye_bolt():
    """A ring whose lowest part is in a collar."""
    collar = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(0.5, 0.5, 0.05), gp_Dir(0, 0, 1)), 0.18, 0.15).Solid()
    return occ.solids(BRepAlgoAPI_Fuse(ring(), collar).Shape())[0]


def cut_by(solid, *planes):
    """The solid with its faces cut by planes (point, normal), as extended sheets leave it."""
    sheets = [BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(*p), gp_Dir(*n)), -2, 2, -2, 2).Face() for p, n in planes]
    maker = make_volume([*occ.faces(solid), *sheets], 1e-7, intersect=True)
    uses = occ.ancestors(maker.Shape(), TopAbs_FACE, TopAbs_SOLID)
    outer = [face for face, around in uses if len(around) == 1]  # of two cells it is a cut
    return occ.solids(make_volume(outer, 1e-7, intersect=False).Shape())[0]


CUTS = [
    [((0.5, 0.5, 0.5), (0.0, 0.2, 1.0))],
    [((0.6, 0.5, 0.5), (1.0, 0.1, 0.3)), ((0.5, 0.5, 0.55), (0.1, 0.0, 1.0))],
    [((0.5, 0.52, 0.5), (0.05, 1.0, 0.02)), ((0.4, 0.5, 0.5), (1.0, 0.0, 0.4))],
]


@pytest.mark.parametrize("planes", CUTS)
@pytest.mark.parametrize("make", [ring, eye_bolt])
def test_a_ring_that_planes_have_cut_is_one_face(make, planes):
    whole = make()
    pieces = cut_by(whole, *planes)
    assert sum(occ.surface_kind(f) == "torus" for f in occ.faces(pieces)) > 1
    merged = clean(pieces)
    assert is_valid(merged)
    assert sorted(map(occ.surface_kind, occ.faces(merged))) == sorted(map(occ.surface_kind, occ.faces(clean(whole))))
    np.testing.assert_allclose(occ.volume(merged), occ.volume(whole), rtol=1e-6)
