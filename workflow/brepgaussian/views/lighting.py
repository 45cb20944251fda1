"""Light of the renderings: fixed in the world, view-independent, diffuse; like ABC-NEF's images."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from brepgaussian.views.mesh import FaceMesh

Array = NDArray[np.float64]

# Lamps: position from the object's centre (unit frame) and linear radiance that each gives a face at the centre
# that looks at it. A sparse non-negative fit to the published images of ABC-NEF's object 00000006: its 14 convex
# faces are reproduced to 1.2 grey levels (rms over pixels), their slight gradients included.
LAMPS = (
    ((-1.73, -1.73, -1.73), 0.066),
    ((-2.12, 2.12, 0.0), 0.120),
    ((0.0, 2.12, 2.12), 0.276),
    ((3.0, 0.0, 0.0), 0.236),
    ((-2.6, -2.6, 2.6), 0.364),
    ((-2.6, 2.6, 2.6), 0.184),
    ((0.0, 0.0, -4.5), 0.519),
    ((2.6, -2.6, 2.6), 0.320),
    ((3.18, 3.18, 0.0), 0.085),
)
SHOULDER = (
    0.7  # linear radiance above which highlights are compressed: no outer face of the published object is so bright
)
_CENTER = np.full(3, 0.5)
_GATHER_RAYS = 256  # per node: a step of visibility is then less than a grey level
_NODES_AT_ONCE = 1 << 10  # their rays take 40 MB
_INSET = 0.05  # of the way to the neighbouring triangles: nodes on an edge must not lie in the other wall
_LIFT = 1e-4  # unit frame; rays start above the surface
_BOUNCES = 4  # of diffuse light, the default of Blender's Cycles


def direct(points: Array, normals: Array) -> Array:
    """(N,) linear radiance from the lamps, without shadows, at (N, 3) points with (N, 3) normals."""
    total = np.zeros(len(points))
    for position, intensity in LAMPS:
        offset = np.array(position)
        towards = _CENTER + offset - points
        squared = np.einsum("ij,ij->i", towards, towards)
        along = np.einsum("ij,ij->i", towards, normals)
        total += intensity * (offset @ offset) * np.maximum(along, 0) / (squared * np.sqrt(squared))
    return total


def display(radiance: Array) -> Array:
    """Grey levels 0..255 (not rounded) of linear radiance: soft highlights, then the sRGB curve."""
    room = 1 - SHOULDER
    excess = np.maximum(radiance - SHOULDER, 0) / room
    soft = np.maximum(np.minimum(radiance, SHOULDER) + room * excess / (1 + excess), 0)
    return 255 * np.where(soft <= 0.0031308, 12.92 * soft, 1.055 * soft ** (1 / 2.4) - 0.055)


@dataclass(frozen=True)
class Bounce:
    """Light that arrives from other parts of the object: one value at each corner of each triangle, (T, 3)."""

    corners: Array

    def at(self, triangles: NDArray[np.integer], weights: Array) -> Array:
        """(N,) irradiance at barycentric (N, 3) weights of (N,) triangles."""
        return np.einsum("nk,nk->n", weights, self.corners[triangles])


def bounce(target: FaceMesh, coarse: FaceMesh, strength: float, threads: int) -> Bounce:
    """Solve the radiosity B = D + strength * (mean of B seen from the point) on a coarse mesh.

    Args:
        target: the mesh that is rendered.
        coarse: a mesh of the same solid whose triangles are small enough to carry the light.
        strength: the albedo.
        threads: for ray casting.

    Returns:
        strength * gathered radiosity at the corners of the target's triangles.
    """
    points, normals, nodes = _nodes(coarse)
    gather = _gather_matrix(coarse, points, normals, nodes, threads)
    emitted = direct(points, normals)
    radiosity = emitted
    for _ in range(_BOUNCES - 1):  # gathering for the target is the last
        radiosity = emitted + strength * (gather @ radiosity)
    return Bounce(_transfer(target, coarse, (strength * (gather @ radiosity))[nodes]))


def _nodes(mesh: FaceMesh) -> tuple[Array, Array, NDArray[np.int64]]:
    """One node per vertex and face: points, normals, and the node at each corner of each triangle (T, 3)."""
    keys = mesh.triangles.astype(np.int64) * len(mesh.surfaces) + mesh.triangle_face[:, None]
    _, first, nodes = np.unique(keys, return_index=True, return_inverse=True)
    nodes = nodes.reshape(-1, 3)
    points = mesh.vertices[mesh.triangles.ravel()[first]]
    normals = mesh.corner_normals.reshape(-1, 3)[first]
    centroids, around = np.zeros_like(points), np.zeros(len(points))
    for k in range(3):
        np.add.at(centroids, nodes[:, k], mesh.vertices[mesh.triangles].mean(axis=1))
        np.add.at(around, nodes[:, k], 1)
    return points + _INSET * (centroids / around[:, None] - points), normals, nodes


def _gather_matrix(mesh: FaceMesh, points: Array, normals: Array, nodes: NDArray[np.int64], threads: int) -> csr_matrix:
    """(nodes, nodes) weights of the radiosity that each node sees; a row sums to the share of its sky that is
    covered by the object."""
    scene = make_scene(mesh, threads)
    backs = mesh.corner_normals.mean(axis=1)  # (T, 3)
    rows, columns, values = [], [], []
    for start in range(0, len(points), _NODES_AT_ONCE):
        some = slice(start, start + _NODES_AT_ONCE)
        directions = _hemisphere(normals[some])  # (N, R, 3)
        origins = np.repeat(points[some] + _LIFT * normals[some], _GATHER_RAYS, axis=0)
        directions = directions.reshape(-1, 3)
        hit, triangle, weights = cast(scene, origins, directions, threads)
        facing = np.einsum("ij,ij->i", directions[hit], backs[triangle]) < 0
        rows.append(np.repeat(start + np.flatnonzero(hit)[facing] // _GATHER_RAYS, 3))
        columns.append(nodes[triangle[facing]].ravel())
        values.append(weights[facing].ravel() / _GATHER_RAYS)
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return csr_matrix(entries, shape=(len(points), len(points)))


def _hemisphere(normals: Array) -> Array:
    """(N, R, 3) cosine-weighted directions around (N, 3) normals, the same pattern for each."""
    index = np.arange(_GATHER_RAYS) + 0.5
    radius, angle = np.sqrt(index / _GATHER_RAYS), index * np.pi * (3 - np.sqrt(5))
    local = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - radius**2)])
    helper = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    x = np.cross(helper, normals)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    frames = np.stack([x, np.cross(normals, x), normals], axis=1)  # (N, axis, xyz)
    return np.einsum("rk,nkd->nrd", local, frames)


def _transfer(target: FaceMesh, coarse: FaceMesh, values: Array) -> Array:
    """Values (T', 3) at the coarse corners carried to the target's corners (T, 3), each face from its own."""
    import open3d as o3d

    result = np.zeros((len(target.triangles), 3))
    for face in range(len(target.surfaces)):
        mine, theirs = np.flatnonzero(target.triangle_face == face), np.flatnonzero(coarse.triangle_face == face)
        if len(mine) == 0 or len(theirs) == 0:
            continue
        scene: Any = o3d.t.geometry.RaycastingScene(nthreads=1)
        scene.add_triangles(coarse.vertices.astype(np.float32), coarse.triangles[theirs].astype(np.uint32))
        vertices, corner = np.unique(target.triangles[mine], return_inverse=True)
        closest = scene.compute_closest_points(target.vertices[vertices].astype(np.float32), nthreads=1)
        uv = closest["primitive_uvs"].numpy().astype(float)
        weights = np.column_stack([1 - uv.sum(axis=1), uv])
        found = values[theirs[closest["primitive_ids"].numpy().astype(np.int64)]]
        result[mine] = np.einsum("nk,nk->n", weights, found)[corner.reshape(-1, 3)]
    return result


def make_scene(mesh: FaceMesh, threads: int) -> Any:
    """An Open3D ray casting scene of a mesh."""
    import open3d as o3d

    scene: Any = o3d.t.geometry.RaycastingScene(nthreads=threads)
    scene.add_triangles(mesh.vertices.astype(np.float32), mesh.triangles.astype(np.uint32))
    return scene


def cast(
    scene: Any, origins: Array, directions: Array, threads: int
) -> tuple[NDArray[np.bool_], NDArray[np.int64], Array]:
    """Cast (N, 3) rays: (N,) hit, and for the hits the triangles (H,) and barycentric weights (H, 3)."""
    rays = np.concatenate([origins, directions], axis=1).astype(np.float32)
    answer = scene.cast_rays(rays, nthreads=threads)
    hit = np.isfinite(answer["t_hit"].numpy())
    uv = answer["primitive_uvs"].numpy()[hit].astype(float)
    weights = np.column_stack([1 - uv.sum(axis=1), uv])
    return hit, answer["primitive_ids"].numpy()[hit].astype(np.int64), weights
