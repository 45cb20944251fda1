"""The object's bounding box from its silhouettes: a visual hull carved coarse to fine."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.errors import InputError
from brepgaussian.geometry.cameras import Cameras

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
_GRID = 48  # voxels along the longest side of the region in each round
_ROUNDS = 3  # each shrinks the region to the voxels that are left
_HALVINGS = 6  # of the voxels at each side of the box: down to 1/3000 of it
_CANDIDATES = 4000  # voxels that may hold a side's outermost point, the outermost first
_START_MARGIN = 1.6  # the first region exceeds the size that the silhouettes suggest
_SHOWN = 0.9  # of a silhouette's pixels whose rays must meet the hull; good cameras give .99 and more
_RAYS = 400  # silhouette pixels tried per view
_STEPS = 160  # along each ray through the hull's box
_MEDIAN_VIEWS = 0.5  # a voxel must project into this share of the images: elsewhere nothing is known


def bounding_box(silhouettes: Mask, cameras: Cameras, names: Sequence[str], file: Path) -> tuple[Array, Array]:
    """Corners (3,), (3,) of the visual hull's bounding box.

    Args:
        silhouettes: (V, H, W) inside the object.
        cameras: in any frame.
        names: of the views, for messages.
        file: for messages.

    Raises:
        InputError: the silhouettes and cameras have no hull in common, or it leaves silhouettes unexplained.
    """
    distances = [_outside_distance(mask) for mask in silhouettes]
    center, half = _start(silhouettes, cameras, file)
    low, high = center - half, center + half
    for _ in range(_ROUNDS):
        size = float((high - low).max()) / _GRID
        voxels = _grid(low, high, size)
        radius = size * np.sqrt(3) / 2
        kept = voxels[_inside(voxels, distances, cameras, radius)]
        if len(kept) == 0:
            raise InputError(
                "the silhouettes have no volume in common under these cameras",
                file=file,
                fix="check the cameras' axes, handedness and units, and that every mask shows the object in white",
            )
        low, high = kept.min(axis=0) - size, kept.max(axis=0) + size
    for axis in range(3):
        low[axis] = -_outermost(kept, size, axis, -1, distances, cameras)
        high[axis] = _outermost(kept, size, axis, 1, distances, cameras)
    _check_explained(low, high, silhouettes, distances, cameras, names, file)
    return low, high


def _outside_distance(mask: Mask) -> NDArray[np.float32]:
    """(H, W) distance in px of each pixel centre from the silhouette, 0 inside."""
    return ndimage.distance_transform_edt(~mask).astype(np.float32)


def _start(silhouettes: Mask, cameras: Cameras, file: Path) -> tuple[Array, float]:
    """Centre and half size of a cube around the object: where the rays through the silhouettes' centres meet."""
    system, right, rays = np.zeros((3, 3)), np.zeros(3), []
    for view, mask in enumerate(silhouettes):
        rows, columns = np.nonzero(mask)
        middle = np.array([[(columns.min() + columns.max() + 1) / 2, (rows.min() + rows.max() + 1) / 2]])
        center, direction = cameras.rays(view, middle)
        across = np.eye(3) - np.outer(direction[0], direction[0])
        system, right = system + across, right + across @ center
        extent = max(np.ptp(columns), np.ptp(rows)) + 1
        rays.append((center, direction[0], extent / cameras.intrinsics[view, :2].mean()))
    if np.linalg.cond(system) > 1e8:
        raise InputError("all cameras look along the same line", file=file, fix="give views from all around the object")
    target = np.linalg.solve(system, right)
    depths = np.array([(target - center) @ direction for center, direction, _ in rays])
    if (depths <= 0).mean() > _MEDIAN_VIEWS:
        raise InputError(
            "most cameras look away from the object",
            file=file,
            fix="check the cameras' axes: OpenGL (y up, z backward) in transforms.json",
        )
    sizes = [depth * extent for depth, (_, _, extent) in zip(depths, rays, strict=True) if depth > 0]
    return np.asarray(target, np.float64), _START_MARGIN * float(np.median(sizes))


