"""`points.ply`: the labelled point cloud."""

from collections.abc import Sequence
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
_VERTEX, _OTHER = "vertex", "labelling_"
_COMMENTS = ["brepgaussian labelled points, unit frame"]


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
        write_points(path, self)

    def _table(self) -> NDArray[np.void]:
        table = np.zeros(len(self.xyz), dtype=_DTYPE)
        for axis, name in enumerate("xyz"):
            table[name] = self.xyz[:, axis]
            table[f"n{name}"] = self.normals[:, axis]
        table["edge"], table["label"], table["curve"] = self.edge, self.label, self.curve
        return table


def write_points(path: str | Path, points: Points, others: Sequence[Points] = ()) -> None:
    """Write `points.ply` (binary little endian), other labellings of the same surface as further elements.

    Readers of point clouds know the element `vertex` alone, and skip the others.
    """
    elements = [PlyElement.describe(points._table(), _VERTEX)]
    elements += [PlyElement.describe(p._table(), f"{_OTHER}{i}") for i, p in enumerate(others, 1)]
    with atomic(path) as temporary:
        PlyData(elements, text=False, byte_order="<", comments=_COMMENTS).write(str(temporary))


def read_points(path: str | Path) -> Points:
    """Read `points.ply`."""
    return _read(path)[0]


def read_labellings(path: str | Path) -> list[Points]:
    """Read `points.ply` with the other labellings that it holds, if any; the first is `read_points`'s."""
    return _read(path)


def _read(path: str | Path) -> list[Points]:
    try:
        elements = {e.name: e for e in PlyData.read(str(path)).elements}
        names = [_VERTEX, *(name for name in elements if name.startswith(_OTHER))]
        found = [_points(elements[name]) for name in names]
    except (OSError, KeyError, ValueError) as error:
        raise ArtifactError(
            f"is not a labelled point PLY ({error})", file=path, fix="rerun the rule that makes it"
        ) from error
    if not all(np.isfinite(p.xyz).all() and np.isfinite(p.normals).all() for p in found):
        raise ArtifactError("holds points that are not finite", file=path, fix="remove them")
    return found


def _points(element: PlyElement) -> Points:
    xyz = np.column_stack([element[n] for n in ("x", "y", "z")]).astype(np.float32)
    normals = np.column_stack([element[n] for n in ("nx", "ny", "nz")]).astype(np.float32)
    edge, label, curve = (np.asarray(element[n]) for n in ("edge", "label", "curve"))
    return Points(xyz, normals, edge.astype(np.float32), label.astype(np.int32), curve.astype(np.int32))
