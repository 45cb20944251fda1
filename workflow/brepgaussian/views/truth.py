"""The truth of an OCC solid: points, normals, sharp curves, topology, mesh, in the unit frame."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.truth import Truth
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.mesh import FaceMesh, mesh_solid


def unit_from_world(solid: Any) -> NDArray[np.float64]:
    """(4, 4) similarity that centres a solid's exact bounding box at (.5, .5, .5), its longest side 1."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(solid, box, False, False)
    box.SetGap(0.0)
    low, high = (np.array([p.X(), p.Y(), p.Z()]) for p in (box.CornerMin(), box.CornerMax()))
    return frame_of_box(low, high)


def frame_of_box(low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
    """(4, 4) similarity that centres the box (3,), (3,) at (.5, .5, .5) and makes its longest side 1."""
    scale = 1.0 / float(np.max(high - low))
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = 0.5 - scale * (low + high) / 2
    return matrix


def transformed(solid: Any, matrix: NDArray[np.float64]) -> Any:
    """A copy of a solid under a (4, 4) similarity; analytic surfaces stay analytic."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
    from OCP.gp import gp_Trsf

    similarity = gp_Trsf()
    similarity.SetValues(*matrix[:3].ravel())
    return BRepBuilderAPI_Transform(solid, similarity, True).Shape()


def volume_of(solid: Any) -> float:
    """Exact volume."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(solid, properties)
    return float(properties.Mass())


def truth_of_solid(solid: Any, settings: ViewsSettings) -> tuple[Truth, FaceMesh]:
    """Make the truth of a solid that is already in the unit frame, and the mesh that it rests on."""
    from brepgaussian.geometry.topology import count_topology, sharp_curves

    mesh = mesh_solid(solid, settings.mesh_deflection, settings.mesh_angle_deg)
    points, normals, point_face = mesh.sample(settings.truth_points, settings.seed)
    topology = count_topology(solid)
    curves = sharp_curves(solid, settings.curve_spacing, settings.sharp_deg)
    truth = Truth(
        points=points,
        normals=normals,
        point_face=point_face,
        face_types=topology.face_types,
        face_pairs=topology.face_pairs,
        curve_points=curves.points,
        curve_id=curves.curve_id,
        curve_types=curves.types,
        mesh_vertices=mesh.vertices,
        mesh_triangles=mesh.triangles,
        triangle_face=mesh.triangle_face,
        edge_count=topology.edge_count,
        vertex_count=topology.vertex_count,
        volume=volume_of(solid),
    )
    return truth, mesh
