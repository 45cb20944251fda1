"""Whether the images speak for one surface rather than another: on the right one, views agree about its radiance."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import OPAQUE
from brepgaussian.geometry.rows import distinct
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.radiance import differences
from brepgaussian.splatting.concave.scene import Hits, Scene
from brepgaussian.splatting.concave.shapes import Costs

Array = NDArray[np.float64]

_STRIDE_PX = 4
_MOST_RAYS = 400_000  # around one place: every pixel of all views if it is small
_PLACE_PX = 6.0  # side of a place; within it, radiance changes linearly
_ONE_SURFACE = 0.05  # tolerances by which rays differ at most that hit one and the same place of a true surface
_CAP = 3.0  # tolerances; greater differences (another surface is in the way) count no more than this
_NORMAL_BINS = 2.0  # faces that meet at an edge are different places


@dataclass(frozen=True)
class Rays:
    """Rays at the object.

    Attributes:
        origin, direction: (N, 3), unit directions; grey: (N,) levels that the images show there.
        side: of a place, unit frame; tolerance: grey levels by which views of one place differ.
        at: (N, 3) where they hit the surface that they were chosen by: rays near each other err alike.
    """

    origin: Array
    direction: Array
    grey: Array
    side: float
    tolerance: float
    at: Array

    def hitting(self, scene: Scene, at: Callable[[Array], NDArray[np.bool_]]) -> "Rays":
        """Those that hit a surface first where `at` holds for its points (M, 3)."""
        distance = scene.distances(self.origin, self.direction)
        met = np.flatnonzero(np.isfinite(distance))
        points = self.origin[met] + distance[met, None] * self.direction[met]
        kept = at(points)
        return replace(self.chosen(met[kept]), at=points[kept])

    def chosen(self, index: NDArray[np.int64]) -> "Rays":
        """Some of them."""
        parts = self.origin[index], self.direction[index], self.grey[index], self.at[index]
        return replace(self, origin=parts[0], direction=parts[1], grey=parts[2], at=parts[3])

    def costs(self, scene: Scene) -> Costs:
        """(N,) difference of each ray from its place on a surface, in tolerances, and (N,) whether it tells any."""
        against, told = np.full(len(self.origin), _CAP), np.ones(len(self.origin), bool)
        distance, normal = scene.hits_of(self)
        met = np.isfinite(distance)
        points = self.origin[met] + distance[met, None] * self.direction[met]
        against[met], told[met] = _differences(points, normal[met], self.grey[met], self.side, self.tolerance)
        return against, told

    def told(self, scene: Scene) -> tuple[Array, Array]:
        """(M, 3) where those that tell anything hit a surface, and (M,) by how many tolerances they differ there."""
        hitting = self.hitting(scene, lambda points: np.ones(len(points), bool))
        costs, told = hitting.costs(scene)
        return hitting.at[told], costs[told]

    def advantage(self, costs: Costs, other: Costs) -> float:
        """By how many standard errors the rays that both tell of disagree less on the other; 0 if they are alike."""
        return advantage(self.at, self.side, costs, other)


def advantage(at: Array, side: float, costs: Costs, other: Costs) -> float:
    """By how many standard errors rays that hit places (N, 3) disagree less by `other` costs; 0 if they are alike.

    Those within one place of a `side` err alike.
    """
    units = distinct(np.floor(at / side).astype(np.int64))[1]
    gain = np.where(costs[1] & other[1], costs[0] - other[0], 0.0)
    less = np.bincount(units, gain)
    spread = float(np.sqrt((less**2).sum()))
    return float(less.sum()) / spread if spread else 0.0


def mean_cost(costs: Costs) -> float:
    """Mean over the rays that tell any."""
    return float(costs[0][costs[1]].mean()) if costs[1].any() else 0.0


def rays_at_object(images: Images, stride: int = _STRIDE_PX) -> Rays:
    """A ray for every few pixels, `stride` along each side, that surely show the object; asked for again, the same."""
    if stride not in images.known_rays:
        cameras = images.views.cameras
        whole = np.array([[0, 0], [cameras.height, cameras.width]])
        images.known_rays[stride] = _rays(images, [whole] * len(cameras), stride)
    return images.known_rays[stride]


def rays_near(images: Images, places: Array) -> Rays:
    """Rays through the pixels around places (N, 3): as many of them as can be afforded, all where that is little.

    A slot's floor is a few places wide; every fourth pixel hardly tells how deep it lies.
    """
    cameras = images.views.cameras
    boxes = []
    for view in range(len(cameras)):
        pixels, _ = cameras.project(view, places)
        corners = np.array([pixels.min(axis=0), pixels.max(axis=0)])[:, ::-1]
        boxes.append(np.clip(np.nan_to_num(np.round(corners)), 0, [cameras.height, cameras.width]).astype(int))
    every = sum(int(np.prod(high - low)) for low, high in boxes)
    stride = int(np.clip(np.ceil(np.sqrt(every / _MOST_RAYS)), 1, _STRIDE_PX))
    return _rays(images, boxes, stride)


def _rays(images: Images, boxes: Sequence[NDArray[np.integer]], stride: int) -> Rays:
    """Rays through every few pixels that surely show the object, of a box (2, 2) of rows and columns in each view."""
    views = images.views
    origins, directions, greys = [], [], []
    for view, ((top, left), (bottom, right)) in enumerate(boxes):
        rows, columns = np.nonzero(views.alpha[view, top:bottom:stride, left:right:stride] > OPAQUE)
        rows, columns = top + rows * stride, left + columns * stride
        center, ray = views.cameras.rays(view, np.column_stack([columns + 0.5, rows + 0.5]))
        origins.append(np.broadcast_to(center, ray.shape))
        directions.append(ray)
        greys.append(images.luminance[view, rows, columns])
    origin, direction, grey = np.concatenate(origins), np.concatenate(directions), np.concatenate(greys)
    return Rays(origin, direction, grey.astype(float), _PLACE_PX * views.cameras.footprint(), images.tolerance, origin)


def disagreements(
    images: Images, before: Scene, after: Scene, reach: float, rays: Rays | None = None
) -> tuple[float, float, int]:
    """How much views differ on two surfaces, where these differ.

    Args:
        images: of all views.
        before, after: the surfaces; the second lies inside of the first.
        reach: rays on which they differ by less than this are left out.
        rays: that are asked; None = some at all of the object.

    Returns:
        Mean difference of a ray from its place, in tolerances, on each of them; and the number of rays whose places
        are met by enough others to tell anything.
    """
    _, old, new, lost = changes(images, before, after, reach, rays)
    left = float((1 - lost) * mean_cost(new) + lost * _CAP)
    return mean_cost(old), left, min(int(old[1].sum()), int(new[1].sum()))


def preferred(images: Images, one: Scene, other: Scene, reach: float) -> bool:
    """Whether views agree better on the other of two surfaces, where they differ by more than `reach`."""
    rays = rays_at_object(images)
    first, second = (s.hits_of(rays)[0] for s in (one, other))
    met = np.isfinite(first) & np.isfinite(second)
    apart = np.isfinite(first) != np.isfinite(second)
    apart[met] = np.abs(first[met] - second[met]) > reach
    differing = rays.chosen(np.flatnonzero(apart))
    nearer = np.minimum(first, second)[apart]
    at = differing.origin + nearer[:, None] * differing.direction
    return advantage(at, rays.side, differing.costs(one), differing.costs(other)) > 0


def changes(
    images: Images, before: Scene, after: Scene, reach: float, rays: Rays | None = None
) -> tuple[Array, Costs, Costs, float]:
    """What rays say of two surfaces, where these differ; arguments are those of `disagreements`.

    Returns:
        (N, 3) where rays hit the first one that hit the second one, too; (N,) their differences, in tolerances, on the
        first and on the second, each with (N,) whether they tell any; the share of rays that miss the second.
    """
    rays = rays_at_object(images) if rays is None else rays
    (first, normal), (second, inner), changed = _changed(rays, before, after, reach)
    missing = changed & ~np.isfinite(second)
    told = changed & ~missing
    old, new = (_differences_at(rays, told, *hits) for hits in ((first, normal), (second, inner)))
    at = rays.origin[told] + first[told, None] * rays.direction[told]
    return at, old, new, float(missing.sum() / max(changed.sum(), 1))


def one_surface(images: Images, before: Scene, after: Scene, reach: float) -> float:
    """Share of the telling rays on which two surfaces differ that agree about the first as about a true surface.

    Where that is much, all of it is closed there, whatever the second explains elsewhere: behind a wall that is cut
    open, rays are scattered over so many places that none tells of it. Arguments are those of `disagreements`.
    """
    rays = rays_at_object(images)
    (first, normal), _, changed = _changed(rays, before, after, reach)
    cost, enough = _differences_at(rays, changed, first, normal)
    return float((cost[enough] < _ONE_SURFACE).mean()) if enough.any() else 0.0


def _changed(rays: Rays, before: Scene, after: Scene, reach: float) -> tuple[Hits, Hits, NDArray[np.bool_]]:
    """Where rays hit two surfaces, and (N,) on which these differ by more than `reach`."""
    first, second = before.hits_of(rays), after.hits_of(rays)
    met = np.isfinite(first[0])
    changed = met.copy()
    changed[met] = second[0][met] - first[0][met] > reach
    return first, second, changed


def _differences_at(
    rays: Rays, chosen: NDArray[np.bool_], distance: NDArray[np.float32], facing: NDArray[np.float32]
) -> Costs:
    """Capped differences of some rays from what others show where they hit a surface; see `_differences`."""
    points = rays.origin[chosen] + distance[chosen, None] * rays.direction[chosen]
    return _differences(points, facing[chosen], rays.grey[chosen], rays.side, rays.tolerance)


def better(said: tuple[float, float, int], gain: float, least_rays: int, untold: bool) -> bool:
    """Whether views agree better on the second of two surfaces.

    Args:
        said: what `disagreements` returns.
        gain: share of the disagreement on the first that may be left.
        least_rays: that have to tell, else the answer is `untold`.
    """
    old, new, count = said
    return new <= gain * old if count >= least_rays else untold


def _differences(points: Array, normals: NDArray[np.float32], grey: Array, side: float, tolerance: float) -> Costs:
    """(N,) capped difference of rays from a linear fit to all rays of their place, (N,) whether they have such."""
    if not len(points):
        return np.zeros(0), np.zeros(0, bool)
    place = np.floor(points / side).astype(np.int64)
    facing = np.round(normals * _NORMAL_BINS).astype(np.int64)
    return differences(np.column_stack([place, facing]), points / side - place - 0.5, grey, tolerance, _CAP)
