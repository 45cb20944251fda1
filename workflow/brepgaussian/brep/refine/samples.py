"""Samples on edges and on apparent contours, with what each one tells about the surfaces' parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.refine.mesh import FaceMesh, evaluate, slave
from brepgaussian.brep.structure import SMOOTH, Structure
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SPACING = 0.01  # of samples along edges and contours, unit frame
_LEAST = 4  # samples on a short edge
_TANGENT = 0.1  # |n x n| below which an edge's position is not determined by its surfaces
_END_ON = 0.2  # apparent length over true length below which an edge is seen end-on
_DAMPING = 1e-4


@dataclass(frozen=True)
class EdgeSamples:
    """Points on edges, slaved to two surfaces each.

    Attributes:
        points: (N, 3).
        table: (N, 2) the edge's two surfaces.
        edge: (N,) index into `Structure.edges`.
    """

    points: Array
    table: Indices
    edge: Indices


@dataclass(frozen=True)
class Rays:
    """Samples seen in views, one row a pair of a sample and a view.

    Attributes:
        view, group: (R,) the view; the edge, or for a contour the number of edges + its face.
        sample: (R,) index of the edge sample, -1 for a contour.
        points: (R, 3).
        table: (R, 2) the surfaces that hold the sample; (own, -1) for a contour.
        pixel: (R, 2) predicted image position, pose correction included.
        normal: (R, 2) unit image normal of the edge.
        lever: (R, 2) c of the residual's derivative: px along `normal` per signed distance.
    """

    view: Indices
    group: Indices
    sample: Indices
    points: Array
    table: Indices
    pixel: Array
    normal: Array
    lever: Array

    def take(self, rows: NDArray) -> "Rays":
        """The rows of an index or a mask."""
        return Rays(**{name: value[rows] for name, value in vars(self).items()})

    def joined(self, other: "Rays") -> "Rays":
        """These, then those of another."""
        return Rays(**{name: np.concatenate([value, getattr(other, name)]) for name, value in vars(self).items()})

    def turned(self, rows: NDArray) -> "Rays":
        """With the opposite image normal where (R,) `rows` is true."""
        sign = np.where(rows, -1.0, 1.0)[:, None]
        return replace(self, normal=self.normal * sign, lever=self.lever * sign)


def edge_samples(structure: Structure, surfaces: Sequence[Surface], views: int, limit: int) -> EdgeSamples:
    """Samples on every edge whose two surfaces determine it, at most `limit` pairs with a view."""
    lengths = [np.linalg.norm(np.diff(e.polyline, axis=0), axis=1) for e in structure.edges]
    total = sum(float(length.sum()) for length in lengths)
    spacing = max(SPACING, total * views / limit)
    points, tables, edges = [np.zeros((0, 3))], [np.zeros((0, 2), np.int64)], [np.zeros(0, np.int64)]
    for index, (edge, length) in enumerate(zip(structure.edges, lengths, strict=True)):
        first, second = edge.surfaces
        if first < 0 or second < 0 or first == second or edge.convexity == SMOOTH or length.sum() <= 0:
            continue
        along = np.concatenate([[0.0], np.cumsum(length)])
        count = max(_LEAST, round(along[-1] / spacing))
        at = (np.arange(count) + 0.5) / count * along[-1]
        points.append(np.column_stack([np.interp(at, along, edge.polyline[:, k]) for k in range(3)]))
        tables.append(np.tile(np.array([[first, second]], np.int64), (count, 1)))
        edges.append(np.full(count, index, np.int64))
    samples = EdgeSamples(np.concatenate(points), np.concatenate(tables), np.concatenate(edges))
    return settle(samples, surfaces)


def settle(samples: EdgeSamples, surfaces: Sequence[Surface]) -> EdgeSamples:
    """Put samples back onto their surfaces after these have moved."""
    return replace(samples, points=slave(samples.points, samples.table, surfaces))


def see_edges(samples: EdgeSamples, surfaces: Sequence[Surface], cameras: Cameras, poses: Array) -> Rays:
    """All pairs of a sample and a view where the edge is not seen end-on (visibility is not tested here)."""
    count, views = len(samples.points), len(cameras)
    view, sample = np.repeat(np.arange(views), count), np.tile(np.arange(count), views)
    return _see(samples, view, sample, surfaces, cameras, poses)[1]


def _see(
    samples: EdgeSamples, view: Indices, sample: Indices, surfaces: Sequence[Surface], cameras: Cameras, poses: Array
) -> tuple[Indices, Rays]:
    """Those of some pairs (R,) of a view and a sample where the edge is not seen end-on."""
    _, normals = evaluate(samples.points, samples.table, surfaces)
    tangent = np.cross(normals[:, 0], normals[:, 1])
    sine = np.linalg.norm(tangent, axis=1)
    tangent /= np.maximum(sine, 1e-12)[:, None]
    some = np.flatnonzero((sine > _TANGENT)[sample])
    view, sample = view[some], sample[some]
    pixel, jacobian = project(cameras, view, samples.points[sample])
    flow = np.einsum("rij,rj->ri", jacobian, tangent[sample])
    speed = np.linalg.norm(flow, axis=1)
    reach = np.linalg.norm(jacobian[:, 0], axis=1)
    keep = np.flatnonzero(speed > _END_ON * reach)
    view, sample, pixel, jacobian = view[keep], sample[keep], pixel[keep], jacobian[keep]
    flow, speed = flow[keep], speed[keep]
    normal = np.column_stack([flow[:, 1], -flow[:, 0]]) / np.maximum(speed, 1e-12)[:, None]
    pull = np.einsum("rij,ri->rj", jacobian, normal)  # g = J^T n2
    gram = np.einsum("rki,rli->rkl", normals, normals) + _DAMPING * np.eye(2)
    lever = np.linalg.solve(gram[sample], np.einsum("rki,ri->rk", normals[sample], pull)[:, :, None])[:, :, 0]
    rays = Rays(view, samples.edge[sample], sample, samples.points[sample], samples.table[sample], pixel, normal, lever)
    return some[keep], _posed(rays, cameras, poses)


def see_contours(
    mesh: FaceMesh, structure: Structure, surfaces: Sequence[Surface], cameras: Cameras, poses: Array, spacing: float
) -> Rays:
    """Apparent contours: where a curved face turns away from a camera, n . (X - C) = 0."""
    parts = []
    for index, face in enumerate(structure.faces):
        if face.surface < 0 or surfaces[face.surface].kind == "plane":
            continue
        found = _contour(mesh, index, surfaces[face.surface], cameras.centers, spacing)
        if found is not None:
            view, points = found
            table = np.column_stack([np.full(len(view), face.surface), np.full(len(view), -1)])
            parts.append((view, np.full(len(view), len(structure.edges) + index), points, table))
    if not parts:
        empty, zero = np.zeros(0, np.int64), np.zeros((0, 2))
        return Rays(empty, empty, empty, np.zeros((0, 3)), np.zeros((0, 2), np.int64), zero, zero, zero)
    view, group, points, table = (np.concatenate([p[i] for p in parts]) for i in range(4))
    return _turning_away(view, group, points, table, surfaces, cameras, poses)


def _turning_away(
    view: Indices,
    group: Indices,
    points: Array,
    table: Indices,
    surfaces: Sequence[Surface],
    cameras: Cameras,
    poses: Array,
) -> Rays:
    """Rays to points (R, 3) on the apparent contours of the surfaces (R, 2) that a table names first."""
    _, normals = evaluate(points, table, surfaces)
    pixel, jacobian = project(cameras, view, points)
    turned = np.einsum("rij,rj->ri", cameras.cam_from_unit[view][:, :3, :3], normals[:, 0])
    normal = turned[:, :2] / cameras.intrinsics[view, :2]
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
    pull = np.einsum("rij,ri->rj", jacobian, normal)
    lever = np.column_stack([np.einsum("ri,ri->r", pull, normals[:, 0]), np.zeros(len(view))])
    rays = Rays(view, group, np.full(len(view), -1), points, table, pixel, normal, lever)
    return _posed(rays, cameras, poses)


def _contour(
    mesh: FaceMesh, face: int, surface: Surface, centers: Array, spacing: float
) -> tuple[Indices, Array] | None:
    """(R,) views and (R, 3) points of one face's apparent contours."""
    triangles = mesh.triangles[mesh.face == face]
    if len(triangles) == 0:
        return None
    used, local = np.unique(triangles, return_inverse=True)
    triangles, nodes = local.reshape(-1, 3), mesh.vertices[used]
    normals = surface.normals(nodes)
    facing = np.einsum("ki,ki->k", normals, nodes)[None] - centers @ normals.T  # (V, K) n . (X - C)
    corner = facing[:, triangles]  # (V, T, 3)
    view, which = np.nonzero((corner.min(axis=2) < 0) & (corner.max(axis=2) > 0))
    if len(view) == 0:
        return None
    h, x = corner[view, which], nodes[triangles[which]]  # (S, 3), (S, 3, 3)
    # The corner that is alone on its side joins the two crossed sides of the triangle.
    alone = np.where((h > 0).sum(axis=1) == 1, np.argmax(h, axis=1), np.argmin(h, axis=1))
    rows = np.arange(len(h))
    ends = []
    for other in (1, 2):
        second = (alone + other) % 3
        share = h[rows, alone] / (h[rows, alone] - h[rows, second])
        ends.append(x[rows, alone] + share[:, None] * (x[rows, second] - x[rows, alone]))
    length = np.linalg.norm(ends[1] - ends[0], axis=1)
    whole = np.cumsum(length) / spacing
    last = np.floor(whole).astype(np.int64)
    count = np.diff(last, prepend=0)
    pick = np.repeat(rows, count)
    step = last[pick] - (np.cumsum(count)[pick] - 1 - np.arange(len(pick))) - (whole[pick] - length[pick] / spacing)
    share = np.clip(step * spacing / np.maximum(length[pick], 1e-12), 0, 1)
    points = ends[0][pick] + share[:, None] * (ends[1][pick] - ends[0][pick])
    return view[pick], _onto_contour(points, surface, centers[view[pick]])


