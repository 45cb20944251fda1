"""`stage1.ply` (surfels in the 3DGS attribute layout) and `stage1.h5` (what a PLY can't hold)."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from plyfile import PlyData, PlyElement

from brepgaussian.artifacts.base import Provenance, atomic, create_h5, open_h5, put
from brepgaussian.errors import ArtifactError

KIND = "stage1"
SH_C0 = 0.28209479177387814  # zeroth spherical harmonic: colour = 0.5 + SH_C0 * f_dc
THIRD_SCALE = 1e-6  # a surfel is flat; viewers of 3DGS files want a third, tiny, axis
_OPACITY_LIMIT = 1e-6  # keeps the logit finite
_FIELDS = tuple(
    "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3 edge".split()
)


@dataclass(frozen=True)
class Surfels:
    """2D Gaussians in the unit frame, in natural (not logit, not log) values.

    Attributes:
        centers: (N, 3) float32.
        rotations: (N, 4) float32 unit quaternions wxyz; columns of the matrix are t_u, t_v, normal (outward).
        scales: (N, 2) float32 standard deviations along t_u and t_v.
        opacities: (N,) float32 in (0, 1).
        colors: (N, 3) float32 in 0..1.
        edges: (N,) float32 edge value e in 0..1 (paper, section 3.2).
    """

    centers: NDArray[np.float32]
    rotations: NDArray[np.float32]
    scales: NDArray[np.float32]
    opacities: NDArray[np.float32]
    colors: NDArray[np.float32]
    edges: NDArray[np.float32]

    @property
    def axes(self) -> NDArray[np.float32]:
        """(N, 3, 3) rotation matrices; `axes[:, :, 2]` are the outward normals."""
        w, x, y, z = np.moveaxis(self.rotations, 1, 0)
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        return np.stack([np.stack(row, axis=-1) for row in rows], axis=1)

    @property
    def normals(self) -> NDArray[np.float32]:
        """(N, 3) outward unit normals."""
        return self.axes[:, :, 2]

    def write(self, path: str | Path) -> None:
        """Write `stage1.ply`: opacity as logit, scales as logs, a tiny third scale, rot wxyz, edge extra."""
        opacity = np.clip(self.opacities, _OPACITY_LIMIT, 1 - _OPACITY_LIMIT)
        columns = np.column_stack(
            [
                self.centers,
                self.normals,
                (self.colors - 0.5) / SH_C0,
                np.log(opacity / (1 - opacity)),
                np.log(self.scales),
                np.full(len(self.centers), np.log(THIRD_SCALE)),
                self.rotations,
                self.edges,
            ]
        ).astype("<f4")
        table = np.ascontiguousarray(columns).view([(name, "<f4") for name in _FIELDS])[:, 0]
        element = PlyElement.describe(table, "vertex")
        comments = ["brepgaussian stage1 surfels, unit frame, extra property: edge"]
        with atomic(path) as temporary:
            PlyData([element], text=False, byte_order="<", comments=comments).write(str(temporary))


def read_surfels(path: str | Path) -> Surfels:
    """Read `stage1.ply`."""
    try:
        vertex = PlyData.read(str(path))["vertex"]
        columns = {name: np.asarray(vertex[name], np.float32) for name in _FIELDS}
    except (OSError, KeyError, ValueError) as error:
        raise ArtifactError(f"is not a surfel PLY ({error})", file=path, fix="rerun the rule that makes it") from error

    def stack(names: str) -> NDArray[np.float32]:
        return np.column_stack([columns[name] for name in names.split()])

    return Surfels(
        centers=stack("x y z"),
        rotations=stack("rot_0 rot_1 rot_2 rot_3"),
        scales=np.exp(stack("scale_0 scale_1")),
        opacities=(1 / (1 + np.exp(-columns["opacity"]))).astype(np.float32),
        colors=0.5 + SH_C0 * stack("f_dc_0 f_dc_1 f_dc_2"),
        edges=columns["edge"],
    )


def _empty(*shape: int) -> NDArray[np.float32]:
    return np.zeros(shape, np.float32)


@dataclass(frozen=True)
class Evidence:
    """What stage 1 knows beside the surfels.

    Attributes:
        edge_points: (K, 3) float32 3D edge cloud; `edge_directions` (K, 3) unit tangents;
            `edge_views` (K,) int16 number of views that confirm each point.
        face_id: (N,) int32 confirmed face of each surfel in `stage1.ply`, -1 = none.
        face_planes: (F, 4) float32 outward normal and offset (n.x = d) of the confirmed planar faces.
        unobserved: (U, 3) float32 surface samples that fewer than two views see.
        hull_vertices: (K, 3) float32 and hull_triangles (T, 3) int32: the visual hull.
        losses: (I,) float32 total loss per logged iteration.
        features: (N, D) float32 patch features trained together with the geometry (the ablation without
            two stages), else (0, 0).
    """

    edge_points: NDArray[np.float32] = field(default_factory=lambda: _empty(0, 3))
    edge_directions: NDArray[np.float32] = field(default_factory=lambda: _empty(0, 3))
    edge_views: NDArray[np.int16] = field(default_factory=lambda: np.zeros(0, np.int16))
    face_id: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    face_planes: NDArray[np.float32] = field(default_factory=lambda: _empty(0, 4))
    unobserved: NDArray[np.float32] = field(default_factory=lambda: _empty(0, 3))
    hull_vertices: NDArray[np.float32] = field(default_factory=lambda: _empty(0, 3))
    hull_triangles: NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 3), np.int32))
    losses: NDArray[np.float32] = field(default_factory=lambda: _empty(0))
    features: NDArray[np.float32] = field(default_factory=lambda: _empty(0, 0))

    def write(self, path: str | Path, provenance: Provenance) -> None:
        """Write `stage1.h5`."""
        with create_h5(path, KIND, provenance) as file:
            for name, (axes, unit) in _EVIDENCE.items():
                put(file, name, getattr(self, name), axes=axes, unit=unit)


_LATER = ("features",)  # files of the same version may lack these

_EVIDENCE = {
    "edge_points": ("point,xyz", "unit frame"),
    "edge_directions": ("point,xyz", ""),
    "edge_views": ("point", "views"),
    "face_id": ("surfel", "id, -1 = none"),
    "face_planes": ("face,(nx ny nz d)", "unit frame"),
    "unobserved": ("point,xyz", "unit frame"),
    "hull_vertices": ("vertex,xyz", "unit frame"),
    "hull_triangles": ("triangle,3", ""),
    "losses": ("iteration", ""),
    "features": ("surfel,feature", ""),
}


def read_evidence(path: str | Path) -> Evidence:
    """Read `stage1.h5`."""
    with open_h5(path, KIND) as file:
        return Evidence(**{name: file[name][...] for name in _EVIDENCE if name in file or name not in _LATER})
