"""The arrangement: sheets cut each other into facets, facets bound cells."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BOPAlgo import BOPAlgo_MakerVolume

from brepgaussian.brep import occ
from brepgaussian.errors import StageError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

OUTSIDE = -1  # the unbounded cell
SAMPLE_SPACING = 0.012  # of evidence samples on facets; about the spacing of 20,000 points
_DEFLECTION, _ANGLE = 2e-3, 0.35  # of the tessellation that samples are drawn on


@dataclass(frozen=True)
class Arrangement:
    """Facets and cells of an arrangement of sheets.

    Attributes:
        facets: TopoDS_Face of each facet.
        origins: patches that each facet lies on.
        front, back: (F,) cell on the side of the facet's normal and behind it; OUTSIDE for the unbounded one.
        cells: number of bounded cells.
        area: (F,) area of each facet.
        samples, sample_normals: (N, 3) points on facets with the facet's normal.
        sample_facet: (N,); sample_weight: (N,) area that a sample stands for.
        nodes, triangles, triangle_facet: tessellation, wound along the facets' normals.
    """

    facets: list[Any]
    origins: list[tuple[int, ...]]
    front: Indices
    back: Indices
    cells: int
    area: Array
    samples: Array
    sample_normals: Array
    sample_facet: Indices
    sample_weight: Array
    nodes: Array
    triangles: Indices
    triangle_facet: Indices


def arrange(faces: Sequence[Any], owners: Sequence[int], fuzzy: float) -> Arrangement:
    """Cut faces (each owned by a patch) by each other and find the cells between them.

    Raises:
        StageError: OCC fails, or the faces enclose nothing.
    """
    maker = make_volume(faces, fuzzy, intersect=True)
    cells = occ.solids(maker.Shape())
    if not cells:
        raise StageError("the sheets enclose no cell")
    pieces = occ.shape_map(f for cell in cells for f in occ.faces(cell))
    count = pieces.Extent()
    facets = [occ.typed(pieces.FindKey(i + 1)).Oriented(occ.FORWARD) for i in range(count)]
    facets = [occ.typed(f) for f in facets]
    front, back = np.full(count, OUTSIDE), np.full(count, OUTSIDE)
    for index, cell in enumerate(cells):
        for face in occ.oriented_faces(cell):
            facet = pieces.FindIndex(face) - 1
            if occ.is_reversed(face):
                front[facet] = index
            else:
                back[facet] = index
    samples = _sample(facets)
    return Arrangement(
        facets, _origins(maker, faces, owners, pieces), front, back, len(cells),
        np.array([occ.area(f) for f in facets]), *samples,
    )  # fmt: skip


def make_volume(faces: Sequence[Any], fuzzy: float, intersect: bool) -> BOPAlgo_MakerVolume:
    """Run OCC's volume maker.

    Raises:
        StageError: it reports an error.
    """
    maker = BOPAlgo_MakerVolume()
    maker.SetArguments(occ.shape_list(faces))
    maker.SetIntersect(intersect)
    maker.SetAvoidInternalShapes(True)
    maker.SetRunParallel(False)
    maker.SetToFillHistory(intersect)
    if intersect:
        maker.SetFuzzyValue(fuzzy)
    maker.Perform()
    if maker.HasErrors():
        raise StageError("OCC cannot build volumes from the sheets")
    return maker


def _origins(maker: Any, faces: Sequence[Any], owners: Sequence[int], pieces: Any) -> list[tuple[int, ...]]:
    """The patches on which each facet lies (two where sheets overlap)."""
    found: list[set[int]] = [set() for _ in range(pieces.Extent())]
    for face, owner in zip(faces, owners, strict=True):
        parts = list(maker.Modified(face)) or [face]
        for part in parts:
            index = pieces.FindIndex(part)
            if index > 0:
                found[index - 1].add(owner)
    return [tuple(sorted(f)) for f in found]


def _sample(facets: Sequence[Any]) -> tuple[Array, Array, Indices, Array, Array, Indices, Indices]:
    """Spread samples over the facets' tessellation."""
    occ.tessellate(occ.compound(facets), _DEFLECTION, _ANGLE)
    nodes, triangles, owner, start = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)], 0
    for index, facet in enumerate(facets):
        n, t = occ.triangles(facet)
        nodes.append(n)
        triangles.append(t + start)
        owner.append(np.full(len(t), index, np.int64))
        start += len(n)
    all_nodes, all_triangles, owners = np.concatenate(nodes), np.concatenate(triangles), np.concatenate(owner)
    points, normals, source, weight = sample_triangles(all_nodes[all_triangles], SAMPLE_SPACING)
    return points, normals, owners[source], weight, all_nodes, all_triangles, owners


def sample_triangles(corners: Array, spacing: float) -> tuple[Array, Array, Indices, Array]:
    """Samples on (T, 3, 3) triangles: (N, 3) points, (N, 3) normals, (N,) triangle, (N,) area each.

    A low-discrepancy sequence (the plastic number's) folded into each triangle: even and reproducible.
    """
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double = np.linalg.norm(cross, axis=1)
    counts = np.where(double > 0, np.ceil(0.5 * double / spacing**2), 0).astype(np.int64)
    source = np.repeat(np.arange(len(corners)), counts)
    order = np.arange(len(source))  # runs on over triangles: strips of thin ones are covered evenly too
    a, b = np.mod(0.5 + 0.7548776662466927 * order, 1), np.mod(0.5 + 0.5698402909980532 * order, 1)
    fold = a + b > 1
    a, b = np.where(fold, 1 - a, a), np.where(fold, 1 - b, b)
    c = corners[source]
    points = c[:, 0] + a[:, None] * (c[:, 1] - c[:, 0]) + b[:, None] * (c[:, 2] - c[:, 0])
    normals = cross[source] / double[source, None]
    return points, normals, source, 0.5 * double[source] / counts[source]