def _onto_contour(points: Array, surface: Surface, centers: Array) -> Array:
    """Newton's method onto f = 0 and n . (X - C) = 0, sliding along the line of sight's trace."""
    reach = 1e-3
    for _ in range(3):
        points = surface.project(points)
        normals, sight = surface.normals(points), points - centers
        trace = sight - np.einsum("ri,ri->r", sight, normals)[:, None] * normals
        trace /= np.maximum(np.linalg.norm(trace, axis=1), 1e-12)[:, None]
        value = np.einsum("ri,ri->r", normals, sight)
        ahead = points + reach * trace
        slope = (np.einsum("ri,ri->r", surface.normals(ahead), ahead - centers) - value) / reach
        safe = np.where(np.abs(slope) > 1e-6, slope, np.inf)
        points = points - np.clip(value / safe, -0.02, 0.02)[:, None] * trace
    return surface.project(points)


def followed(rays: Rays, surfaces: Sequence[Surface], cameras: Cameras, poses: Array) -> tuple[Indices, Rays]:
    """Rays to the same samples after surfaces have moved a little, but for edges that are seen end-on now.

    Returns:
        (K,) their rows in `rays`, in order, and the rays with image normals that point to the same side as before.
    """
    edges, contours = np.flatnonzero(rays.sample >= 0), np.flatnonzero(rays.sample < 0)
    _, first, sample = np.unique(rays.sample[edges], return_index=True, return_inverse=True)
    one = edges[first]
    samples = settle(EdgeSamples(rays.points[one], rays.table[one], rays.group[one]), surfaces)
    kept, now = _see(samples, rays.view[edges], sample, surfaces, cameras, poses)
    there = _moved_contours(rays.take(contours), surfaces, cameras, poses)
    rows = np.concatenate([edges[kept], contours])
    joined = replace(now.joined(there), sample=rays.sample[rows])
    return rows, joined.turned(np.einsum("ri,ri->r", joined.normal, rays.normal[rows]) < 0)


