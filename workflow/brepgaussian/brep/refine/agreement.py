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
_SCATTERED = 0.02  # of other faces' places refuted (JPEG rings beside edges, say) make areas twice as large by chance


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
    cost, told = differences(places, local, seen.grey, shown.tolerance, _CAP)
    found, where, rays = distinct(places)
    asked = (np.bincount(where, told) == rays) & (rays >= _LEAST_RAYS)
    refuted = found[asked & (np.bincount(where, cost) > _REFUTED * rays)]
    bad, all_asked = (np.bincount(rows[:, 3], minlength=count) for rows in (refuted, found[asked]))
    elsewhere = (bad.sum() - bad) / np.maximum(all_asked.sum() - all_asked, 1)  # (F,) share on the other faces
    area = largest_areas(refuted, count) * PLACE_AREA_PX2 / (1 + elsewhere / _SCATTERED)
    return Disagreement(float(area.max(initial=0.0)), bad)
