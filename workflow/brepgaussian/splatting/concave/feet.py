"""Feet of round bosses: corners between a boss and the face that it stands on.

Where few cameras look along that face, as below a plate, no silhouette shows the corner, and a hull fills it with a
skirt. Further up the boss's wall is bare, and tells where the wall goes on below; so does the outline of a round top.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian import log
from brepgaussian.geometry.circles import circle_of_most
from brepgaussian.splatting.concave.agreement import better, disagreements
from brepgaussian.splatting.concave.contours import chords_in, lost_share
from brepgaussian.splatting.concave.curved import connected
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.prism import Lattice, plane_axes
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.shoulders import is_round
from brepgaussian.splatting.concave.turned import Axis
from brepgaussian.splatting.concave.volume import Volume

Array = NDArray[np.float64]
Face = tuple[Lattice, NDArray[np.bool_]]  # (R, C) cells on it

_UPRIGHT = 0.2  # cosine between a wall's normal and the face's: 12 degrees from square
_ON_VOXELS = 1.0  # from a circle, of a vertex on it; and from a face, above which its bosses' walls are looked for
_PARALLEL = 0.9998  # cosine of 1.1 degrees
_NEAR_VOXELS = 2.5  # vertices of one wall
_OUTWARD = 0.9  # cosine between a wall's normal and the ray from its axis: no bore, no flat beside a round wall
_ROUND = 0.3  # of a wall's vertices lie on its circle; the others are its skirt's,
_ALL_AROUND = 0.6  # and all about its axis
_ANGLES = 72  # about an axis, at which a skirt is looked for
_BARE = 0.2  # of these, at most, at which something stands on a face: there the skirt ends
_BEYOND, _CLEAR = 3, 2  # voxels, twice as far out, in which an arm or a rib goes on; angles beside it that are left
_LEAST_RING = 2  # voxels that a skirt is wide
_WIDEST = 1.0  # radii of the boss; what is wider is no skirt
_MOST_LOST = 0.01  # of the contours' rays through a ring that it may leave with nothing
_GAIN = 0.75  # as for an opening; of true corners .32 to .37 of the disagreement was left
_LEAST_RAYS = 200  # that tell
_REACH_VOXELS = 0.5  # rays on which a ring changes less than this don't judge it
_AROUND_VOXELS = 4.0  # around a ring in which the field follows it

logger = log.get_logger("stage1")


@dataclass(frozen=True)
class Boss:
    """A round boss.

    Attributes:
        axis: from the face that it stands on outward; heights are above that face.
        radius: of its wall; height: up to which the wall is seen.
    """

    axis: Axis
    radius: float
    height: float

    def around(self, radii: Array, heights: Array) -> Array:
        """(R, A, H, 3) places about the axis, at radii (R,) and heights (H,)."""
        first, second = plane_axes(self.axis.direction)
        angle = 2 * np.pi * np.arange(_ANGLES) / _ANGLES
        out = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
        rings = self.axis.through + radii[:, None, None] * out
        return np.asarray(rings[:, :, None] + heights[:, None] * self.axis.direction)


@dataclass(frozen=True)
class Ring:
    """A ring around a boss's foot, but for where more stands there.

    Attributes:
        width: beyond the boss's wall; height: above the face.
        around: (A,) at which angles it is, of those of `Boss.around`.
    """

    boss: Boss
    width: float
    height: float
    around: NDArray[np.bool_]

    def signed_distance(self, points: Array) -> Array:
        """(N,) distances of points (N, 3) from it, negative inside; far off where it is not around."""
        axis, radius = self.boss.axis, self.boss.radius
        distance = axis.ring_distance(points, (radius, radius + self.width), (0.0, self.height))
        first, second = plane_axes(axis.direction)
        arm = points - axis.through
        turn = np.arctan2(arm @ second, arm @ first) / (2 * np.pi)
        there = self.around[np.round(turn * _ANGLES).astype(int) % _ANGLES]
        return np.where(there, distance, np.maximum(distance, 1.0))


def open_feet(images: Images, hull: Volume, faces: Sequence[Face]) -> Volume:
    """Carve the corners around the feet of round bosses.

    Args:
        images: of all views.
        hull: what silhouettes leave, faces flattened.
        faces: of it.
    """
    scene = hull.scene()
    walls = [boss for lattice, _ in faces for boss in _by_walls(scene, lattice, hull.spacing)]
    for boss in [*walls, *_by_tops(faces, _LEAST_RING * hull.spacing)]:
        ring = _skirt(hull, boss)
        if ring is None or ring.width < _LEAST_RING * hull.spacing:
            continue
        opened = _without(hull, ring)
        after = opened.scene()
        if _believed(images, scene, after, ring, hull.spacing):
            hull, scene = opened, after
    return hull


def _by_tops(faces: Sequence[Face], least: float) -> list[Boss]:
    """The bosses, no lower than `least`, whose tops are round faces: on the next parallel face below each."""
    found = []
    for top, outline in faces:
        labels, _ = ndimage.label(ndimage.binary_fill_holes(outline))
        disc = labels == 1 + int(np.argmax(np.bincount(labels.ravel())[1:]))
        height = [top.offset - low.offset for low, _ in faces if float(low.normal @ top.normal) > _PARALLEL]
        height = [h for h in height if h > least]
        if height and is_round(disc):
            foot = top.centers()[disc].mean(axis=0) - min(height) * top.normal
            radius = top.pitch * float(np.sqrt(disc.sum() / np.pi))
            found.append(Boss(Axis(foot, top.normal), radius, min(height)))
    return found


def _by_walls(scene: Scene, plane: Lattice, spacing: float) -> list[Boss]:
    """The round bosses of a hull, voxels of which are `spacing` wide, that stand on a plane."""
    vertices, normals = scene.vertices, scene.normals
    height = vertices @ plane.normal - plane.offset
    wall = np.flatnonzero((height > _ON_VOXELS * spacing) & (np.abs(normals @ plane.normal) < _UPRIGHT))
    axes = np.column_stack(plane_axes(plane.normal))  # (3, 2)
    found = []
    for group in connected(vertices[wall], _NEAR_VOXELS * spacing):
        members = wall[group]
        flat, facing = vertices[members] @ axes, normals[members] @ axes
        middle, radius = circle_of_most(flat, spacing)
        arm = flat - middle
        away = np.linalg.norm(arm, axis=1)
        outward = np.einsum("ni,ni->n", arm, facing) > _OUTWARD * away
        on = outward & (np.abs(away - radius) < _ON_VOXELS * spacing)
        angles = np.arctan2(arm[on, 1], arm[on, 0])
        around = np.count_nonzero(np.histogram(angles, _ANGLES // 2, (-np.pi, np.pi))[0]) / (_ANGLES // 2)
        if on.mean() >= _ROUND and around >= _ALL_AROUND:
            foot = plane.normal * plane.offset + axes @ middle
            found.append(Boss(Axis(foot, plane.normal), radius, float(height[members[on]].max())))
    return found


def _skirt(hull: Volume, boss: Boss) -> Ring | None:
    """The ring about a boss in which something stands on its face nearly all around; None if there is none, or no end.

    It leaves out the arms and ribs that leave the boss there: these go on further out.
    """
    spacing = hull.spacing
    radii = boss.radius + spacing * np.arange(1, int(_WIDEST * boss.radius / spacing) + 1)
    heights = np.arange(_ON_VOXELS * spacing, boss.height, spacing / 2)
    places = boss.around(np.asarray(radii, float), np.asarray(heights, float))
    inside: NDArray[np.bool_] = hull.inside(places.reshape(-1, 3)).reshape(places.shape[:3])  # (R, A, H)
    filled = np.asarray(inside.any(axis=2))  # (R, A)
    bare = np.flatnonzero(filled.mean(axis=1) < _BARE)
    if not len(bare) or not bare[0]:
        return None
    last = int(bare[0])
    beyond = np.asarray(filled[2 * last :][:_BEYOND].any(axis=0))  # twice as far out
    around = ~ndimage.binary_dilation(np.tile(beyond, 3), iterations=_CLEAR)[len(beyond) : 2 * len(beyond)]
    some = np.flatnonzero(inside[:last, around].any(axis=(0, 1)))
    if not len(some) or around.mean() < _ALL_AROUND:
        return None
    top = min(float(heights[some.max()]) + spacing, boss.height)
    return Ring(boss, float(radii[last] - boss.radius), top, around)


def _without(hull: Volume, ring: Ring) -> Volume:
    """The hull without a ring."""
    boss = ring.boss
    extent = boss.around(np.array([boss.radius + ring.width]), np.array([0.0, ring.height])).reshape(-1, 3)
    return hull.carved(extent, _AROUND_VOXELS * hull.spacing, ring.signed_distance)


def _believed(images: Images, scene: Scene, after: Scene, ring: Ring, spacing: float) -> bool:
    """Whether views agree much better without a ring, and silhouettes don't need it."""
    old, new, count = said = disagreements(images, scene, after, _REACH_VOXELS * spacing)
    good = better(said, _GAIN, _LEAST_RAYS, untold=False) and _lost(images, scene, ring) <= _MOST_LOST
    logger.info(
        "foot of a boss of radius %.4f, %.4f wide: views disagree by %.2f for %.2f of the hull, %d rays%s",
        ring.boss.radius, ring.width, new, old, count, "" if good else ": not believed",
    )  # fmt: skip
    return good


def _lost(images: Images, scene: Scene, ring: Ring) -> float:
    """Share of the contours' rays through a ring that have nothing left without it."""
    chords = chords_in(scene, *images.contour_rays)
    return lost_share(chords, ring.signed_distance(chords.samples()) < 0)