def _moved_contours(rays: Rays, surfaces: Sequence[Surface], cameras: Cameras, poses: Array) -> Rays:
    """Rays to the nearest points of contours after surfaces have moved."""
    points = rays.points.copy()
    for index in np.unique(rays.table[:, 0]):
        mine = np.flatnonzero(rays.table[:, 0] == index)
        points[mine] = _onto_contour(points[mine], surfaces[index], cameras.centers[rays.view[mine]])
    return _turning_away(rays.view, rays.group, points, rays.table, surfaces, cameras, poses)


def project(cameras: Cameras, view: Indices, points: Array) -> tuple[Array, Array]:
    """(R, 2) pixels and (R, 2, 3) their derivative by the point, each row in its own view."""
    pose, intrinsics = cameras.cam_from_unit[view], cameras.intrinsics[view]
    rotation = pose[:, :3, :3]
    camera = np.einsum("rij,rj->ri", rotation, points) + pose[:, :3, 3]
    z = np.maximum(camera[:, 2], 1e-9)
    slope = camera[:, :2] / z[:, None]
    pixel = slope * intrinsics[:, :2] + intrinsics[:, 2:]
    jacobian = rotation[:, :2] - slope[:, :, None] * rotation[:, 2:3]
    return pixel, jacobian * (intrinsics[:, :2] / z[:, None])[:, :, None]


def _posed(rays: Rays, cameras: Cameras, poses: Array) -> Rays:
    """Shift predictions by the pose corrections (V, 3): du, dv in px and roll in rad about the image centre."""
    shift = poses[rays.view]
    arm = rays.pixel - cameras.intrinsics[rays.view, 2:]
    turned = np.column_stack([-arm[:, 1], arm[:, 0]]) * shift[:, 2:]
    return replace(rays, pixel=rays.pixel + shift[:, :2] + turned)


def pose_rows(rays: Rays, cameras: Cameras) -> Array:
    """(R, 3) derivative of the predicted position along the image normal by du, dv, roll of its view."""
    arm = rays.pixel - cameras.intrinsics[rays.view, 2:]
    roll = rays.normal[:, 1] * arm[:, 0] - rays.normal[:, 0] * arm[:, 1]
    return np.column_stack([rays.normal, roll])
