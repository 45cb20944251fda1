"""Turned parts: what a hull leaves empty at any angle about the axis of rotation, it leaves empty at all.

A groove around a shaft shows its section where a camera looks along it; between such views a hull closes it. As with
channels (see `sweep`), a ring of the section that the hull leaves empty somewhere is emptied all around, if the
silhouettes stay filled and the views agree better.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.agreement import better, disagreements
from brepgaussian.splatting.concave.contours import chords_in, lost_share
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.planes import planar_regions
from brepgaussian.splatting.concave.prism import plane_axes
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.mesh import vertex_normals
from brepgaussian.splatting.sample import sample

Array = NDArray[np.float64]
Field = NDArray[np.float32]

_ANGLES = 90  # 4 degrees apart
_EMPTIEST = (0.05, 0.3)  # share of the angles that count as empty somewhere; the second passes by keyways and flats
_ONE_SIDED_EMPTIEST = 0.05
_ONE_SIDED = 0.8  # length of the mean direction; that of an arc of 66 degrees
_REWEIGHTINGS = 12
_NEAR_VOXELS = 3.0  # the normal of a turned surface passes its axis this near
_LATERAL = 0.3  # sine of a normal's angle to the axis, for it to tell an axis
_TURNED_SHARE = 0.4  # of the lateral surface is turned
_SQUARE = 0.9998  # cosine of 1.1 degrees
_LEAST_LATERAL = 0.1  # of all surface is lateral
_LEAST_CELLS = 5  # of a ring's section
_LEAST_VOLUME_VOXELS = 150  # of a ring; less is left to the surfels
_MOST_RINGS = 4  # tried, largest first
_MOST_LOST = 0.01  # share of the rays through a ring that it may leave with nothing
_GAIN = 1.0  # a ring leaves at most this share of the disagreement: being turned speaks for it
_ONE_SIDED_GAIN = 0.75  # as for an opening: of a groove that hardly any camera looks along, or of a cross hole
_LEAST_RAYS = 200
_REACH_VOXELS = 0.5  # rays on which a ring changes less than this don't judge it
_BEYOND_VOXELS = 4.0  # distance that stands for "outside of the ring": nothing is cut there

logger = log.get_logger("stage1")


@dataclass(frozen=True)
class Axis:
    """An axis of rotation: (3,) a point on it and (3,) its unit direction."""

    through: Array
    direction: Array

    def cylindrical(self, points: Array) -> tuple[Array, Array]:
        """(N,) distances from the axis and (N,) heights along it."""
        offset = points - self.through
        height = offset @ self.direction
        return np.linalg.norm(offset - height[:, None] * self.direction, axis=1), height

    def ring_distance(self, points: Array, radii: tuple[float, float], heights: tuple[float, float]) -> Array:
        """(N,) distances of points (N, 3) from a ring between two radii and two heights; negative inside."""
        spans = zip(self.cylindrical(points), (radii, heights), strict=True)
        off = np.column_stack([np.abs(value - (low + high) / 2) - (high - low) / 2 for value, (low, high) in spans])
        return np.asarray(np.linalg.norm(np.maximum(off, 0), axis=1) + np.minimum(off.max(axis=1), 0))


def turn(images: Images, hull: Volume) -> Volume:
    """The hull without the rings that are empty at some angle, by images of all views."""
    mesh = hull.mesh()
    axis = axis_of_rotation(*mesh, _NEAR_VOXELS * hull.spacing)
    if axis is None:
        return hull
    scene = Scene(*mesh)
    chords = chords_in(scene, *images.contour_rays)
    points = chords.samples()
    passes = [(share, False, _GAIN) for share in _EMPTIEST] + [(_ONE_SIDED_EMPTIEST, True, _ONE_SIDED_GAIN)]
    for share, one_sided, gain in passes:
        section = _Section(hull, axis, share, one_sided)
        for ring in section.rings()[:_MOST_RINGS]:
            if lost_share(chords, section.within(ring, points)) > _MOST_LOST:
                continue
            opened = section.emptied(ring, hull)
            after = opened.scene()
            old, new, count = said = disagreements(images, scene, after, _REACH_VOXELS * hull.spacing)
            good = better(said, gain, _LEAST_RAYS, untold=False)
            logger.info(
                "ring about %s, %d cells: views disagree by %.2f for %.2f of the hull, %d rays%s",
                np.round(axis.direction, 2).tolist(), ring.sum(), new, old, count, "" if good else ": not believed",
            )  # fmt: skip
            if good:
                hull, scene = opened, after
    return hull


def _one_sided(empty: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(R, Z) cells that are empty (A, R, Z) about one direction, or it and the opposite one, only.

    That is a cross hole, a flat or a keyway; or a groove that two opposite cameras look along and no other.
    """
    doubled = np.exp(4j * np.pi * np.arange(len(empty)) / len(empty))  # (A,) opposite directions are alike
    mean = np.abs(np.tensordot(doubled, empty, axes=1)) / np.maximum(empty.sum(axis=0), 1)
    return np.asarray(mean > _ONE_SIDED)


