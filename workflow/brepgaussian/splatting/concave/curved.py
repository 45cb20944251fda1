"""Where an opening may lie on a curved face of a hull, such as a cross hole in a shaft.

Places of the hull about whose grey the views disagree gather where there is no surface. Around each such spot the
hull is smooth; a polynomial through it, over the plane that touches it, is the lid.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from brepgaussian.splatting.concave.openings import REFUTED_SHARE, Images, refuted_share
from brepgaussian.splatting.concave.prism import Lattice, plane_axes
from brepgaussian.splatting.concave.scene import Scene

Array = NDArray[np.float64]

_NEIGHBOUR_CELLS = 2.5  # places of a hull's mesh this close hang together
_CORE_SHARE = 0.75  # of the places around one are refuted too; edges are blurred, but narrow
_CORE_WIDTHS = 0.5  # of the least width of an opening: the radius of "around"
_APART_WIDTHS = 2.5  # of the least width of an opening: parts of one spot may be this far apart
_LEAST_PLACES = 12  # of a spot
_MOST_SPOTS = 8  # looked at, largest first, for either distance
_REACH = 1.7  # of a spot's radius: the face around it that tells the lid's shape
_OBLONG = 1.6  # times as long as wide: a keyway, around which the face is looked at as far as it is wide
_MARGIN_CELLS = 6.0
_LEANING = 20.0, 60.0  # degrees by which an oblong mouth tells a hole to lean; of less its cells don't tell
_DEGREE = 4  # of the polynomial: a cylinder over 45 degrees is off by .0003 of its radius
_REWEIGHTINGS = 8
_SMOOTH_SHARE = 0.8  # of the hull around a spot lies on the polynomial; edges and corners don't
_TURNS = 3  # until a lattice is square to the face
_FACING = 0.3  # cosine of a normal to the lattice's; what is steeper lies behind an edge
_NEARER = 8  # steps to where a line meets the face
_MOST_FAR = 1.5  # of a lattice's half lengths: the polynomial is known as far as that
_FEW = 9  # places along each side that tell whether a face bends at all
_LEAST_BEND_CELLS = 1.5  # that the face sinks over the lattice; flatter ones are planes, which are looked at already


@dataclass(frozen=True)
class Spot:
    """A lattice over a part of a curved face, and how far the face lies below it (R, C)."""

    lattice: Lattice
    relief: Array


def spots(
    images: Images, scene: Scene, free: NDArray[np.bool_], cell: float, pitch: float, least_width: float
) -> list[Spot]:
    """Lattices over the parts of a hull's curved faces about which the views disagree.

    Args:
        images: of all views.
        scene: the hull.
        free: (K,) its vertices that lie on no plane.
        cell: the hull's resolution.
        pitch: side of a lattice's cell.
        least_width: of an opening.
    """
    chosen = np.flatnonzero(free)
    if len(chosen) < _LEAST_PLACES:
        return []
    places = scene.vertices[chosen]
    share = refuted_share(images, scene, places, scene.normals[chosen], pitch)
    refuted = share > REFUTED_SHARE
    tree = cKDTree(places)
    around = tree.query_ball_point(places[refuted], max(_CORE_WIDTHS * least_width, _NEIGHBOUR_CELLS * cell))
    core = np.array([refuted[near].mean() >= _CORE_SHARE for near in around], bool)
    core_places = places[refuted][core]
    found = []
    near = _NEIGHBOUR_CELLS * cell
    # silhouettes may have opened the middle of a hole, so that its border is in pieces
    reaches = (near, max(near, _APART_WIDTHS * least_width))
    groups = [group for reach in reaches for group in connected(core_places, reach)[:_MOST_SPOTS]]
    for members in {group.tobytes(): group for group in groups}.values():
        found.append(spot_around(core_places[members], scene, cell, pitch))
    return [spot for spot in found if spot is not None]


def connected(points: Array, reach: float) -> list[NDArray[np.int64]]:
    """Indices of the points that hang together, largest group first."""
    if len(points) < _LEAST_PLACES:
        return []
    pairs = cKDTree(points).query_pairs(reach, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), (len(points), len(points)))
    count, label = connected_components(graph, directed=False)
    groups = [np.flatnonzero(label == k) for k in range(count)]
    return sorted((g for g in groups if len(g) >= _LEAST_PLACES), key=lambda g: (-len(g), int(g[0])))


def spot_around(members: Array, scene: Scene, cell: float, pitch: float, facing: Array | None = None) -> Spot | None:
    """A lattice over places (N, 3) that are no surface, square to the face around them, or to a direction `facing`.

    None if nothing smooth surrounds them, or only a plane. Other arguments are those of `spots`.
    """
    center = members.mean(axis=0)
    radii, along = _extent(members - center, cell)
    reach = radii + (_REACH - 1) * radii.min() + _MARGIN_CELLS * pitch
    wide = reach + (np.sqrt(2) - 1) * reach.min()
    normal = scene.normals[scene.tree.query(members)[1]].mean(axis=0)
    near = np.sort(scene.tree.query_ball_point(center, float(wide.max()) + cell))  # all that may be beside it
    vertices, normals = scene.vertices[near], scene.normals[near]
    axes, local, height = np.eye(3), np.empty((0, 3)), None
    for _ in range(_TURNS):
        normal /= np.linalg.norm(normal)
        axes = _frame(normal, along)
        local = (vertices - center) @ axes
        # not what silhouettes have dug below the spot either
        beside = (_away(local, wide) < 1) & (_away(local[:, :2], radii) > 1) & (normals @ normal > _FACING)
        local = local[beside]
        height = _Polynomial.through(local, reach, cell)
        if height is None:
            return None
        normal = normal - axes[:, :2] @ height.slope_at_origin()
    if height is None:
        return None
    on_it = np.abs(local[:, 2] - height(local[:, 0], local[:, 1])) < cell
    if on_it.mean() < _SMOOTH_SHARE:
        return None
    count = np.ceil(2 * reach / pitch).astype(int)
    u, v = np.meshgrid(*((np.arange(n) + 0.5 - n / 2) * pitch for n in count), indexing="ij")
    if facing is None:
        heights = height(u.ravel(), v.ravel()).reshape(u.shape)
    else:
        own, axes = axes, _frame(facing, along)
        few = np.stack(np.meshgrid(*np.linspace(-reach, reach, _FEW).T, indexing="ij"), axis=-1).reshape(-1, 2)
        if np.ptp(height.along(few @ (axes[:, :2].T @ own), facing @ own)) < _LEAST_BEND_CELLS * pitch / 2:
            return None  # most mouths are in flat faces
        heights = height.along(np.column_stack([u.ravel(), v.ravel()]) @ (axes[:, :2].T @ own), facing @ own)
        heights = heights.reshape(u.shape)
    if np.ptp(heights) < _LEAST_BEND_CELLS * pitch:
        return None
    first, second, normal = axes.T
    top = float(heights.max())
    origin = center + top * normal - (count[0] * first + count[1] * second) * pitch / 2
    return Spot(Lattice(origin, first, second, normal, pitch, (int(count[0]), int(count[1]))), top - heights)


def leaning_ways(places: Array, normal: Array) -> list[Array]:
    """(3,) unit directions in which a round hole may lean that has an oblong mouth: places (N, 3) of a face's lid.

    None if the mouth is nearly round, or as long as a slot.
    """
    offset = places - places.mean(axis=0)
    offset -= (offset @ normal)[:, None] * normal
    spread, axes = np.linalg.svd(offset, full_matrices=False)[1:]
    ratio = float(spread[1] / max(spread[0], 1e-12))
    if not _LEANING[0] < np.degrees(np.arccos(min(ratio, 1.0))) < _LEANING[1]:
        return []
    aside = float(np.sqrt(1 - ratio**2)) * axes[0]
    return [ratio * normal + sign * aside for sign in (1.0, -1.0)]


def _extent(offsets: Array, cell: float) -> tuple[Array, Array | None]:
    """(2,) half lengths of a spot, and the direction (3,) of the longer one; None if it is about round."""
    radius = float(np.linalg.norm(offsets, axis=1).max()) + cell
    direction = np.linalg.svd(offsets, full_matrices=False)[2]
    half = np.abs(offsets @ direction[:2].T).max(axis=0) + cell
    if half[0] < _OBLONG * half[1]:
        return np.array([radius, radius]), None
    return half, direction[0]


def _away(local: Array, radii: Array) -> Array:
    """(N,) distances of points (N, 2 or 3) in a spot's frame from its middle, over its half lengths (2,)."""
    return np.asarray(np.linalg.norm(local / np.append(radii, radii.max())[: local.shape[1]], axis=1))


