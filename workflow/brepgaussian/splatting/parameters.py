"""The trained parameters of a surfel cloud, raw and natural, with Adam's moments."""

import ctypes
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.stage1 import Surfels
from brepgaussian.splatting.library import Cloud, Floats, load, pointer

BETA1, BETA2, EPSILON = 0.9, 0.999, 1e-15  # as in 3DGS
_KINDS = {"centers": 0, "quaternions": 0, "scales": 1, "opacities": 2, "channels": 0}


@dataclass
class Parameters:
    """Surfels in training: scales as logs, opacities as logits; `cloud` holds the natural values.

    The last channel is the edge value e, those before it are colours.
    """

    cloud: Cloud
    raw: dict[str, Floats] = field(default_factory=dict)
    first: dict[str, Floats] = field(default_factory=dict)
    second: dict[str, Floats] = field(default_factory=dict)
    step: int = 0

    def __post_init__(self) -> None:
        for name in _KINDS:
            value = np.ascontiguousarray(getattr(self.cloud, name), np.float32)
            setattr(self.cloud, name, value)
            if name not in self.raw:
                self.raw[name] = to_raw(name, value)
                self.first[name], self.second[name] = np.zeros_like(value), np.zeros_like(value)

    def __len__(self) -> int:
        return len(self.cloud)

    def update(self, gradients: Cloud, rates: dict[str, float], threads: int, shared: bool = False) -> None:
        """One Adam step on every parameter group that has a rate."""
        self.step += 1
        for name, rate in rates.items():
            value = getattr(self.cloud, name)
            load().bg_adam(
                pointer(self.raw[name]),
                pointer(value),
                pointer(getattr(gradients, name)),
                pointer(self.first[name]),
                pointer(self.second[name]),
                ctypes.c_int64(len(value)),
                value.size // max(len(value), 1),
                _KINDS[name],
                *(ctypes.c_float(v) for v in (rate, BETA1, BETA2, EPSILON)),
                ctypes.c_int64(self.step),
                int(shared),
                threads,
            )

    def replace(self, name: str, value: Floats) -> None:
        """Set natural values of one group; its moments stay."""
        getattr(self.cloud, name)[:] = value
        self.raw[name][:] = to_raw(name, value)

    def select(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> "Parameters":
        """Keep (or repeat) rows, with their moments."""
        cloud = Cloud(*(np.ascontiguousarray(a[rows]) for a in self.cloud.arrays()))
        pick = {
            k: {n: np.ascontiguousarray(v[rows]) for n, v in getattr(self, k).items()}
            for k in ("raw", "first", "second")
        }
        return Parameters(cloud, **pick, step=self.step)

    def surfels(self) -> Surfels:
        """The result as an artifact."""
        cloud = self.cloud
        colors = np.clip(cloud.channels[:, :-1], 0, 1)
        return Surfels(
            centers=cloud.centers,
            rotations=cloud.quaternions / np.linalg.norm(cloud.quaternions, axis=1, keepdims=True),
            scales=cloud.scales,
            opacities=cloud.opacities,
            colors=np.ascontiguousarray(np.broadcast_to(colors, (len(cloud), 3))),
            edges=np.clip(cloud.channels[:, -1], 0, 1),
        )


def to_raw(name: str, value: Floats) -> Floats:
    """The trained form of a natural value."""
    if _KINDS[name] == 1:
        return np.log(value)
    if _KINDS[name] == 2:
        return np.log(value / (1 - value))
    return value.copy()


def quaternions_of(normals: NDArray[np.floating]) -> Floats:
    """(N, 4) quaternions wxyz that turn the z axis into given (N, 3) unit normals."""
    w = 1 + normals[:, 2]
    q = np.column_stack([w, -normals[:, 1], normals[:, 0], np.zeros(len(normals))])
    down = w < 1e-6  # opposite to z: half a turn about x
    q[down] = (0, 1, 0, 0)
    return (q / np.linalg.norm(q, axis=1, keepdims=True)).astype(np.float32)


def turned(quaternions: Floats, before: Floats, after: Floats) -> Floats:
    """Turn surfels by the smallest rotation that takes unit normals (N, 3) `before` to `after`."""
    w = 1 + (before * after).sum(axis=1)
    axis = np.cross(before, after)
    opposite = w < 1e-6  # no smallest rotation: left as it is
    q = np.column_stack([w, axis])
    q[opposite] = (1, 0, 0, 0)
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    aw, ax, ay, az = q.T
    bw, bx, by, bz = quaternions.T
    product = [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]
    result = np.column_stack(product)
    return (result / np.linalg.norm(result, axis=1, keepdims=True)).astype(np.float32)
