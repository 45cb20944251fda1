"""`points.ply`: the labelled point cloud."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from plyfile import PlyData, PlyElement

from brepgaussian.artifacts.base import atomic
from brepgaussian.errors import ArtifactError

_DTYPE = [(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz", "edge")] + [
    ("label", "<i4"),
    ("curve", "<i4"),
]


@dataclass(frozen=True)
class Points:
    """Labelled points in the unit frame.

    Attributes:
        xyz: (N, 3) float32 positions; `normals`: (N, 3) float32 outward unit normals.
        edge: (N,) float32 edge value in 0..1.
        label: (N,) int32 patch of each point, consecutive from 0; -1 = unassigned (not scored, not fitted).
        curve: (N,) int32 edge instance of each edge point, consecutive from 0; -1 = no edge point.
    """

    xyz: NDArray[np.float32]
    normals: NDArray[np.float32]
    edge: NDArray[np.float32]
    label: NDArray[np.int32]
    curve: NDArray[np.int32]

    def write(self, path: str | Path) -> None:
        """Write `points.ply` (binary little endian)."""
        table = np.zeros(len(self.xyz), dtype=_DTYPE)
        for axis, name in enumerate("xyz"):
            table[name] = self.xyz[:, axis]
            table[f"n{name}"] = self.normals[:, axis]
        table["edge"], table["label"], table["curve"] = self.edge, self.label, self.curve
        comments = ["brepgaussian labelled points, unit frame"]
        element = PlyElement.describe(table, "vertex")
        with atomic(path) as temporary:
            PlyData([element], text=False, byte_order="<", comments=comments).write(str(temporary))


def read_points(path: str | Path) -> Points:
    """Read `points.ply`."""
    try:
        vertex = PlyData.read(str(path))["vertex"]
        xyz = np.column_stack([vertex[n] for n in ("x", "y", "z")]).astype(np.float32)
        normals = np.column_stack([vertex[n] for n in ("nx", "ny", "nz")]).astype(np.float32)
        edge, label, curve = (np.asarray(vertex[n]) for n in ("edge", "label", "curve"))
    except (OSError, KeyError, ValueError) as error:
        raise ArtifactError(
            f"is not a labelled point PLY ({error})", file=path, fix="rerun the rule that makes it"
        ) from error
    if not (np.isfinite(xyz).all() and np.isfinite(normals).all()):
        raise ArtifactError("holds points that are not finite", file=path, fix="remove them")
    return Points(xyz, normals, edge.astype(np.float32), label.astype(np.int32), curve.astype(np.int32))
