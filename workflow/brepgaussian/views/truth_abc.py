"""The truth of an ABC model: its published mesh and feature list."""

from collections import defaultdict
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.truth import Truth
from brepgaussian.errors import InputError
from brepgaussian.geometry.chains import EdgeEnds, end_tangents, join, resample
from brepgaussian.geometry.surfaces import Surface, cone, cylinder, plane, sphere, torus
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.abc_nef_layout import TruthFiles
from brepgaussian.views.mesh import REGULAR, TRUSTED_DISTANCE, FaceMesh, facet_means
from brepgaussian.views.truth import frame_of_box

Array = NDArray[np.float64]
_SURFACES = {"Plane": "plane", "Cylinder": "cylinder", "Cone": "cone", "Sphere": "sphere", "Torus": "torus"}
_CURVES = {"Line": "line", "Circle": "circle", "Ellipse": "ellipse"}
_AGAIN = "download the object's files again"


def read_abc_truth(files: TruthFiles, settings: ViewsSettings) -> Truth:
    """Read an ABC mesh and its features, brought into the unit frame.

    Faces, curves and their counts follow `geometry.topology.count_topology`: curves with the same face on
    both sides are seams; pieces that continue each other between the same two faces count once.

    Raises:
        InputError: a file is damaged, or the two don't belong together.
    """
    vertices, triangles = read_obj(files.mesh)
    features = _read_features(files.features)
    matrix = frame_of_box(vertices.min(axis=0), vertices.max(axis=0))
    vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
    owner = _owners(features, len(triangles), files.features)
    mesh = _face_mesh(vertices, triangles, owner, features["surfaces"], matrix)
    points, normals, point_face = mesh.sample(settings.truth_points, settings.seed)
    pairs_of_edge = _mesh_edges(triangles, owner)
    pairs = sorted({tuple(pair) for pair in pairs_of_edge.values() if len(pair) == 2})
    curves = _visible_curves(features["curves"], vertices, pairs_of_edge, files.features)
    joined, corners = join([curve.ends for curve in curves])
    samples, ids, types = _sharp(curves, joined, settings.curve_spacing)
    return Truth(
        points=points,
        normals=normals,
        point_face=point_face,
        face_types=tuple(_SURFACES.get(s["type"], "other") for s in features["surfaces"]),
        face_pairs=np.array(pairs, np.int32).reshape(-1, 2),
        curve_points=samples,
        curve_id=ids,
        curve_types=types,
        mesh_vertices=vertices,
        mesh_triangles=triangles.astype(np.int32),
        triangle_face=owner,
        edge_count=len(set(joined.tolist())),
        vertex_count=corners,
        volume=mesh.volume(),
    )


def read_obj(path: Path) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (K, 3) and triangles (T, 3) of an OBJ file."""
    vertices, triangles = [], []
    try:
        for line in path.read_text(encoding="utf-8").splitlines():
            if line.startswith("v "):
                vertices.append([float(x) for x in line.split()[1:4]])
            elif line.startswith("f "):
                triangles.append([int(x.split("/")[0]) - 1 for x in line.split()[1:]])
        points, corners = np.array(vertices, float).reshape(-1, 3), np.array(triangles, np.int64).reshape(-1, 3)
    except (OSError, ValueError) as error:
        raise InputError(f"is not a readable triangle mesh ({error})", file=path, fix=_AGAIN) from error
    if len(corners) == 0 or corners.min() < 0 or corners.max() >= len(points) or not np.isfinite(points).all():
        raise InputError("holds no complete triangle mesh", file=path, fix=_AGAIN)
    return points, corners


def _read_features(path: Path) -> dict[str, Any]:
    import yaml

    try:
        with path.open(encoding="utf-8") as file:
            data = yaml.load(file, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    except (OSError, yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"is not a readable feature list ({error})", file=path, fix=_AGAIN) from error
    if not isinstance(data, dict) or not data.get("surfaces") or "curves" not in data:
        raise InputError("lists no surfaces or curves", file=path, fix=_AGAIN)
    return data


def _owners(features: dict[str, Any], count: int, path: Path) -> NDArray[np.int32]:
    """(T,) surface of each triangle."""
    owner = np.full(count, -1, np.int32)
    for index, surface in enumerate(features["surfaces"]):
        members = np.asarray(surface["face_indices"], np.int64)
        if len(members) and (members.min() < 0 or members.max() >= count):
            raise InputError("names triangles that the mesh doesn't have", file=path, fix=_AGAIN)
        owner[members] = index
    if (owner < 0).any():
        raise InputError("leaves triangles without a surface", file=path, fix=_AGAIN)
    return owner


def _face_mesh(
    vertices: Array, triangles: NDArray[np.int64], owner: NDArray[np.int32], surfaces: list[Any], matrix: Array
) -> FaceMesh:
    """The mesh with exact normals, where a surface's parameters agree with its triangles."""
    facets = np.zeros((len(triangles), 3, 3))
    found: list[Surface | None] = []
    for index, entry in enumerate(surfaces):
        mine = np.flatnonzero(owner == index)
        means = facet_means(vertices, triangles[mine])
        facets[mine] = means[triangles[mine]]
        surface = _surface(entry, matrix)
        corners = vertices[triangles[mine]].reshape(-1, 3)
        if surface is not None and np.abs(surface.signed_distance(corners)).max() <= TRUSTED_DISTANCE:
            agreement = np.einsum("ij,ij->i", surface.normals(corners), facets[mine].reshape(-1, 3)).sum()
            surface = surface if agreement > 0 else surface.flip()
            exact = surface.normals(corners).reshape(-1, 3, 3)
            regular = np.linalg.norm(exact, axis=2) > REGULAR
            facets[mine] = np.where(regular[..., None], exact, facets[mine])
        else:
            surface = None
        found.append(surface)
    return FaceMesh(vertices, triangles.astype(np.int32), owner, facets, tuple(found))


