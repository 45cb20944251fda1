"""How good surfels are: distance to the true surface, normals, completeness, concave faces."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.stage1 import Evidence, Surfels, read_evidence, read_surfels
from brepgaussian.artifacts.truth import Truth, read_truth

MIN_OPACITY = 0.05  # fainter surfels are no surface
CONCAVE_RECALL = 0.01  # a concave sample is found when a surfel's disk lies this near, unit frame


@dataclass(frozen=True)
class SurfelQuality:
    """Distances in the unit frame, angles in degrees.

    Attributes:
        mean, p95: distance from surfel centres to the true surface.
        normal_median_deg: angle between a surfel's normal and the surface's nearest to it.
        completeness_p95: distance from true surface samples to the nearest surfel (less its own extent).
        concave_mean, concave_recall: the same distance's mean over faces that the convex hull does not touch,
            and the share of their samples within `CONCAVE_RECALL`; None where there are none.
        surfels: how many there are.
    """

    mean: float
    p95: float
    normal_median_deg: float
    completeness_p95: float
    concave_mean: float | None
    concave_recall: float | None
    surfels: int


def evaluate_surfels(surfels: Surfels, truth: Truth) -> SurfelQuality:
    """Score surfels against the truth."""
    solid = surfels.opacities > MIN_OPACITY
    centers, normals = surfels.centers[solid].astype(np.float64), surfels.normals[solid]
    distance, surface = closest(truth, centers)
    cosine = np.einsum("nc,nc->n", normals, surface)
    gaps = _gaps(surfels, solid, truth.points)
    concave = concave_samples(truth)
    return SurfelQuality(
        mean=float(distance.mean()),
        p95=float(np.quantile(distance, 0.95)),
        normal_median_deg=float(np.median(np.degrees(np.arccos(np.clip(cosine, 0, 1))))),
        completeness_p95=float(np.quantile(gaps, 0.95)),
        concave_mean=float(gaps[concave].mean()) if concave.any() else None,
        concave_recall=float((gaps[concave] < CONCAVE_RECALL).mean()) if concave.any() else None,
        surfels=int(solid.sum()),
    )


def closest(truth: Truth, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distance of (N, 3) points to the true mesh, and its unit normals (N, 3) at the nearest places."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(truth.mesh_vertices.astype(np.float32)),
        o3d.core.Tensor.from_numpy(truth.mesh_triangles.astype(np.uint32)),
    )
    found = scene.compute_closest_points(o3d.core.Tensor.from_numpy(points.astype(np.float32)))
    distance = np.linalg.norm(found["points"].numpy() - points, axis=1)
    return distance, found["primitive_normals"].numpy()


def _gaps(surfels: Surfels, solid: NDArray[np.bool_], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance from (M, 3) points to the nearest disk of one standard deviation."""
    from scipy.spatial import cKDTree

    axes, scales = surfels.axes[solid], surfels.scales[solid]
    centers = surfels.centers[solid].astype(np.float64)
    _, near = cKDTree(centers).query(points, k=min(8, len(centers)))
    near = near.reshape(len(points), -1)
    offset = points[:, None] - centers[near]  # (M, K, 3)
    local = np.einsum("mkc,mkcd->mkd", offset, axes[near])  # along t_u, t_v, n
    outside = np.maximum(np.abs(local[..., :2]) - scales[near], 0)
    return np.sqrt((outside**2).sum(-1) + local[..., 2] ** 2).min(1)


def concave_samples(truth: Truth, depth: float = 0.01) -> NDArray[np.bool_]:
    """Samples of faces that lie wholly inside the convex hull: (M,) bool.

    A face counts as concave when its median sample is more than `depth` inside of the hull; silhouettes
    often do not show such faces.
    """
    inside = _depth_in_hull(truth, truth.points)
    faces = np.unique(truth.point_face)
    deep = {face: np.median(inside[truth.point_face == face]) > depth for face in faces}
    return np.array([deep[face] for face in truth.point_face], bool)


def _depth_in_hull(truth: Truth, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) how deep points (N, 3) lie inside of the truth's convex hull."""
    from scipy.spatial import ConvexHull

    planes = ConvexHull(truth.mesh_vertices).equations  # (F, 4); a ball has tens of thousands
    parts = np.array_split(points, -(-len(points) * len(planes) // _MOST_PRODUCTS) or 1)
    return np.concatenate([-(part @ planes[:, :3].T + planes[:, 3]).max(axis=1) for part in parts])


COLUMNS = (
    "object method mean p95 normal_median_deg completeness_p95 concave_mean concave_recall edge_median "
    "inner_edge_recall seconds peak_mb"
).split()
_MOST_PRODUCTS = 20_000_000  # of points and planes at a time: 160 MB
_CURVE_GAP = 0.0075  # farther samples are no neighbours on a curve (they are .005 apart)
INNER_EDGE_DISTANCE = 0.005  # an inner edge sample is recalled when an edge point lies this near, unit frame


def edge_quality(evidence: Evidence, truth: Truth) -> tuple[float | None, float | None]:
    """Median distance of 3D edge points to the true sharp curves, and recall of those off the convex hull."""
    from scipy.spatial import cKDTree

    if len(evidence.edge_points) == 0 or len(truth.curve_points) == 0:
        return None, None
    distance = cKDTree(_dense(truth)).query(evidence.edge_points)[0]
    inner = truth.curve_points[_depth_in_hull(truth, truth.curve_points) > INNER_EDGE_DISTANCE]
    if len(inner) == 0:
        return float(np.median(distance)), None
    found = cKDTree(evidence.edge_points).query(inner)[0]
    return float(np.median(distance)), float((found < INNER_EDGE_DISTANCE).mean())


def _dense(truth: Truth, parts: int = 20) -> NDArray[np.float64]:
    """Points on the sharp curves so close that their spacing (.00025) does not count."""
    share = np.arange(parts)[:, None, None] / parts
    spacing = np.linalg.norm(np.diff(truth.curve_points, axis=0), axis=1)
    joined = (np.diff(truth.curve_id) == 0) & (spacing < _CURVE_GAP)
    first, second = truth.curve_points[:-1][joined], truth.curve_points[1:][joined]
    return np.concatenate([truth.curve_points, (first + share * (second - first)).reshape(-1, 3)])


def evaluate_stage1(
    stage1_ply: str | Path, stage1_h5: str | Path, truth_path: str | Path, method: str, seconds: float, peak_mb: float
) -> dict[str, object]:
    """One row of `results/benchmark/stage1.csv`."""
    truth, name = read_truth(truth_path), Path(stage1_ply).parent.name
    quality = evaluate_surfels(read_surfels(stage1_ply), truth)
    edge_median, inner_recall = edge_quality(read_evidence(stage1_h5), truth)
    values = {**vars(quality), "object": name, "method": method, "edge_median": edge_median}
    values |= {"inner_edge_recall": inner_recall, "seconds": seconds, "peak_mb": peak_mb}
    return {column: values[column] for column in COLUMNS}
