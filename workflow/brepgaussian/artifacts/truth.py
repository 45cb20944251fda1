"""`truth.h5`: the known model of an object, for metrics and for the `truth` mask detector only."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.base import Provenance, create_h5, open_h5, put, strings

KIND = "truth"


@dataclass(frozen=True)
class Truth:
    """Ground truth of one object in the unit frame.

    Attributes:
        points: (20000, 3) float64, uniform by area.
        normals: (20000, 3) float64 outward unit normals.
        point_face: (20000,) int32 index of each point's CAD face.
        face_types: one of plane, cylinder, cone, sphere, torus, other per face.
        face_pairs: (A, 2) int32 adjacent faces, each pair once, first < second; an edge between
            two faces makes them adjacent whether sharp or smooth.
        curve_points: (M, 3) float64 samples of the sharp curves every 0.005.
        curve_id: (M,) int32 index of each sample's curve.
        curve_types: one of line, circle, ellipse, other per sharp curve.
        mesh_vertices: (K, 3) float64 and `mesh_triangles` (T, 3) int32: a fine triangulation.
        triangle_face: (T,) int32 CAD face of each triangle.
        edge_count, vertex_count: of the B-Rep (edges that are neither seams nor degenerate); -1 if unknown.
        volume: in unit-frame units cubed.
        face_ids: (V, H, W) int16 visible face per pixel centre, -1 background; None if not rendered.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    point_face: NDArray[np.int32]
    face_types: tuple[str, ...]
    face_pairs: NDArray[np.int32]
    curve_points: NDArray[np.float64]
    curve_id: NDArray[np.int32]
    curve_types: tuple[str, ...]
    mesh_vertices: NDArray[np.float64]
    mesh_triangles: NDArray[np.int32]
    triangle_face: NDArray[np.int32]
    edge_count: int
    vertex_count: int
    volume: float
    face_ids: NDArray[np.int16] | None = None

    def write(self, path: str | Path, provenance: Provenance) -> None:
        """Write `truth.h5`."""
        with create_h5(path, KIND, provenance) as file:
            file.attrs["edge_count"] = self.edge_count
            file.attrs["vertex_count"] = self.vertex_count
            file.attrs["volume"] = self.volume
            put(file, "points", self.points, axes="point,xyz", unit="unit frame")
            put(file, "normals", self.normals, axes="point,xyz")
            put(file, "point_face", self.point_face, axes="point")
            put(file, "face_types", self.face_types, axes="face")
            put(file, "face_pairs", self.face_pairs, axes="adjacency,2")
            put(file, "curve_points", self.curve_points, axes="sample,xyz", unit="unit frame")
            put(file, "curve_id", self.curve_id, axes="sample")
            put(file, "curve_types", self.curve_types, axes="curve")
            put(file, "mesh_vertices", self.mesh_vertices, axes="vertex,xyz", unit="unit frame")
            put(file, "mesh_triangles", self.mesh_triangles, axes="triangle,3")
            put(file, "triangle_face", self.triangle_face, axes="triangle")
            if self.face_ids is not None:
                put(file, "face_ids", self.face_ids, axes="view,row,column")


def read_truth(path: str | Path) -> Truth:
    """Read `truth.h5`."""
    arrays = "points normals point_face face_pairs curve_points curve_id mesh_vertices mesh_triangles triangle_face"
    with open_h5(path, KIND) as file:
        return Truth(
            **{name: file[name][...] for name in arrays.split()},
            face_types=strings(file["face_types"]),
            curve_types=strings(file["curve_types"]),
            edge_count=int(file.attrs["edge_count"]),
            vertex_count=int(file.attrs["vertex_count"]),
            volume=float(file.attrs["volume"]),
            face_ids=file["face_ids"][...] if "face_ids" in file else None,
        )
