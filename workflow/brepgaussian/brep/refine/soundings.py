"""Depths that parallax tells, as observations of the surfaces: what no edge and no silhouette holds.

A blind floor, or a wall whose border is rounded, has next to no edge that tells where it lies. Places of one radiance
that views see at a slant do (`parallax`): each is a point that its surface should pass through.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.refine.parameters import derivative
from brepgaussian.brep.structure import Structure
from brepgaussian.geometry.fit_robust import MAD_TO_SIGMA, TUKEY
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.splatting.parallax import Depths

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_BIAS_PX = 0.1  # error that all places of a face may have in common: radiance is not linear, views are few


@dataclass(frozen=True)
class Soundings:
    """Points that surfaces should pass through.

    Attributes:
        surface: (N,) index of each one's surface.
        points: (N, 3) unit frame; sigma: (N,) standard error across the surface, unit frame.
        bias: (N,) unit frame, that all of a surface have in common.
    """

    surface: Indices
    points: Array
    sigma: Array
    bias: Array

    @staticmethod
    def of(depths: Depths, structure: Structure, footprint: float) -> "Soundings":
        """The places whose depth is told, moved to where they should lie.

        Args:
            depths: of places on a solid's faces.
            structure: which surfaces the faces lie on.
            footprint: of a pixel, unit frame.
        """
        surface = np.array([f.surface for f in structure.faces], np.int64)[depths.places[:, 3]]
        kept = depths.told & (surface >= 0)
        points = depths.centres[kept] - (footprint * depths.depth[kept])[:, None] * depths.normals[kept]
        bias = np.full(len(points), footprint * _BIAS_PX)
        return Soundings(surface[kept], points, footprint * depths.sigma[kept], bias)

    def joined(self, surer: "Soundings") -> "Soundings":
        """With others, which alone count where they name a surface."""
        kept = ~np.isin(self.surface, surer.surface)
        mine = (self.surface[kept], self.points[kept], self.sigma[kept], self.bias[kept])
        others = (surer.surface, surer.points, surer.sigma, surer.bias)
        return Soundings(*(np.concatenate(pair) for pair in zip(mine, others, strict=True)))

    def normal(self, surfaces: Sequence[Surface], start: Indices, size: int, delta: Array) -> tuple[Array, Array]:
        """Normal equations of a step of all parameters, weighted robustly by what a step `delta` leaves.

        Args:
            surfaces: as they are.
            start: (S + 1,) first parameter of each; size: number of all parameters.
            delta: (size,) the last step tried.

        Returns:
            (size, size) matrix and (size,) right side.
        """
        matrix, right = np.zeros((size, size)), np.zeros(size)
        for index in np.unique(self.surface):
            mine = self.surface == index
            columns = slice(int(start[index]), int(start[index + 1]))
            slope = derivative(surfaces[index], self.points[mine])
            off = -surfaces[index].signed_distance(self.points[mine])
            weight = _weights(off - slope @ delta[columns], self.sigma[mine], float(self.bias[mine].max()))
            matrix[columns, columns] += slope.T @ (slope * weight[:, None])
            right[columns] += slope.T @ (weight * off)
        return matrix, right


def _weights(rest: Array, sigma: Array, bias: float) -> Array:
    """(N,) Tukey weights of a surface's residuals; together no surer than what they have in common."""
    size = np.abs(rest) / sigma
    scale = max(1.0, MAD_TO_SIGMA * float(np.median(size)))
    weight = np.clip(1 - (size / (TUKEY * scale)) ** 2, 0, None) ** 2 / (scale * sigma) ** 2
    return np.asarray(weight / (1 + weight.sum() * bias**2))