def axis_of_rotation(vertices: Array, triangles: NDArray[np.int64], near: float) -> Axis | None:
    """The axis that most of a mesh's normals pass, or None if the mesh is not turned.

    The lines (n, x x n) of the normals of a surface of revolution meet its axis (c, d): d . n + c . (x x n) = 0.
    Reweighted least squares find the axis in spite of keyways, flats and cross holes.

    Args:
        vertices: (K, 3); triangles: (T, 3), counter-clockwise from outside.
        near: distance from the axis within which a normal passes it.
    """
    normals = vertex_normals(vertices, triangles)
    corners = vertices[triangles]
    thirds = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 6
    areas: Array = np.bincount(triangles.ravel(), np.repeat(thirds, 3), len(vertices)).astype(np.float64)  # (K,)
    middle = np.average(vertices, axis=0, weights=areas)
    lines = np.column_stack([np.cross(vertices - middle, normals), normals])  # (K, 6)
    found: tuple[float, Axis] | None = None
    for start in np.linalg.eigh(normals.T @ (areas[:, None] * normals))[1].T:
        direction, moment = _settle(lines, areas, start, near)
        lateral = np.linalg.norm(np.cross(normals, direction), axis=1) > _LATERAL
        passes = np.abs(lines @ np.append(direction, moment)) < near
        share = areas[lateral & passes].sum() / max(areas[lateral].sum(), 1e-9)
        enough = areas[lateral].sum() > _LEAST_LATERAL * areas.sum()
        if enough and share >= _TURNED_SHARE and (found is None or share > found[0]):
            found = float(share), Axis(middle + np.cross(direction, moment), direction)
    if found is None:
        return None
    for region in planar_regions(vertices, triangles, near):
        if abs(region.normal @ found[1].direction) > _SQUARE:  # a flat end tells the direction best
            direction, moment = _settle(lines, areas, region.normal, near, fixed=True)
            return Axis(middle + np.cross(direction, moment), direction)
    return found[1]


def _settle(lines: Array, areas: Array, direction: Array, near: float, fixed: bool = False) -> tuple[Array, Array]:
    """Direction (3,) and moment (3,) of the axis next to (or along) a direction that most lines pass."""
    moment = np.zeros(3)
    scale = 1.0
    for _ in range(_REWEIGHTINGS):
        # the moment for this direction, then a small turn of both
        first, second = plane_axes(direction)
        basis = np.zeros((6, 4))
        basis[:3, 0], basis[:3, 1], basis[3:, 2], basis[3:, 3] = first, second, first, second
        off = lines @ np.append(direction, moment)
        weight = areas / (1 + (off / max(scale, near)) ** 2) ** 2
        design = lines @ basis
        if fixed:
            design[:, :2] = 0
        step = np.linalg.lstsq(
            design.T @ (weight[:, None] * design) + 1e-12 * np.eye(4), -design.T @ (weight * off), rcond=None
        )[0]
        direction = direction + step[0] * first + step[1] * second
        moment = moment + step[2] * first + step[3] * second
        length = np.linalg.norm(direction)
        direction, moment = direction / length, moment / length
        moment -= (moment @ direction) * direction
        scale *= 0.5
    return direction, moment


