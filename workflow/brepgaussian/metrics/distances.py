"""Distances between two surfaces or two curve networks: Chamfer, Hausdorff, normals."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.metrics import mesh

LONGEST_EDGE = 0.05  # unit lengths
QUANTILE = 0.99  # of `hd99`: a Hausdorff distance is one stray point
Array = NDArray[np.float64]


@dataclass(frozen=True)
class CloudDistance:
    """Distances between two point clouds, unit lengths; NaN if a cloud is empty.

    Attributes:
        cd_sum, cd_avg: sum and average of the two directed mean distances.
        hd: Hausdorff distance, the larger of the two directed maxima.
        hd99: the larger of the two directed 99 % quantiles.
    """

    cd_sum: float
    cd_avg: float
    hd: float
    hd99: float


def cloud_distance(first: NDArray[np.floating], second: NDArray[np.floating]) -> CloudDistance:
    """Distances between (N, 3) and (M, 3) points.

    Clouds of n samples of one surface of area A are about sqrt(A / n) / 2 apart, each way: that is
    the floor of these numbers, not an error.
    """
    if len(first) == 0 or len(second) == 0:
        return CloudDistance(np.nan, np.nan, np.nan, np.nan)
    return _combine(cKDTree(second).query(first)[0], cKDTree(first).query(second)[0])


def _combine(forward: Array, backward: Array) -> CloudDistance:
    total = float(forward.mean() + backward.mean())
    return CloudDistance(
        cd_sum=total,
        cd_avg=total / 2,
        hd=float(max(forward.max(), backward.max())),
        hd99=float(max(np.quantile(forward, QUANTILE), np.quantile(backward, QUANTILE))),
    )


@dataclass(frozen=True, eq=False)
class SampledSurface:
    """A triangulated surface with samples that are uniform by area.

    Attributes:
        vertices: (K, 3) float64; triangles: (T, 3) int32, outward by the right-hand rule.
        points: (N, 3) samples; normals: (N, 3) outward unit normals there.
        threads: of nearest-point and ray queries.
    """

    vertices: Array
    triangles: NDArray[np.int32]
    points: Array
    normals: Array
    threads: int = 1

    @cached_property
    def _mesh(self) -> tuple[Array, NDArray[np.int32]]:
        """The same surface without long slivers, on which float32 ray casters err by up to 1e-3."""
        return mesh.split_long(self.vertices, self.triangles, LONGEST_EDGE)

    @cached_property
    def scene(self) -> Any:
        """The triangles as an open3d ray casting scene (float32), without slivers."""
        return self._scene(*self._mesh)

    @cached_property
    def plain_scene(self) -> Any:
        """The same with the triangles as they are, for pictures."""
        return self._scene(self.vertices, self.triangles)

    def _scene(self, vertices: Array, triangles: NDArray[np.int32]) -> Any:
        import open3d as o3d

        scene = o3d.t.geometry.RaycastingScene(nthreads=self.threads)
        scene.add_triangles(to_tensor(vertices, np.float32), to_tensor(triangles, np.uint32))
        return scene

    def closest(self, points: NDArray[np.floating]) -> tuple[Array, Array]:
        """(N,) distances of (N, 3) points to the triangles, and (N, 3) normals of the nearest triangles."""
        positions: Array = np.asarray(points, np.float64)
        found = self.scene.compute_closest_points(to_tensor(positions, np.float32), nthreads=self.threads)
        nearest = found["primitive_ids"].numpy().astype(np.int64)
        vertices, triangles = self._mesh
        distance = mesh.distance_to(positions, vertices[triangles[nearest]])  # once more in float64
        return distance, mesh.normals(vertices, triangles[nearest])


def to_tensor(array: NDArray[Any], dtype: Any) -> Any:
    """An open3d tensor of an array."""
    import open3d as o3d

    return o3d.core.Tensor.from_numpy(np.ascontiguousarray(array, dtype))


@dataclass(frozen=True)
class SurfaceDistance:
    """Distances between two surfaces without the floor of point clouds.

    Attributes:
        cd_exact: average of the two mean distances from samples to triangles.
        hd_exact: the larger of the two largest distances from samples and vertices to triangles.
        normal_consistency: mean absolute cosine between a sample's normal and that of the other
            surface's nearest triangle, averaged over both directions.
    """

    cd_exact: float
    hd_exact: float
    normal_consistency: float


def surface_distance(first: SampledSurface, second: SampledSurface) -> SurfaceDistance:
    """Point-to-triangle distances between two surfaces."""
    means, maxima, cosines = [], [], []
    for source, target in ((first, second), (second, first)):
        distance, normals = target.closest(source.points)
        at_vertices, _ = target.closest(source.vertices[np.unique(source.triangles)])
        means.append(distance.mean())
        maxima.append(max(distance.max(), at_vertices.max()))
        cosines.append(np.abs((normals * source.normals).sum(axis=1)).mean())
    return SurfaceDistance(float(np.mean(means)), float(max(maxima)), float(np.mean(cosines)))
