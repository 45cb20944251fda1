"""Results of other methods, scored like ours: labelled clouds, meshes or STEP files, one an object.

    python -m brepgaussian.metrics.external FOLDER METHOD results/full OUT.csv [--frame world]

looks for FOLDER/<object>.<ending> or FOLDER/<object>/*.<ending> of every object with a truth under
`results/full` and writes the rows of `metrics.csv` with METHOD in the column `variant`.
"""

import argparse
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.truth import Truth, read_truth
from brepgaussian.artifacts.views import read_views
from brepgaussian.errors import BrepGaussianError, InputError
from brepgaussian.log import get_logger, progress, setup
from brepgaussian.metrics import mesh, patches, solid
from brepgaussian.metrics.columns import FAILED, OK
from brepgaussian.metrics.distances import SampledSurface
from brepgaussian.metrics.stage import score_shape, score_solid
from brepgaussian.metrics.table import write_rows
from brepgaussian.settings.metrics import MetricsSettings

STEP, MESH, CLOUD = (".step", ".stp"), (".obj", ".stl", ".off", ".glb"), (".ply", ".pcd", ".txt", ".xyz")
LABELS = ("label", "labels", "segment", "instance", "patch")  # names of a label in PLY and PCD files
_WELD_DIGITS = 7  # decimals to which corners of triangles must agree to be one
Array = NDArray[np.float64]
Labels = NDArray[np.int64]

log = get_logger("metrics")


def score_external(
    *,
    folder: str | Path,
    method: str,
    objects: Mapping[str, tuple[str | Path, str | Path]],
    out_csv: str | Path,
    settings: MetricsSettings,
    frame: str = "unit",
) -> None:
    """Score every object's file of another method.

    Args:
        folder: holds `<object>.<ending>` or `<object>/*.<ending>`; see `STEP`, `MESH`, `CLOUD`.
        method: name for the column `variant`.
        objects: object name to its `views.h5` (for the world frame) and `truth.h5`.
        out_csv: rows of `metrics.csv`; an object without a file or with an unreadable one is a failed row.
        settings: settings of the stage.
        frame: `unit` or `world`, the frame of the files.
    """
    rows = []
    for name, (views_path, truth_path) in progress(objects.items(), f"scoring {method}", len(objects)):
        row: dict[str, Any] = {"object": name, "variant": method, "status": OK}
        try:
            unit_from_file: Array = np.eye(4)
            if frame == "world":
                unit_from_file = _inverse(read_views(views_path).world_from_unit)
            file = find_file(folder, name)
            rows.append({**row, **score_file(file, read_truth(truth_path), unit_from_file, settings)})
        except BrepGaussianError as error:
            log.warning("%s: %s", name, error)
            rows.append({**row, "status": FAILED, "reason": str(error)})
    write_rows(rows, out_csv)


def find_file(folder: str | Path, name: str) -> Path:
    """The one file of an object.

    Raises:
        InputError: there is none, or more than one.
    """
    endings = (*STEP, *MESH, *CLOUD)
    beside, inside = Path(folder).glob(f"{name}.*"), (Path(folder) / name).glob("*")
    found = sorted(p for p in (*beside, *inside) if p.is_file() and p.suffix.lower() in endings)
    if len(found) != 1:
        fault = f"holds no file of {name}" if not found else f"holds {len(found)} files of {name}"
        raise InputError(fault, file=folder, fix=f"give one file {name} with one of: {' '.join(endings)}")
    return found[0]


def score_file(path: Path, truth: Truth, unit_from_file: Array, settings: MetricsSettings) -> dict[str, Any]:
    """Columns of one file: of a solid, of a surface (an OBJ's groups are patches), or of labelled points."""
    ending = path.suffix.lower()
    if ending in STEP:
        return score_solid(solid.read_step(path, _inverse(unit_from_file)), truth, settings)
    if ending in CLOUD:
        points, labels = read_cloud(path)
        if labels is not None:
            return score_patches(_moved(points, unit_from_file), labels, truth)
        if ending != ".ply":
            raise InputError("holds points without labels", file=path, fix="give the label as the last column or field")
    vertices, triangles, group = read_mesh(path)
    return score_mesh(_moved(vertices, unit_from_file), triangles, group, truth, settings)


def score_patches(points: Array, labels: Labels, truth: Truth) -> dict[str, Any]:
    """Columns `patch_...` of labelled points."""
    return patches.columns("patch", patches.score_labels(points, labels, truth.points, truth.point_face))


def score_mesh(
    vertices: Array, triangles: NDArray[np.int32], group: Labels, truth: Truth, settings: MetricsSettings
) -> dict[str, Any]:
    """Columns of a triangle mesh: distances, whether it is closed, and patches if it has groups."""
    points, index, _ = mesh.sample_triangles(vertices, triangles, settings.samples, settings.seed)
    surface = SampledSurface(vertices, triangles, points, mesh.normals(vertices, triangles)[index])
    closed = is_closed(vertices, triangles)
    row = score_shape(surface, np.zeros((0, 3)), truth, volume=closed, settings=settings) | {"closed": closed}
    row["faces_truth"] = len(truth.face_types)
    if len(np.unique(group)) > 1:
        row |= score_patches(points, group[index], truth) | {"faces": len(np.unique(group))}
    return row


