"""Plain baselines on our densified points: planes by RANSAC, region growing, a Poisson mesh.

    python -m brepgaussian.metrics.baselines results/full OUT.csv

They say what the labels and the B-Rep add to the points. Spacing and noise are taken from the points.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from brepgaussian.artifacts.points import Points, read_points
from brepgaussian.artifacts.truth import Truth, read_truth
from brepgaussian.log import progress, setup
from brepgaussian.metrics.columns import BASELINES, OK
from brepgaussian.metrics.external import score_mesh, score_patches
from brepgaussian.metrics.table import write_rows
from brepgaussian.settings.metrics import MetricsSettings

_NEIGHBOURS = 14
_SMOOTH_DEG = 8.0  # neighbours whose normals differ by less belong to one region
_SMALLEST_SHARE = 0.003  # regions and planes with fewer of the points are dropped
_PLANE_TOLERANCE = 1.5  # in point spacings
_RANSAC_SAMPLES, _RANSAC_JUDGES = 300, 3000  # planes tried, and points that count for them
_RANSAC_NORMAL_DEG = 20.0
_MOST_PLANES = 60
_POISSON_DEPTH = 7
Array = NDArray[np.float64]
Labels = NDArray[np.int64]


def region_growing(points: Points) -> Labels:
    """(N,) regions of neighbours with similar normals; -1 for points in small ones."""
    tree = cKDTree(points.xyz)
    neighbours = tree.query(points.xyz, _NEIGHBOURS + 1)[1][:, 1:]  # (N, k)
    cosine = np.einsum("nd,nkd->nk", points.normals, points.normals[neighbours])
    first, k = np.nonzero(cosine > np.cos(np.radians(_SMOOTH_DEG)))
    size = len(points.xyz)
    links = coo_matrix((np.ones(len(first)), (first, neighbours[first, k])), shape=(size, size))
    return _large(connected_components(links, directed=False)[1])


def ransac_planes(points: Points, seed: int) -> Labels:
    """(N,) planes found one after another, split into connected pieces; -1 for the rest.

    An oriented point is a whole sample (Schnabel et al. 2007); own code, since open3d's version depends
    on its threads.
    """
    rng = np.random.default_rng(seed)
    xyz, normals = points.xyz.astype(float), points.normals.astype(float)
    tolerance = _PLANE_TOLERANCE * float(np.median(cKDTree(xyz).query(xyz, 2)[0][:, 1]))
    labels, left = np.full(len(xyz), -1, np.int64), np.arange(len(xyz))
    smallest = max(3, _SMALLEST_SHARE * len(labels))
    for plane in range(_MOST_PLANES):
        tried, judges = (rng.choice(left, min(len(left), n)) for n in (_RANSAC_SAMPLES, _RANSAC_JUDGES))
        offsets = xyz[judges] @ normals[tried].T - (xyz[tried] * normals[tried]).sum(axis=1)  # (judges, tried)
        best = tried[np.argmax((np.abs(offsets) < tolerance).sum(axis=0))]
        agree = normals[left] @ normals[best] > np.cos(np.radians(_RANSAC_NORMAL_DEG))
        inliers = agree & (np.abs((xyz[left] - xyz[best]) @ normals[best]) < tolerance)
        if inliers.sum() < smallest:
            break
        labels[left[inliers]] = plane
        left = left[~inliers]
        if len(left) < smallest:
            break
    return _large(_pieces(xyz, labels))


def poisson(points: Points, seed: int) -> tuple[Array, NDArray[np.int32]]:
    """Vertices and triangles of a screened Poisson surface."""
    import open3d as o3d

    o3d.utility.random.seed(seed)
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.xyz.astype(float)))
    cloud.normals = o3d.utility.Vector3dVector(points.normals.astype(float))
    found, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=_POISSON_DEPTH, n_threads=1)
    return np.asarray(found.vertices), np.asarray(found.triangles, np.int32)


def score_baselines(points: Points, truth: Truth, settings: MetricsSettings) -> dict[str, dict[str, Any]]:
    """Columns of `metrics.csv` by name of the baseline."""
    patch = points.curve < 0  # points of edges have no normal of their own
    used = Points(
        points.xyz[patch], points.normals[patch], points.edge[patch], points.label[patch], points.curve[patch]
    )
    xyz = used.xyz.astype(float)
    vertices, triangles = poisson(used, settings.seed)
    scores = (
        score_patches(xyz, region_growing(used), truth),
        score_patches(xyz, ransac_planes(used, settings.seed), truth),
        score_mesh(vertices, triangles, np.zeros(len(triangles), int), truth, settings),
    )
    return dict(zip(BASELINES, scores, strict=True))


def write_baselines(
    *,
    object_name: str,
    points_path: str | Path,
    truth_path: str | Path,
    out_csv: str | Path,
    settings: MetricsSettings,
) -> None:
    """Write the rows of `metrics.csv` of all baselines on one object; the baseline is the variant."""
    scores = score_baselines(read_points(points_path), read_truth(truth_path), settings)
    rows = [{"object": object_name, "variant": name, "status": OK, **row} for name, row in scores.items()]
    write_rows(rows, out_csv)


def _pieces(xyz: NDArray[np.floating], labels: Labels) -> Labels:
    """Connected pieces of each label in the graph of nearest neighbours."""
    neighbours = cKDTree(xyz).query(xyz, _NEIGHBOURS + 1)[1][:, 1:]
    first, k = np.nonzero((labels[neighbours] == labels[:, None]) & (labels >= 0)[:, None])
    links = coo_matrix((np.ones(len(first)), (first, neighbours[first, k])), shape=(len(xyz), len(xyz)))
    pieces = connected_components(links, directed=False)[1].astype(np.int64)
    return np.where(labels >= 0, pieces, -1)


def _large(labels: Labels) -> Labels:
    """Labels from 0; -1 for those of few points."""
    names, back, counts = np.unique(labels, return_inverse=True, return_counts=True)
    kept = (counts >= _SMALLEST_SHARE * len(labels)) & (names >= 0)
    return np.where(kept[back], np.cumsum(kept)[back] - 1, -1)


def main() -> None:
    """Score the baselines on all objects of a results folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path, help="folder with <object>/points.ply and truth.h5")
    parser.add_argument("out", type=Path, help="CSV file to write")
    arguments = parser.parse_args()
    setup()
    rows = []
    found = sorted(path for path in arguments.results.glob("*/points.ply") if path.with_name("truth.h5").exists())
    for path in progress(found, "baselines", len(found)):
        scores = score_baselines(read_points(path), read_truth(path.with_name("truth.h5")), MetricsSettings())
        rows += [{"object": path.parent.name, "variant": name, "status": OK, **row} for name, row in scores.items()]
    write_rows(rows, arguments.out)


if __name__ == "__main__":
    main()