def _grid(low: Array, high: Array, size: float) -> Array:
    """(N, 3) centres of the voxels of a box."""
    axes = [np.arange(a + size / 2, max(b, a + size), size) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def _inside(points: Array, distances: Sequence[NDArray[np.float32]], cameras: Cameras, radius: float) -> Mask:
    """(N,) whether balls of `radius` around (N, 3) points touch every silhouette that shows them."""
    alive, seen = np.arange(len(points)), np.zeros(len(points), int)
    for view, distance in enumerate(distances):
        pixels, depth = cameras.project(view, points[alive])
        reach = radius * cameras.intrinsics[view, :2].max() / np.maximum(depth, 1e-9)
        column, row = np.floor(np.nan_to_num(pixels, nan=-1, posinf=-1, neginf=-1)).astype(np.int64).T
        shown = (depth > 0) & (column >= 0) & (row >= 0) & (column < cameras.width) & (row < cameras.height)
        gap = np.zeros(len(alive))
        gap[shown] = distance[row[shown], column[shown]]
        seen[alive[shown]] += 1
        keep = (depth > 0) & (gap <= reach)
        alive = alive[keep]
    result = np.zeros(len(points), bool)
    result[alive] = seen[alive] > _MEDIAN_VIEWS * len(distances)
    return result


def _outermost(
    voxels: Array, size: float, axis: int, sign: int, distances: Sequence[NDArray[np.float32]], cameras: Cameras
) -> float:
    """How far the hull reaches along an axis (times `sign`): voxels that may hold the outermost point are halved."""
    octants = np.stack(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5], indexing="ij"), axis=-1).reshape(-1, 3)
    best, reached = float((sign * voxels[:, axis]).max()), -np.inf
    for _ in range(_HALVINGS):
        order = np.argsort(-sign * voxels[:, axis], kind="stable")[:_CANDIDATES]
        size /= 2
        children = (voxels[order][:, None] + size * octants).reshape(-1, 3)
        voxels = children[_inside(children, distances, cameras, size * np.sqrt(3) / 2)]
        if len(voxels) == 0:
            break
        extent = sign * voxels[:, axis]
        certain = extent[_inside(voxels, distances, cameras, 0.0)]
        best = float(extent.max())
        reached = max(reached, float(certain.max(initial=-np.inf)))
        voxels = voxels[extent + size / 2 >= reached]
    return reached if np.isfinite(reached) else best


def _check_explained(
    low: Array,
    high: Array,
    silhouettes: Mask,
    distances: Sequence[NDArray[np.float32]],
    cameras: Cameras,
    names: Sequence[str],
    file: Path,
) -> None:
    """Every silhouette's pixels must look at the hull that all silhouettes leave."""
    bad, worst = [], (1.0, "")
    step = float(np.linalg.norm(high - low)) / _STEPS
    for view, mask in enumerate(silhouettes):
        rows, columns = np.nonzero(mask)
        tried = np.linspace(0, len(rows) - 1, min(_RAYS, len(rows))).astype(int)
        center, directions = cameras.rays(view, np.column_stack([columns[tried] + 0.5, rows[tried] + 0.5]))
        middle = np.linalg.norm((low + high) / 2 - center)
        along = middle + step * (np.arange(_STEPS) - _STEPS / 2)
        points = center + directions[:, None] * along[None, :, None]
        met = _inside(points.reshape(-1, 3), distances, cameras, step / 2).reshape(len(tried), -1).any(axis=1)
        share = float(met.mean())
        if share < _SHOWN:
            bad.append(names[view])
        worst = min(worst, (share, names[view]))
    if bad:
        raise InputError(
            f"silhouettes and cameras disagree in {len(bad)} of {len(names)} views (worst {worst[1]}, "
            f"where {100 * worst[0]:.0f} % of the silhouette fits the others)",
            file=file,
            fix="check those views' poses and masks; remove wrong views",
        )