def is_closed(vertices: Array, triangles: NDArray[np.int32]) -> bool:
    """Whether every edge bounds two triangles (or another even number), corners at one place being one."""
    _, welded = np.unique(np.round(vertices, _WELD_DIGITS), axis=0, return_inverse=True)
    corners = welded.reshape(-1)[triangles].astype(np.int32)
    corners = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]
    uses = mesh.edges_of(corners)[2]
    return len(uses) > 0 and bool((uses % 2 == 0).all())


def read_mesh(path: Path) -> tuple[Array, NDArray[np.int32], Labels]:
    """Vertices, triangles, and the group (an OBJ's `o` or `g`) of each triangle."""
    import trimesh

    try:
        if path.suffix.lower() == ".obj":
            vertices, triangles, group = _read_obj(path)
        else:
            whole = trimesh.load_mesh(str(path), process=False)
            vertices, triangles, group = whole.vertices, whole.faces, np.zeros(len(whole.faces), np.int64)
    except Exception as error:  # trimesh raises whatever its parsers stumble over
        raise InputError(f"is not a readable mesh ({error})", file=path, fix="export it again") from error
    if len(triangles) == 0:
        raise InputError("holds no triangles", file=path, fix="export it again")
    return np.asarray(vertices, np.float64), np.asarray(triangles, np.int32), np.asarray(group, np.int64)


def _read_obj(path: Path) -> tuple[Array, NDArray[np.int32], Labels]:
    """Positions, triangles (polygons as fans) and groups; trimesh drops the groups."""
    vertices, triangles, owner, group = [], [], [], -1
    for words in map(str.split, path.read_text(encoding="utf-8").splitlines()):
        if not words:
            continue
        if words[0] == "v":
            vertices.append([float(word) for word in words[1:4]])
        elif words[0] in ("o", "g"):
            group += 1
        elif words[0] == "f":
            corners = [int(word.split("/")[0]) for word in words[1:]]
            corners = [c - 1 if c > 0 else len(vertices) + c for c in corners]
            triangles += [(corners[0], b, c) for b, c in pairwise(corners[1:])]
            owner += [group] * (len(corners) - 2)
    return np.array(vertices).reshape(-1, 3), np.array(triangles, np.int32).reshape(-1, 3), np.array(owner, np.int64)


def read_cloud(path: Path) -> tuple[Array, Labels | None]:
    """Points and their labels; None if a PLY has triangles or no label.

    A text file has the label in its last column: `x y z label`, or with a normal in between.
    """
    try:
        if path.suffix.lower() in (".txt", ".xyz"):
            table = np.loadtxt(path, delimiter="," if "," in path.open().readline() else None, ndmin=2)
            return table[:, :3], table[:, -1].astype(np.int64) if table.shape[1] in (4, 7) else None
        if path.suffix.lower() == ".ply":
            return _read_ply(path)
        import open3d as o3d

        cloud = o3d.t.io.read_point_cloud(path)
        label = next((cloud.point[n].numpy() for n in LABELS if n in cloud.point), None)
        points = cloud.point.positions.numpy().astype(np.float64)
        return points, None if label is None else label.reshape(-1).astype(np.int64)
    except (OSError, ValueError, RuntimeError, KeyError) as error:
        raise InputError(f"is not a readable point cloud ({error})", file=path, fix="export it again") from error


def _read_ply(path: Path) -> tuple[Array, Labels | None]:
    from plyfile import PlyData, PlyParseError

    try:
        data = PlyData.read(str(path))
    except PlyParseError as error:
        raise ValueError(str(error)) from error
    vertex = data["vertex"]
    names = {p.name for p in vertex.properties}
    label = next((np.asarray(vertex[n]).astype(np.int64) for n in LABELS if n in names), None)
    return np.column_stack([vertex[n] for n in "xyz"]).astype(np.float64), label


def _inverse(matrix: Array) -> Array:
    return np.asarray(np.linalg.inv(matrix), np.float64)


def _moved(points: Array, matrix: Array) -> Array:
    return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3], np.float64)


def main() -> None:
    """Score a folder of another method's results from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="results of the other method")
    parser.add_argument("method", help="its name")
    parser.add_argument("results", type=Path, help="our folder with <object>/views.h5 and truth.h5")
    parser.add_argument("out", type=Path, help="CSV file to write")
    parser.add_argument("--frame", choices=("unit", "world"), default="unit", help="frame of the files")
    arguments = parser.parse_args()
    setup()
    truths = sorted(arguments.results.glob("*/truth.h5"))
    if not truths:
        raise SystemExit(f"{arguments.results} holds no <object>/truth.h5")
    score_external(
        folder=arguments.folder,
        method=arguments.method,
        objects={path.parent.name: (path.with_name("views.h5"), path) for path in truths},
        out_csv=arguments.out,
        settings=MetricsSettings(),
        frame=arguments.frame,
    )


if __name__ == "__main__":
    main()
