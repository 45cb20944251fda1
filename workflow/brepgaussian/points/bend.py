"""Samples of flat surfels, bent on to the curved surface that their surfel lies on.

A disk touches a cylinder in its middle only: all its other samples lie outside, by .0008 on a bore of radius .05, and
a fit to them makes it wider (.054).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from brepgaussian.geometry.surfaces import Surface
from brepgaussian.points.densify import Samples
from brepgaussian.points.graph import Index

_STEEPEST = 0.5  # of a sample's distance from its surfel's centre: what a surface may leave the disk by


def bent(samples: Samples, labels: Index, surfaces: Sequence[Surface]) -> Samples:
    """The samples, each as far from its label's surface as the centre of its surfel is, and turned with the surface.

    Args:
        samples: the centres first, in the order of the surfels.
        labels: (N,) of the samples, -1 = none; a sample with another label than its centre stays.
        surfaces: primitive of each label.
    """
    xyz, normals = samples.xyz.copy(), samples.normals.copy()
    of_center = labels[samples.surfel]
    for k, surface in enumerate(surfaces):
        if surface.kind == "plane":
            continue
        here = np.flatnonzero((labels == k) & (of_center == k))
        center, place = samples.xyz[samples.surfel[here]], samples.xyz[here]
        reach = _STEEPEST * np.linalg.norm(place - center, axis=1)
        (height, at_center), (off, at_place) = surface.field(center), surface.field(place)
        fall = np.clip(height - off, -reach, reach)
        xyz[here] += fall[:, None] * at_place
        turned = normals[here] + at_place - at_center
        normals[here] = turned / np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-12)
    return replace(samples, xyz=xyz, normals=normals)
