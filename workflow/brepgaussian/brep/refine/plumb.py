"""How deep floors lie, told by all rays that look into their pits.

No silhouette holds a blind floor, and light that walls and floor throw on each other shifts the edge between them by
a quarter to half a pixel. What it shows between its edges says it better, once the walls are exact.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.refine.floors import is_told
from brepgaussian.brep.refine.pits import Pit, floors, pit_of
from brepgaussian.brep.refine.soundings import Soundings
from brepgaussian.brep.refine.visibility import Scene
from brepgaussian.brep.structure import Structure
from brepgaussian.splatting.concave import Images as Shown
from brepgaussian.splatting.concave.shapes import Costs

Array = NDArray[np.float64]

_REACH_PX = 16.0  # by how much a floor may be off, footprints: some hundredths of the object
_COARSE = 2.0  # ratio of the depths that are tried first; from one quarter of a pixel on
_FINEST_PX = 0.1  # steps down to which the depth is told
_SIGMAS = 3.0  # by which views agree better on the other depth
_STRIDE_PX = 2.0  # between the depths that are tried of a floor that is not told where it is,
_FINE_PX = 0.25  # and between those about the best one
_SHARP_PX = 6.0  # above the best one, views agree less
_SIGMA_PX = 0.05  # of a depth so told; found where the truth is known: .1 to .2 px at most


@dataclass(frozen=True)
class Plumbed:
    """How a floor should move, (3,), and (N, 3) places of its border that it should pass through; unit frame."""

    move: Array
    places: Array


def plumbed(scene: Scene, structure: Structure, shown: Shown, noise: float, poses: Array) -> dict[int, Plumbed]:
    """By index, the surfaces of floors that surely lie deeper or less deep.

    Args:
        scene: a solid's triangulation; structure: its faces and edges.
        shown: views and their greys; noise: of these, grey levels; poses: (V, 3) image corrections.
    """
    found = {}
    for face in floors(scene.mesh, structure):
        pit = pit_of(scene, structure, shown, noise, poses, face, _REACH_PX)
        off, index = None, structure.faces[face].surface
        if not is_told(pit):
            off = higher(pit_of(scene, structure, shown, noise, poses, face, _REACH_PX, whole=True))
        off = deeper(pit) if off is None else off
        if off is not None and index >= 0:
            corners = scene.mesh.vertices[np.unique(pit.floor.triangles)]
            found[index] = Plumbed(-off * pit.normal, corners - off * pit.normal)
    return found


def soundings_of(floors: Mapping[int, Plumbed], footprint: float) -> Soundings:
    """The places that they should pass through, as observations; footprint: of a pixel, unit frame."""
    surface = [np.full(len(floor.places), index, np.int64) for index, floor in floors.items()]
    points = np.concatenate([floor.places for floor in floors.values()])
    sigma = np.full(len(points), footprint * _SIGMA_PX)
    return Soundings(np.concatenate(surface), points, sigma, sigma)


def deeper(pit: Pit) -> float | None:
    """By which length a floor surely lies deeper (negative: less deep); None where it does not, or none tells."""
    if not len(pit.grey):
        return None
    now = pit.costs(0.0)

    def best(depths_px: Sequence[float]) -> float:
        """The depth on which rays differ least, of some that the solid has room for; footprints."""
        tried = [depth for depth in depths_px if depth * pit.footprint < pit.room]
        return max(tried, key=lambda depth: (_gain(now, pit.costs(depth * pit.footprint)), -abs(depth)))

    coarse = _FINEST_PX * _COARSE ** np.arange(1, np.log2(_REACH_PX / _FINEST_PX) / np.log2(_COARSE))
    depth = best([*-coarse, 0.0, *coarse])
    step = max(abs(depth) / _COARSE, _FINEST_PX)
    while step > _FINEST_PX:
        step /= 2
        depth = best([depth - step, depth, depth + step])
    off = depth * pit.footprint
    return off if pit.advantage(now, pit.costs(off)) >= _SIGMAS else None


def higher(pit: Pit) -> float | None:
    """By which length (negative) a floor that may as well lie deeper than it does lies higher; None where it does not.

    Where walls and floor look alike, views agree as well on depths below the true one, but above it they soon don't:
    so it is told if they surely agree better on the best depth than a little above, and on no depth by less.
    """
    now, footprint = pit.costs(0.0), pit.footprint
    depths = -footprint * np.arange(0.0, pit.height / footprint - _STRIDE_PX, _STRIDE_PX)
    tried = [now, *(pit.costs(float(depth)) for depth in depths[1:])]
    best = int(np.argmax([_gain(now, costs) for costs in tried]))
    above = best + int(_SHARP_PX / _STRIDE_PX)
    if not best or above >= len(tried) or pit.advantage(tried[above], tried[best]) < _SIGMAS:
        return None
    near = depths[best] + footprint * np.arange(-_STRIDE_PX, _STRIDE_PX, _FINE_PX)
    return float(max(near, key=lambda depth: _gain(now, pit.costs(float(depth)))))


def _gain(before: Costs, after: Costs) -> float:
    """By how much rays that both tell of disagree less on the other."""
    return float(np.where(before[1] & after[1], before[0] - after[0], 0.0).sum())