def _surface(entry: dict[str, Any], matrix: Array) -> Surface | None:
    """An ABC surface in the unit frame; None for splines, extrusions and what lacks parameters."""
    scale = float(matrix[0, 0])
    try:
        origin = matrix[:3, :3] @ np.asarray(entry["location"], float) + matrix[:3, 3]
        axis = np.asarray(entry.get("z_axis", (0.0, 0.0, 1.0)), float)
        kind = entry["type"]
        if kind == "Plane":
            return plane(origin, axis)
        if kind == "Cylinder":
            return cylinder(origin, axis, scale * entry["radius"])
        if kind == "Sphere":
            return sphere(origin, scale * entry["radius"])
        if kind == "Torus":
            return torus(origin, axis, scale * entry["max_radius"], scale * entry["min_radius"])
        if kind == "Cone":
            angle = float(entry["angle"])
            if "apex" in entry:  # the sign conventions of axis and angle differ between exports
                apex = matrix[:3, :3] @ np.asarray(entry["apex"], float) + matrix[:3, 3]
                axis = origin - apex if np.linalg.norm(origin - apex) > 1e-9 else axis
            return cone(origin, axis, scale * entry["radius"], abs(angle))
    except (KeyError, TypeError, ValueError):
        return None
    return None


def _mesh_edges(triangles: NDArray[np.int64], owner: NDArray[np.int32]) -> dict[tuple[int, int], tuple[int, ...]]:
    """The faces on either side of each mesh edge on which more than one triangle's face meets, or a border."""
    sides: dict[tuple[int, int], set[int]] = defaultdict(set)
    ends = np.roll(triangles, -1, axis=1)
    low, high = np.minimum(triangles, ends), np.maximum(triangles, ends)
    key = (low * (int(triangles.max()) + 1) + high).ravel()
    faces = np.repeat(owner, 3)
    order = np.lexsort((faces, key))
    key, faces = key[order], faces[order]
    size = int(triangles.max()) + 1
    differs = np.zeros(len(key), bool)
    differs[1:] = (key[1:] == key[:-1]) & (faces[1:] != faces[:-1])
    for i in np.flatnonzero(differs):
        sides[int(key[i]) // size, int(key[i]) % size] |= {int(faces[i - 1]), int(faces[i])}
    return {edge: tuple(sorted(pair)) for edge, pair in sides.items()}


class _Curve:
    """One curve of the feature list."""

    def __init__(self, entry: dict[str, Any], points: Array, faces: tuple[int, ...]) -> None:
        first, last = entry["vert_indices"][0], entry["vert_indices"][-1]
        self.points, self.sharp, self.kind = points, bool(entry["sharp"]), _CURVES.get(entry["type"], "other")
        self.ends = EdgeEnds((first, last), end_tangents(points), faces)


def _visible_curves(
    entries: list[Any], vertices: Array, sides: dict[tuple[int, int], tuple[int, ...]], path: Path
) -> list[_Curve]:
    """The curves between two different faces; all others are seams."""
    curves = []
    for entry in entries:
        indices = [int(i) for i in entry["vert_indices"]]
        if len(indices) < 2:
            continue
        if min(indices) < 0 or max(indices) >= len(vertices):
            raise InputError("names vertices that the mesh doesn't have", file=path, fix=_AGAIN)
        seen = [sides.get((min(a, b), max(a, b))) for a, b in pairwise(indices)]
        pairs = sorted(pair for pair in seen if pair is not None)
        if pairs:
            curves.append(_Curve(entry, vertices[indices], pairs[len(pairs) // 2]))
    return curves


def _sharp(
    curves: list[_Curve], joined: NDArray[np.int64], spacing: float
) -> tuple[Array, NDArray[np.int32], tuple[str, ...]]:
    """Samples (M, 3) of the sharp curves, their ids (M,), and each curve's type."""
    points, ids = [np.zeros((0, 3))], [np.zeros(0, np.int32)]
    types: list[str] = []
    order = {int(c): k for k, c in enumerate(dict.fromkeys(c for c, x in zip(joined, curves, strict=True) if x.sharp))}
    for owner, curve in zip(joined.tolist(), curves, strict=True):
        if not curve.sharp:
            continue
        index = order[owner]
        if index == len(types):
            types.append(curve.kind)
        length = float(np.linalg.norm(np.diff(curve.points, axis=0), axis=1).sum())
        samples = resample(curve.points, max(1, int(np.ceil(length / spacing))))
        points.append(samples)
        ids.append(np.full(len(samples), index, np.int32))
    return np.concatenate(points), np.concatenate(ids), tuple(types)
