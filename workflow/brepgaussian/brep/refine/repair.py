"""Faces on a surface of their own that the images refuse: tried on another face's surface.

A cone or a cylinder of which the points took one piece for a plane cannot be refined into agreement. If such a
face lies close to the surface of a larger one, it may be a piece of that.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.refine.accept import Acceptance
from brepgaussian.brep.refine.mesh import FaceMesh
from brepgaussian.brep.structure import Structure
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]

_NEAR = 0.01  # median distance of the face from the other surface, unit frame: within the refinement's reach
_FAR = 0.03  # and the largest
_SAME_SIDE = np.cos(np.radians(25.0))  # and the angle between their normals


def doubtful_merges(
    structure: Structure, mesh: FaceMesh, surfaces: Sequence[Surface], verdict: Acceptance, limit_px: float
) -> dict[int, int]:
    """Surfaces with a bad edge that may be pieces of another: surface to the other surface."""
    owner = np.array([f.surface for f in structure.faces], np.int64)
    area = np.bincount(owner[owner >= 0], [f.area for f in structure.faces if f.surface >= 0], len(surfaces))
    bad: set[int] = set()
    for row in verdict.edges:
        px = row["silhouette_px"]
        index = int(str(row["name"]).split()[-1])
        if isinstance(px, float) and px > limit_px and str(row["name"]).startswith("edge"):
            bad |= {s for s in structure.edges[index].surfaces if s >= 0}
    merges: dict[int, int] = {}
    for index in sorted(bad, key=lambda s: area[s]):
        points = mesh.vertices[np.unique(mesh.triangles[owner[mesh.face] == index])]
        best, least = -1, _NEAR
        for other in (int(i) for i in np.flatnonzero(area >= area[index])):
            if other == index or other in merges or not len(points):
                continue
            off = np.abs(surfaces[other].signed_distance(points))
            agree = (surfaces[other].normals(points) * surfaces[index].normals(points)).sum(axis=1)
            middle = float(np.median(off))
            if middle < least and off.max() < _FAR and np.abs(agree).min() > _SAME_SIDE:
                best, least = other, middle
        if best >= 0:
            merges[index] = best
    return merges


def merge(structure: Structure, merges: dict[int, int]) -> Structure:
    """The structure with some surfaces replaced by others."""

    def new(surface: int) -> int:
        return merges.get(surface, surface)

    faces = tuple(replace(f, surface=new(f.surface)) for f in structure.faces)
    edges = tuple(replace(e, surfaces=(new(e.surfaces[0]), new(e.surfaces[1]))) for e in structure.edges)
    vertices = tuple(replace(v, surfaces=tuple(sorted({new(s) for s in v.surfaces}))) for v in structure.vertices)
    return Structure(faces, edges, vertices)
