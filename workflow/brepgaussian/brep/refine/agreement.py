"""Where views disagree about a solid: one place of its surface has one grey, from wherever it is seen.

Edges and silhouettes say nothing about what lies between them: a pocket without its walls, a hole through which another
face shows, a groove with a round bottom. There the views see different things at what should be one place.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.refine.looks import largest_areas, looks
from brepgaussian.brep.refine.visibility import Scene
from brepgaussian.brep.structure import Structure
from brepgaussian.geometry.rows import distinct
from brepgaussian.splatting.concave import Images as Shown
from brepgaussian.splatting.concave.radiance import differences

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_STRIDE_PX = 3  # between pixels that are asked
_PLACE_PX = 3.0  # side of a place, in footprints of a pixel
PLACE_AREA_PX2 = _PLACE_PX**2
_LEAST_RAYS = 8  # that a place is seen by, before it says anything
_CAP = 3.0  # tolerances; greater differences count no more
_REFUTED = 1.0  # tolerances by which a place's rays differ on average
_TREND_PLACES = 3.0  # side of what has one trend, in places
_TREND_RAYS = 24  # that tell a trend
_TREND_FITS = 3
_TREND_RIDGE = 1e-3  # rays; keeps faces along an axis solvable
_SCATTERED = 0.005  # of other faces' places refuted (JPEG rings beside edges, say) make areas twice as large by chance


@dataclass(frozen=True)
class Disagreement:
    """Places that views disagree about.

    Attributes:
        area: of the largest connected ones on a face, px^2; less where as many lie scattered on other faces.
        faces: (F,) places on each face.
    """

    area: float
    faces: Indices


def disagreement(scene: Scene, structure: Structure, shown: Shown, poses: Array) -> Disagreement:
    """Where views disagree about a solid.

    Args:
        scene: its triangulation.
        structure: its edges and faces.
        shown: views, their greys, and by how many of these one place may differ.
        poses: (V, 3) image corrections.
    """
    count = len(structure.faces)
    seen = looks(scene, structure, shown, poses, _STRIDE_PX)
    if not len(seen.face):
        return Disagreement(0.0, np.zeros(count, np.int64))
    side = _PLACE_PX * shown.views.cameras.footprint()
    places = seen.places(side)
    local = seen.points / side - places[:, :3] - 0.5
    rest = without_trend(np.column_stack([seen.points / side, seen.face]), seen.grey, shown.tolerance)
    cost, told = differences(places, local, rest, shown.tolerance, _CAP)
    found, where, rays = distinct(places)
    asked = (np.bincount(where, told) == rays) & (rays >= _LEAST_RAYS)
    refuted = found[asked & (np.bincount(where, cost) > _REFUTED * rays)]
    bad, all_asked = (np.bincount(rows[:, 3], minlength=count) for rows in (refuted, found[asked]))
    elsewhere = (bad.sum() - bad) / np.maximum(all_asked.sum() - all_asked, 1)  # (F,) share on the other faces
    area = largest_areas(refuted, count) * PLACE_AREA_PX2 / (1 + elsewhere / _SCATTERED)
    return Disagreement(float(area.max(initial=0.0)), bad)


def without_trend(at: Array, grey: Array, tolerance: float) -> Array:
    """(N,) grey levels less a linear trend over some places, fitted robustly.

    The few rays of one place do not tell the gradient, and where a face lights the one beside it, that is steep:
    20 grey levels across a place at the foot of a boss.

    Args:
        at: (N, 4) points, in sides of a place, and the face of each.
        grey: (N,) levels.
        tolerance: grey levels; greater differences from the trend hardly count.
    """
    block = np.floor(np.column_stack([at[:, :3] / _TREND_PLACES, at[:, 3]])).astype(np.int64)
    found, where, rays = distinct(block)
    ones = np.column_stack([np.ones(len(at)), at[:, :3] / _TREND_PLACES - block[:, :3] - 0.5])  # (N, 4)
    weight, trend = np.ones(len(at)), np.zeros(len(at))
    for _ in range(_TREND_FITS):
        matrix, right = np.empty((len(found), 4, 4)), np.empty((len(found), 4))
        for i in range(4):
            right[:, i] = np.bincount(where, weight * ones[:, i] * grey)
            for j in range(4):
                matrix[:, i, j] = np.bincount(where, weight * ones[:, i] * ones[:, j])
        matrix += _TREND_RIDGE * np.eye(4)
        trend = np.einsum("ni,ni->n", ones, np.linalg.solve(matrix, right[..., None])[where, :, 0])
        weight = 1 / (1 + ((grey - trend) / tolerance) ** 2)
    return np.asarray(np.where(rays[where] >= _TREND_RAYS, grey - trend, grey))
