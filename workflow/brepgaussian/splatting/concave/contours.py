"""Rays just inside of every contour: a solid that fills the silhouettes stands in the way of all of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import Views
from brepgaussian.geometry.pixels import inner_distance
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.scene import Scene

Array = NDArray[np.float64]

_INSET_PX = 1.25  # from the contour: a surface that is right to half a pixel uncovers nothing
_STRIDE = 3  # between the pixels of a contour
_CHORD_SAMPLES = 32
_INNER_STRIDE_PX = 16  # between the rays through a silhouette's middle


@dataclass(frozen=True)
class Chords:
    """What rays have in a solid: chord by chord, those of one ray in a row.

    Attributes:
        ray: (S,) index of each chord's ray, ascending.
        entry, exit: (S, 3) its ends.
    """

    ray: NDArray[np.int64]
    entry: Array
    exit: Array

    def samples(self) -> Array:
        """(S * K, 3) points along the chords, K to each."""
        share = (np.arange(_CHORD_SAMPLES) + 0.5) / _CHORD_SAMPLES
        points = self.entry[:, None] + share[:, None] * (self.exit - self.entry)[:, None]  # (S, K, 3)
        return np.asarray(points.reshape(-1, 3))

    def within(self, prism: Prism, margin: float) -> NDArray[np.bool_]:
        """(S * K,) which of the samples lie in a prism (`Prism.contains`): only chords that pass by are looked at."""
        low, high = prism.box(margin)
        first, last = (np.column_stack(prism.lattice.coordinates(points)) for points in (self.entry, self.exit))
        near = np.asarray(((np.minimum(first, last) <= high) & (np.maximum(first, last) >= low)).all(axis=1))
        found: NDArray[np.bool_] = np.zeros((len(near), _CHORD_SAMPLES), bool)
        found[near] = prism.contains(self.chosen(near).samples(), margin).reshape(-1, _CHORD_SAMPLES)
        return np.asarray(found.ravel())

    def chosen(self, which: NDArray[np.bool_]) -> "Chords":
        """Some of them."""
        return Chords(self.ray[which], self.entry[which], self.exit[which])

    def trimmed(self, normal: Array, offset: float) -> "Chords":
        """What is left of them where normal . x <= offset."""
        first, last = self.entry @ normal - offset, self.exit @ normal - offset
        kept = (first < 0) | (last < 0)
        first, last, a, b = first[kept, None], last[kept, None], self.entry[kept], self.exit[kept]
        cross = a + np.clip(first / np.where(first == last, 1, first - last), 0, 1) * (b - a)
        return Chords(self.ray[kept], np.where(first < 0, a, cross), np.where(last < 0, b, cross))


def loss(chords: Chords, left: Chords, normal: Array, offset: float) -> float:
    """Share of the rays which a half-space touches that meet nothing once it is gone."""
    touched = (chords.entry @ normal > offset) | (chords.exit @ normal > offset)
    rays = np.unique(chords.ray[touched])
    return float(1 - np.isin(rays, left.ray).mean()) if len(rays) else 0.0


def lost_share(chords: Chords, removed: NDArray[np.bool_]) -> float:
    """Share of the rays that touch what is removed that have nothing left outside of it.

    Args:
        chords: in the solid.
        removed: (S * K,) which of their samples are removed.
    """
    touched = np.unique(chords.ray[removed.reshape(len(chords.ray), -1).any(axis=1)])
    return float(lost_rays(chords, removed).sum() / max(len(touched), 1))


def lost_rays(chords: Chords, removed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(R,) whether each ray has nothing left once (S * K,) samples are removed."""
    removed = removed.reshape(len(chords.ray), -1)
    lost = np.zeros(int(chords.ray.max(initial=0)) + 1, bool)
    lost[chords.ray[removed.any(axis=1)]] = True
    lost[chords.ray[~removed.all(axis=1)]] = False
    return lost


def contour_rays(views: Views) -> tuple[Array, Array]:
    """(R, 3) origins and (R, 3) unit directions."""
    origins, directions = [], []
    for view, alpha in enumerate(views.alpha):
        center, ray = views.cameras.rays(view, _pixels(alpha))
        origins.append(np.broadcast_to(center, ray.shape))
        directions.append(ray)
    return np.concatenate(origins), np.concatenate(directions)


def chords_in(scene: Scene, origins: Array, directions: Array) -> Chords:
    """The chords of rays in a closed mesh."""
    ray, distance = scene.intersections(origins, directions)
    order = np.lexsort((distance, ray))
    ray, distance = ray[order], distance[order]
    start = np.searchsorted(ray, ray)
    entering = (np.arange(len(ray)) - start) % 2 == 0
    index = np.flatnonzero(entering[:-1] & (ray[1:] == ray[:-1]))
    found = ray[index]
    ends = (origins[found] + distance[k][:, None] * directions[found] for k in (index, index + 1))
    return Chords(found, *ends)


def _pixels(alpha: NDArray[np.uint8]) -> Array:
    """(R, 2) centres of pixels just inside a silhouette's contour, and of some in its middle."""
    depth = inner_distance(alpha > 127) - 0.5
    rim = np.flatnonzero((depth > _INSET_PX) & (depth <= _INSET_PX + 1))[::_STRIDE]
    middle = np.zeros(depth.shape, bool)
    middle[::_INNER_STRIDE_PX, ::_INNER_STRIDE_PX] = True
    rows, columns = np.unravel_index(np.concatenate([rim, np.flatnonzero(middle & (depth > _INSET_PX))]), depth.shape)
    return np.column_stack([columns + 0.5, rows + 0.5])
