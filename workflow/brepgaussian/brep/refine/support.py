"""The refined triangulation as support of the second build.

Every face is covered evenly and without noise, so that the arrangement and its cut find the same topology
again, whatever the points were like. Runs in the kernel's process.
"""

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.assemble import attempt, judge
from brepgaussian.brep.cells import sample_triangles
from brepgaussian.brep.job import Attempt, Job, Rung
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.refine.mesh import FaceMesh
from brepgaussian.brep.structure import Structure
from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]

_SPACING = 0.008  # of the samples, unit frame
_SMALL_FACE = 40  # samples at least on a surface, however small
_REACH = 2.5  # spacings within which a place on a face surely holds a sample


def rebuild(
    mesh: FaceMesh, structure: Structure, surfaces: tuple[Surface, ...], job: Job, rung: Rung, margin: float
) -> Attempt:
    """Build the solid of refined surfaces from their own faces, and judge it as an attempt of a job.

    Args:
        mesh, structure, surfaces: what the refinement gave.
        job: with the refined surfaces under its points; judges.
        rung: of the ladder, on which the solid was found.
        margin: of the sheets.
    """
    patches = make_patches(mesh, structure, surfaces)
    own = Job(patches, (), np.zeros((0, 3)), (), None, job.settings)
    built = attempt(own, Rung(rung.name, margin, silhouettes=False))
    return built if built.shape is None else judge(built.shape, job, rung, built.notes)


def make_patches(mesh: FaceMesh, structure: Structure, surfaces: tuple[Surface, ...]) -> tuple[Patch, ...]:
    """Samples of the faces as the support of their surfaces: one patch for every surface in use."""
    owner = np.array([f.surface for f in structure.faces], np.int64)[mesh.face]
    patches = []
    for index in sorted({f.surface for f in structure.faces if f.surface >= 0}):
        corners = mesh.vertices[mesh.triangles[owner == index]]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = 0.5 * float(np.linalg.norm(cross, axis=1).sum())
        spacing = min(_SPACING, np.sqrt(area / _SMALL_FACE)) if area > 0 else _SPACING
        points, _, source, _ = sample_triangles(corners, spacing)
        surface = surfaces[index]
        points = surface.project(np.concatenate([points, corners.reshape(-1, 3)]))
        outward = np.concatenate([cross[source], np.repeat(cross, 3, axis=0)])
        normals = surface.normals(points)
        sign = np.sign(np.einsum("ni,ni->n", normals, outward))
        normals = normals * np.where(sign == 0, 1.0, sign)[:, None]
        patches.append(Patch(surface, index, points, normals, float(_REACH * spacing), 0.0))
    return tuple(patches)
