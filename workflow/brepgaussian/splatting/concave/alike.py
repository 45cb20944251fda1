"""What one of several equal features shows, put where the others are: pockets between ribs, teeth, holes in a ring.

Which of them silhouettes and searches open depends on where the cameras stand. A motion that carries the hull onto most
of itself also carries what is open to where it is not yet, and the views decide on each such room.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial.transform import Rotation

from brepgaussian import log
from brepgaussian.splatting.concave.agreement import Rays, better, disagreements, rays_at_object
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.planes import Plane, axes_of
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.turned import axis_of_rotation
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.sample import sample

Array = NDArray[np.float64]
Field = NDArray[np.float32]

_MOST_DIRECTIONS = 3  # first the one that it is turned about, then those of the faces that were confirmed first
_FOLDS = (2, 3, 4, 5, 6, 8)  # of rotations
_NEAR_VOXELS = 3.0  # the normal of a turned surface passes its axis this near
_STRIDE = 3  # of the nodes that tell whether a motion holds, along each axis
_HOLDS = 0.88  # overlap (IoU) of a hull with what a motion makes of it
_STEPS = 4  # of settling a motion,
_ALIKE_VOXELS = 3.0  # by surface that it carries so near to surface
_DAMPING = 1e-3  # of its squared slope
_PLACES = 4000  # on the surface that settle it
_MOST_MOTIONS = 6  # that are followed, best first
_THICK = 1.5  # voxels that a room is deep somewhere: less is roughness
_LEAST_VOXELS = 60  # of a room
_MOST_ROOMS = 6  # of one motion, largest first
_GAIN = 0.6  # of the disagreement that a room leaves at most
_LEAST_RAYS = 60  # that judge it
_REACH_VOXELS = 1.0  # rays on which it changes less than this don't judge it

logger = log.get_logger("stage1")


@dataclass(frozen=True)
class Motion:
    """x -> matrix (3, 3) x + shift (3,), with a name for the log."""

    name: str
    matrix: Array
    shift: Array

    def of(self, hull: Volume) -> Field:
        """(n, n, n) what the field of a hull is at the places that its nodes are carried to."""
        axes = [hull.origin[k] + hull.spacing * np.arange(n) for k, n in enumerate(hull.field.shape)]
        shape = tuple(len(axis) for axis in axes)
        field = np.empty(shape, np.float32)
        for k, x in enumerate(axes[0]):  # a slice at a time keeps memory low
            points = np.stack(np.meshgrid([x], axes[1], axes[2], indexing="ij"), axis=-1).reshape(-1, 3)
            index = (points @ self.matrix.T + self.shift - hull.origin) / hull.spacing
            field[k] = sample(hull.field, index, -hull.spacing).reshape(shape[1:])
        return field


def open_alike(images: Images, hull: Volume, planes: Sequence[Plane]) -> Volume:
    """Carve what other places of a hull that look alike have open.

    Args:
        images: of all views.
        hull: with the concavities that were found.
        planes: of the faces that views have confirmed.

    Returns:
        The hull without the rooms that views believe.
    """
    mesh = hull.mesh()
    directions, inside = _directions(hull, mesh, planes), np.argwhere(hull.field > 0)
    middle = hull.origin + hull.spacing * inside.mean(axis=0)
    motions = _holding(hull, mesh[0], [*_turns(directions, middle), *_mirrors(directions, middle)])
    if not motions:
        return hull
    rays, scene = rays_at_object(images), Scene(*mesh)
    for motion in motions:
        for cut in _rooms(hull, motion):
            opened = hull.with_field(np.minimum(hull.field, cut))
            after = opened.scene()
            if _agreeable(images, scene, after, hull, rays, motion):
                hull, scene = opened, after
    return hull


def _directions(hull: Volume, mesh: tuple[Array, NDArray[np.int64]], planes: Sequence[Plane]) -> list[Array]:
    """Unit directions (3,) that a hull may be turned about: of its axis of rotation, and across its faces."""
    axis = axis_of_rotation(*mesh, _NEAR_VOXELS * hull.spacing)
    about = [] if axis is None else [axis.direction]
    return axes_of([*about, *(plane.normal for plane in planes)])[:_MOST_DIRECTIONS]


def _turns(directions: Sequence[Array], middle: Array) -> Iterator[Motion]:
    """Rotations about the middle (3,) of a hull."""
    angles = sorted({360.0 * k / n for n in _FOLDS for k in range(1, n)})
    for direction in directions:
        for angle in angles:
            matrix = Rotation.from_rotvec(np.radians(angle) * direction).as_matrix()
            yield Motion(
                f"turned by {angle:.0f} degrees about {np.round(direction, 2).tolist()}",
                matrix,
                middle - matrix @ middle,
            )


def _mirrors(directions: Sequence[Array], middle: Array) -> Iterator[Motion]:
    """Mirrors through the middle (3,) of a hull."""
    for direction in directions:
        matrix = np.eye(3) - 2 * np.outer(direction, direction)
        yield Motion(f"mirrored along {np.round(direction, 2).tolist()}", matrix, middle - matrix @ middle)


def _settled(motion: Motion, hull: Volume, places: Array) -> Motion:
    """A motion, shifted and turned a little so that it carries most of a hull's surface (N, 3) onto it.

    One side has more open than the other, so a hull's middle is off, and the face that tells a direction may lean.
    """
    for _ in range(_STEPS):
        at = places @ motion.matrix.T + motion.shift
        index = (at - hull.origin) / hull.spacing
        off = sample(hull.field, index, np.nan)
        rises = [sample(hull.field, index + e, np.nan) - sample(hull.field, index - e, np.nan) for e in np.eye(3)]
        slope = np.column_stack(rises) / (2 * hull.spacing)
        near = (np.abs(off) < _ALIKE_VOXELS * hull.spacing) & np.isfinite(slope).all(axis=1)
        if not near.any():
            break
        middle = at[near].mean(axis=0)
        design = np.column_stack([slope[near], np.cross(at[near] - middle, slope[near])])
        # what no surface tells stays as it is
        normal = design.T @ design + _DAMPING * np.count_nonzero(near) * np.eye(6)
        step = -np.linalg.solve(normal, design.T @ off[near])
        turn = Rotation.from_rotvec(step[3:]).as_matrix()
        motion = replace(
            motion,
            matrix=turn @ motion.matrix,
            shift=middle + turn @ (motion.shift - middle) + step[:3],
        )
    return motion


def _holding(hull: Volume, vertices: Array, motions: Sequence[Motion]) -> list[Motion]:
    """Motions, settled, that carry a hull onto most of itself, best first."""
    coarse = np.ascontiguousarray(hull.field[(slice(None, None, _STRIDE),) * 3])
    small = Volume(coarse, hull.origin, _STRIDE * hull.spacing)
    inside = coarse > 0
    places = vertices[:: max(1, len(vertices) // _PLACES)]
    settled = [_settled(motion, hull, places) for motion in motions]
    overlap: list[float] = []
    for motion in settled:
        carried = motion.of(small) > 0
        overlap.append(float((inside & carried).sum() / max((inside | carried).sum(), 1)))
    order = [int(k) for k in np.argsort(-np.array(overlap), kind="stable") if overlap[k] >= _HOLDS]
    for k in order[:_MOST_MOTIONS]:
        logger.info("hull %s: overlaps itself to %.3f", settled[k].name, overlap[k])
    return [settled[k] for k in order[:_MOST_MOTIONS]]


def _rooms(hull: Volume, motion: Motion) -> Iterator[Field]:
    """(n, n, n) fields that leave out one room each that a motion carries into a hull, largest first."""
    carried = motion.of(hull)
    labels, count = ndimage.label((hull.field > 0) & (carried <= 0))
    if not count:
        return
    numbers = np.arange(1, count + 1)
    sizes = np.bincount(labels.ravel())[1:]
    deep = np.asarray(ndimage.maximum(np.minimum(hull.field, -carried), labels, numbers), np.float64)
    order = [k for k in np.argsort(-sizes, kind="stable") if sizes[k] >= _LEAST_VOXELS]
    for k in [k for k in order if deep[k] >= _THICK * hull.spacing][:_MOST_ROOMS]:
        room = ndimage.binary_dilation(labels == k + 1, iterations=2)
        yield np.where(room, carried, np.inf).astype(np.float32)


def _agreeable(images: Images, before: Scene, after: Scene, hull: Volume, rays: Rays, motion: Motion) -> bool:
    """Whether views agree better where a room has changed the hull."""
    said = disagreements(images, before, after, _REACH_VOXELS * hull.spacing, rays)
    good = better(said, _GAIN, _LEAST_RAYS, untold=False)
    logger.info(
        "room as elsewhere, %s: views disagree by %.2f for %.2f of the hull, %d rays%s",
        motion.name, said[1], said[0], said[2], "" if good else ": not believed",
    )  # fmt: skip
    return good
