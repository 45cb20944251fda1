"""A triangulation that follows its surfaces: the present solid without the CAD kernel."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.structure import Structure
from brepgaussian.geometry.rows import distinct
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

DEFLECTION = 2e-4  # chord error, unit frame: a twentieth of a pixel of an 800-px view
_ANGLE = 0.3  # radians, for small radii
_MERGE = 1e-7  # nodes of neighbouring faces coincide to rounding
_DAMPING = 1e-4  # of Newton's step where normals are nearly dependent
_STEPS = 6
_LONGEST = 0.01  # step, unit frame, where three surfaces hardly determine a point


@dataclass(frozen=True)
class FaceMesh:
    """A closed triangulation with the face of every triangle.

    Attributes:
        vertices: (K, 3) float64, shared between faces.
        triangles: (T, 3) int64, wound outwards.
        face: (T,) int64 index into `Structure.faces`.
    """

    vertices: Array
    triangles: Indices
    face: Indices


def from_solid(solid: Any, deflection: float = DEFLECTION) -> FaceMesh:
    """Triangulate a TopoDS solid; face indices agree with `brep.structure.extract` of the same shape."""
    from brepgaussian.brep import occ

    occ.tessellate(solid, deflection, _ANGLE)
    return merged(*occ.mesh_of(solid))


def from_bytes(data: bytes, deflection: float = DEFLECTION) -> FaceMesh:
    """The same for a solid as `occ.to_bytes` gives it; called in the kernel's process."""
    from brepgaussian.brep import occ

    return from_solid(occ.from_bytes(data), deflection)


def merged(nodes: Array, triangles: Indices, face: Indices) -> FaceMesh:
    """Join nodes at the same place, so that faces stay together when they move."""
    _, first, inverse = np.unique(
        np.round(nodes / _MERGE).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    triangles = inverse.reshape(-1)[triangles]
    proper = (np.diff(np.sort(triangles, axis=1), axis=1) > 0).all(axis=1)
    return FaceMesh(nodes[first], triangles[proper], face[proper])


def follow(mesh: FaceMesh, structure: Structure, surfaces: Sequence[Surface]) -> FaceMesh:
    """Move every vertex onto the surfaces of the faces around it (one, two, three or more)."""
    owner = np.array([f.surface for f in structure.faces], np.int64)[mesh.face]  # (T,)
    pairs = distinct(np.column_stack([mesh.triangles.reshape(-1), np.repeat(owner, 3)]))[0]
    pairs = pairs[pairs[:, 1] >= 0]
    count = np.bincount(pairs[:, 0], minlength=len(mesh.vertices))
    start = np.concatenate([[0], np.cumsum(count)])
    position = np.arange(len(pairs)) - start[pairs[:, 0]]
    table = np.full((len(mesh.vertices), max(int(count.max(initial=0)), 1)), -1, np.int64)
    table[pairs[:, 0], position] = pairs[:, 1]
    return FaceMesh(slave(mesh.vertices, table, surfaces), mesh.triangles, mesh.face)


def slave(points: Array, table: Indices, surfaces: Sequence[Surface]) -> Array:
    """Newton's method for (N, 3) points onto the surfaces that (N, K) `table` names (-1: none).

    X <- X - N^T (N N^T + damping)^-1 f, the nearest point that satisfies all of them.
    """
    points, places = points.copy(), _places(table)
    damping = np.where(table < 0, 1.0, _DAMPING)
    for _ in range(_STEPS):
        values, normals = _evaluate(points, table.shape, places, surfaces)
        gram = np.einsum("nki,nli->nkl", normals, normals)
        gram[:, *np.diag_indices(table.shape[1])] += damping
        step = np.linalg.solve(gram, values[:, :, None])[:, :, 0]
        move = np.einsum("nki,nk->ni", normals, step)
        length = np.linalg.norm(move, axis=1, keepdims=True)
        points -= move * np.minimum(1.0, _LONGEST / np.maximum(length, _LONGEST))
    return points


def evaluate(points: Array, table: Indices, surfaces: Sequence[Surface]) -> tuple[Array, Array]:
    """(N, K) signed distances and (N, K, 3) normals of the surfaces in `table`; zero where it is -1."""
    return _evaluate(points, table.shape, _places(table), surfaces)


def _places(table: Indices) -> list[tuple[int, Indices, Indices]]:
    """Every surface in a table with the rows and the columns where it stands."""
    result = []
    for index in np.unique(table[table >= 0]).tolist():
        rows, columns = np.nonzero(table == index)
        result.append((index, rows, columns))
    return result


def _evaluate(
    points: Array, shape: tuple[int, ...], places: list[tuple[int, Indices, Indices]], surfaces: Sequence[Surface]
) -> tuple[Array, Array]:
    values, normals = np.zeros(shape), np.zeros((*shape, 3))
    for index, rows, columns in places:
        values[rows, columns], normals[rows, columns] = surfaces[index].field(points[rows])
    return values, normals