class _Section:
    """What a hull leaves empty at some angles about an axis, by distance from it and height along it."""

    def __init__(self, hull: Volume, axis: Axis, share: float, one_sided: bool) -> None:
        field, origin, spacing = hull.field, hull.origin, hull.spacing
        self.axis, self.spacing = axis, spacing
        corners = origin + spacing * (np.array(np.meshgrid(*[[0, n - 1] for n in field.shape])).reshape(3, -1).T)
        radius, height = axis.cylindrical(corners)
        self.low = float(height.min())
        r = spacing * np.arange(int(radius.max() / spacing))
        z = self.low + spacing * np.arange(int((height.max() - self.low) / spacing))
        first, second = plane_axes(axis.direction)
        stack = np.empty((_ANGLES, len(r), len(z)), np.float32)
        for k, angle in enumerate(2 * np.pi * np.arange(_ANGLES) / _ANGLES):
            out = np.cos(angle) * first + np.sin(angle) * second
            points = axis.through + r[:, None, None] * out + z[None, :, None] * axis.direction
            index = ((points - origin) / spacing).reshape(-1, 3)
            stack[k] = sample(field, index, -spacing).reshape(len(r), len(z))
        emptiest = np.quantile(stack, share, axis=0)
        passed_by = _one_sided(stack < 0) & (not one_sided)
        self.least = np.where(passed_by, np.median(stack, axis=0), emptiest).astype(np.float32)
        self.most = stack.max(axis=0)
        self.radii = r

    def rings(self) -> list[NDArray[np.bool_]]:
        """(R, Z) cells of the rings that are empty at some angle and full at another, largest first."""
        labels, count = ndimage.label((self.least < 0) & (self.most > 0))
        around = 2 * np.pi * self.radii[:, None] / self.spacing * np.ones(labels.shape)  # voxels
        volume = ndimage.sum(around, labels, np.arange(1, count + 1)) if count else np.zeros(0)
        order = np.argsort(-volume, kind="stable")
        cells = np.bincount(labels.ravel())[1:]
        return [labels == k + 1 for k in order if volume[k] >= _LEAST_VOLUME_VOXELS and cells[k] >= _LEAST_CELLS]

    def within(self, ring: NDArray[np.bool_], points: Array) -> NDArray[np.bool_]:
        """(N,) whether points lie in a ring."""
        radius, height = self.axis.cylindrical(points)
        rows = np.round(radius / self.spacing).astype(int)
        columns = np.round((height - self.low) / self.spacing).astype(int)
        inside = (rows < ring.shape[0]) & (columns >= 0) & (columns < ring.shape[1])
        inside[inside] = ring[rows[inside], columns[inside]]
        return inside

    def emptied(self, ring: NDArray[np.bool_], hull: Volume) -> Volume:
        """The hull without a ring."""
        field, origin = hull.field, hull.origin
        beyond = _BEYOND_VOXELS * self.spacing
        near = ndimage.binary_dilation(ring, iterations=2)
        profile = np.where(near, self.least, beyond)
        steps = [origin[k] + self.spacing * np.arange(field.shape[k]) for k in range(3)]
        opened = field.copy()
        for k, x in enumerate(steps[0]):  # a slice at a time keeps memory low
            flat = np.stack(np.meshgrid([x], steps[1], steps[2], indexing="ij"), axis=-1).reshape(-1, 3)
            radius, height = self.axis.cylindrical(flat)
            value = sample(profile, np.column_stack([radius, height - self.low]) / self.spacing, beyond)
            opened[k] = np.minimum(opened[k], value.reshape(opened[k].shape))
        return hull.with_field(opened)
