"""Samples on a solid's surface, uniform by area and on the surface itself (not on its triangles)."""

import numpy as np

from brepgaussian.geometry.kernel import evaluate
from brepgaussian.metrics.distances import SampledSurface
from brepgaussian.metrics.mesh import normals as triangle_normals
from brepgaussian.metrics.mesh import sample_triangles
from brepgaussian.metrics.triangulation import Triangulation


def sample_surface(mesh: Triangulation, count: int, seed: int, threads: int = 1) -> SampledSurface:
    """Sample `count` points with their outward normals."""
    points, index, weights = sample_triangles(mesh.vertices, mesh.triangles, count, seed)
    normals = triangle_normals(mesh.vertices, mesh.triangles[index])
    uv = np.einsum("nk,nkd->nd", weights, mesh.uv[mesh.triangles[index]])
    for i in np.unique(mesh.face[index]):
        own = np.flatnonzero(mesh.face[index] == i)
        points[own], exact = evaluate(mesh.faces[i], uv[own])
        regular = exact.any(axis=1)  # at a pole or an apex the triangle's normal stays
        normals[own[regular]] = exact[regular]
    return SampledSurface(mesh.vertices, mesh.triangles, points, normals, threads)
