"""Ray casting against a hull's mesh."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import open3d as o3d
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.mesh import vertex_normals

Hits = tuple[NDArray[np.float32], NDArray[np.float32]]  # (N,) distances along rays, and (N, 3) normals there


class Scene:
    """A triangle mesh to cast rays against.

    Attributes:
        vertices: (K, 3); triangles: (T, 3), counter-clockwise from outside.
        rims: concavities that are cut into it, whose rims it has less exactly than they are known.
    """

    def __init__(
        self, vertices: NDArray[np.floating], triangles: NDArray[np.integer], rims: Sequence[Prism] = ()
    ) -> None:
        self.rims = tuple(rims)
        self.vertices, self.triangles = np.asarray(vertices, np.float64), np.asarray(triangles, np.int64)
        self._last: tuple[Any, Hits] | None = None
        self._scene = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(_tensor(vertices, np.float32), _tensor(triangles, np.uint32))

    @cached_property
    def normals(self) -> NDArray[np.float64]:
        """(K, 3) outward unit normals at the vertices."""
        return vertex_normals(self.vertices, self.triangles)

    def signed_distance(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """(N,) distances of (N, 3) points, negative inside."""
        if not len(points):
            return np.zeros(0, np.float32)
        return self._scene.compute_signed_distance(_tensor(points, np.float32)).numpy()

    def inside(self, points: NDArray[np.floating]) -> NDArray[np.bool_]:
        """(N,) which of (N, 3) points lie inside: much faster than their distances."""
        if not len(points):
            return np.zeros(0, bool)
        return np.asarray(self._scene.compute_occupancy(_tensor(points, np.float32)).numpy() > 0)

    def near(self, points: NDArray[np.floating], reach: float) -> NDArray[np.float32]:
        """(N,) signed distances of (N, 3) points where less than `reach`, infinite with their sign elsewhere."""
        if not len(points):
            return np.zeros(0, np.float32)
        near = np.isfinite(self.tree.query(points, distance_upper_bound=reach + self._longest)[0])
        distance = np.full(len(points), np.inf, np.float32)
        distance[near] = self.signed_distance(points[near])
        distance[~near] = np.where(self.inside(points[~near]), -np.inf, np.inf)
        return np.where(np.abs(distance) < reach, distance, np.copysign(np.inf, distance)).astype(np.float32)

    @cached_property
    def tree(self) -> cKDTree:
        """Of the vertices."""
        return cKDTree(self.vertices)

    @cached_property
    def _longest(self) -> float:
        """Length of the longest edge: no place on a triangle is farther from all of its corners."""
        corners = self.vertices[self.triangles]
        return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(initial=0.0))

    def occluded(self, origins: NDArray[np.floating], directions: NDArray[np.floating]) -> NDArray[np.bool_]:
        """(N,) whether rays from (N, 3) origins along (N, 3) unit directions hit anything."""
        if not len(origins):
            return np.zeros(0, bool)
        return self._scene.test_occlusions(_rays(origins, directions)).numpy()

    def distances(self, origins: NDArray[np.floating], directions: NDArray[np.floating]) -> NDArray[np.float32]:
        """(N,) how far rays from (N, 3) origins along (N, 3) unit directions go, infinite where nothing is hit."""
        if not len(origins):
            return np.zeros(0, np.float32)
        return self._scene.cast_rays(_rays(origins, directions))["t_hit"].numpy()

    def hits_of(self, rays: Any) -> Hits:
        """As `hits`, of rays with `origin` and `direction`; the last answer is kept, since one hull is asked often."""
        if self._last is None or self._last[0] is not rays:
            self._last = rays, self.hits(rays.origin, rays.direction)
        return self._last[1]

    def hits(self, origins: NDArray[np.floating], directions: NDArray[np.floating]) -> Hits:
        """(N,) distance to the first crossing of rays with the mesh, infinite where there is none; (N, 3) normals."""
        if not len(origins):
            return np.zeros(0, np.float32), np.zeros((0, 3), np.float32)
        found = self._scene.cast_rays(_rays(origins, directions))
        return found["t_hit"].numpy(), found["primitive_normals"].numpy()

    def seen(
        self, origins: NDArray[np.floating], directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """(H,) rays that hit the mesh, (H, 3) where, and (H, 3) the smooth unit normals there; arguments as above."""
        if not len(origins):
            return np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3))
        found = self._scene.cast_rays(_rays(origins, directions))
        distance = found["t_hit"].numpy()
        ray = np.flatnonzero(np.isfinite(distance))
        second, third = found["primitive_uvs"].numpy()[ray].astype(np.float64).T
        weights = np.column_stack([1 - second - third, second, third])
        corners = self.normals[self.triangles[found["primitive_ids"].numpy()[ray]]]
        normals = np.einsum("hk,hkc->hc", weights, corners)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return ray, origins[ray] + distance[ray, None].astype(np.float64) * directions[ray], normals

    def intersections(
        self, origins: NDArray[np.floating], directions: NDArray[np.floating]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """(H,) ray and (H,) distance of every crossing of (N, 3) rays with the mesh, in the order of the rays."""
        if not len(origins):  # Open3D crashes without rays
            return np.zeros(0, np.int64), np.zeros(0)
        found = self._scene.list_intersections(_rays(origins, directions))
        return found["ray_ids"].numpy().astype(np.int64), found["t_hit"].numpy().astype(np.float64)


def _rays(origins: NDArray[np.floating], directions: NDArray[np.floating]) -> Any:
    rays = np.empty((len(origins), 6), np.float32)  # at once: millions of rays are cast
    rays[:, :3], rays[:, 3:] = origins, directions
    return _tensor(rays, np.float32)


def _tensor(array: NDArray[Any], dtype: type) -> Any:
    return o3d.core.Tensor.from_numpy(np.ascontiguousarray(array, dtype))