def _frame(normal: Array, along: Array | None) -> Array:
    """(3, 3) columns: two axes in the plane, the first one along a direction if there is one, and the normal."""
    if along is None:
        return np.column_stack([*plane_axes(normal), normal])
    first = along - (along @ normal) * normal
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(normal, first), normal])


class _Polynomial:
    """A height over a plane."""

    def __init__(self, coefficients: Array, scale: Array) -> None:
        self.coefficients, self.scale = coefficients, scale

    @staticmethod
    def through(points: Array, scale: Array, noise: float) -> "_Polynomial | None":
        """A robust fit to (N, 3) points in the plane's frame that reach (2,) `scale` far; None if there are too few."""
        design = _terms(points[:, 0] / scale[0], points[:, 1] / scale[1])
        if len(points) < 2 * design.shape[1]:
            return None
        weight: Any = np.ones(len(points))
        coefficients: Array = np.zeros(design.shape[1])
        for _ in range(_REWEIGHTINGS):
            normal = design.T @ (weight[:, None] * design)
            normal += 1e-6 * len(points) * np.eye(len(normal))
            coefficients = np.linalg.solve(normal, design.T @ (weight * points[:, 2]))
            off = np.abs(points[:, 2] - design @ coefficients)
            weight = 1 / (1 + (off / max(float(np.median(off)), noise / 2)) ** 2) ** 2
        return _Polynomial(coefficients, scale)

    def __call__(self, u: Array, v: Array) -> Array:
        return np.asarray(_terms(u / self.scale[0], v / self.scale[1]) @ self.coefficients)

    def along(self, starts: Array, direction: Array) -> Array:
        """(N,) how far from starts (N, 3) in a unit direction (3,), all in the plane's frame, it lies, as far as it is
        known: beyond that any height will do, for nothing of the face is there.
        """
        far, most, step = np.zeros(len(starts)), _MOST_FAR * float(self.scale.max()), 1e-4 * float(self.scale.min())

        def above(far: Array) -> Array:
            places = starts + far[:, None] * direction
            u, v = (np.clip(places[:, k], -_MOST_FAR * self.scale[k], _MOST_FAR * self.scale[k]) for k in (0, 1))
            return np.asarray(places[:, 2] - self(u, v))

        for _ in range(_NEARER):
            height = above(far)
            rise = (above(far + step) - height) / step
            rise = np.copysign(np.maximum(np.abs(rise), _FACING), rise)
            far = np.clip(far - height / rise, -most, most)
        return far

    def slope_at_origin(self) -> Array:
        """(2,) how it rises along u and v."""
        return np.asarray(self.coefficients[1:3] / self.scale)


def _terms(u: Array, v: Array) -> Array:
    """(N, T) monomials, the constant, u and v first."""
    us, vs = [np.ones_like(u)], [np.ones_like(v)]
    for _ in range(_DEGREE):  # products are far cheaper than powers
        us.append(us[-1] * u)
        vs.append(vs[-1] * v)
    powers = sorted(((i, j) for i in range(_DEGREE + 1) for j in range(_DEGREE + 1 - i)), key=lambda p: (sum(p), p[1]))
    return np.column_stack([us[i] * vs[j] for i, j in powers])
