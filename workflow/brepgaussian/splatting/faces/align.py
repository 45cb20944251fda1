"""The plane of a face, from where its border lies in all views.

Seen through the right plane, the borders of a planar face's regions coincide in all views; through a plane that is
too high, too low or tilted they are shifted by parallax. So the plane is where the rectified regions agree best. It
needs no texture and no silhouette, only that the regions end at the face's border.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.geometry.cameras import Cameras
from brepgaussian.splatting.concave.prism import plane_axes
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.faces.candidates import Candidate

Array = NDArray[np.float64]

_CELLS = 32  # along the longer side of the lattice that the alignment looks at
_MARGIN = 0.12  # of the face's size, around it
_WIDTHS_PX = (8.0, 3.0)  # of the blurred borders, from coarse to fine
_REACH_PX = 12.0  # distances to a border are known this far
_LEAST_COSINE = 0.15  # a plane seen flatter blurs its cells into each other
_LEAST_VIEWS = 4  # that agree on a face
_LEAST_COUNT = 3  # views that see a cell
_LEAST_AREA = 0.5  # of the candidate's, that the views agree on
_BULGE = 0.04  # unit frame; a hull stands out of a plane by less
_EVEN, _ODD = 0.03, 3.0  # disagreement of a view that is always fine, and in medians of all views
_SWEEP = np.linspace(-0.05, 0.02, 15)  # heights tried first, unit frame: hulls lie outside of the part
_MOST_VIEWS = 16  # that take part
_HOPELESS = 0.25  # disagreement of unrelated regions
_ROUNDS = 10  # of Gauss-Newton
_STEP = 2e-4  # unit frame; of numeric derivatives, a tenth of a pixel
_MOST_STEP = 0.02  # unit frame
_CONVERGED = 1e-5  # unit frame
_NEARLY = np.cos(np.radians(5.0))  # of two planes that may be parallel: 4 measured of one whose border is hidden
_ALIGNED = np.cos(np.radians(0.1))  # of two that are
_AS_WELL = 2.0  # times the disagreement on the best plane: 1.0 to 1.75 measured where they were parallel


class Stack:
    """The regions of one candidate in all views that show it apart from its neighbours."""

    def __init__(self, cameras: Cameras, patches: NDArray[np.integer], candidate: Candidate) -> None:
        self.cameras = cameras
        self.views = _spread(sorted(candidate.regions))
        self.normal, self.origin = _mean_plane(candidate)
        self.first, self.second = plane_axes(self.normal)
        cut = [_cut_out(patches[v] == candidate.regions[v]) for v in self.views]
        self._corners = np.array([corner for _, corner in cut]).reshape(-1, 2)  # (R, 2)
        masks = [mask for mask, _ in cut]
        whole = [np.asarray(ndimage.binary_fill_holes(m), np.uint8) for m in masks]
        self.has_holes = any(w.sum() > m.sum() for w, m in zip(whole, masks, strict=True))
        self._exact = [_border_distance(m) for m in masks]
        self._outer = [_border_distance(m) for m in whole] if self.has_holes else self._exact

    def sample(self, points: Array, rows: NDArray[np.int64], holes: bool) -> Array:
        """(R, N) distance in px inside the face's border (or inside the outer one, without holes), negative outside."""
        distance = self._exact if holes else self._outer
        values = np.zeros((len(rows), len(points)), np.float32)
        for k, (row, pixels) in enumerate(zip(rows, self._pixels(points, rows), strict=True)):
            cv2.remap(
                distance[row], pixels[0, :, None], pixels[1, :, None], cv2.INTER_LINEAR, values[k, :, None],
                borderMode=cv2.BORDER_CONSTANT, borderValue=-_REACH_PX,
            )  # fmt: skip
        return values.astype(np.float64)

    def _pixels(self, points: Array, rows: NDArray[np.int64]) -> NDArray[np.float32]:
        """(R, 2, N) x and y of points in the windows of some rows."""
        views = np.array(self.views)[rows]
        pose, intrinsics = self.cameras.cam_from_unit[views], self.cameras.intrinsics[views]
        camera = pose[:, :3, :3] @ points.T + pose[:, :3, 3:]  # (R, 3, N)
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels = intrinsics[:, :2, None] * camera[:, :2] / camera[:, 2:] + intrinsics[:, 2:, None]
        return (pixels - self._corners[rows][:, :, None] - 0.5).astype(np.float32)

    def visible(self, points: Array, scene: Scene | None) -> NDArray[np.bool_]:
        """(V, N) whether each view sees points of the plane, past what stands out of it by more than a bulge."""
        seen = np.zeros((len(self.views), len(points)), bool)
        for row, view in enumerate(self.views):
            sight = self.cameras.centers[view] - points
            length = np.linalg.norm(sight, axis=1)
            cosine = (sight @ self.normal) / length
            seen[row] = cosine > _LEAST_COSINE
            if scene is not None:
                index = np.flatnonzero(seen[row])
                direction = sight[index] / length[index, None]
                start = points[index] + _BULGE / cosine[index, None] * direction
                seen[row, index] = ~scene.occluded(start, direction)
        return seen


@dataclass(frozen=True)
class Aligned:
    """A plane on which the views agree about a face's border.

    Attributes:
        normal: (3,) unit, outward; through: (3,) a point on it, in the middle of the face.
        disagreement: share of the face's area about which a view disagrees, squared and averaged.
        views: rows of the stack that agree.
        holes: whether they agree on the borders of its holes, too.
    """

    normal: Array
    through: Array
    disagreement: float
    views: NDArray[np.int64]
    holes: bool


def align(stack: Stack, candidate: Candidate, scene: Scene) -> Aligned | None:
    """The plane of a candidate, or None if the views do not agree on one.

    Around holes masks show the rim, a piece of the wall, or nothing at all; around a boss they show where it stands.
    So holes count if views agree better with them.
    """
    ways = [True, False] if stack.has_holes else [True]
    found = [a for a in (_align(stack, candidate, scene, holes) for holes in ways) if a is not None]
    return min(found, key=lambda a: a.disagreement, default=None)


class _Sheet:
    """Cells over a candidate and around it, on planes that are given by a height and two slopes."""

    def __init__(self, stack: Stack, candidate: Candidate) -> None:
        flat = np.column_stack([candidate.points @ stack.first, candidate.points @ stack.second])
        low, high = flat.min(axis=0), flat.max(axis=0)
        self.stack, self.size, self.middle = stack, float((high - low).max()), (low + high) / 2
        low, high = low - _MARGIN * self.size, high + _MARGIN * self.size
        pitch = float((high - low).max()) / _CELLS
        u, v = (np.arange(low[k], high[k], pitch) for k in (0, 1))
        grid = np.stack(np.meshgrid(u, v, indexing="ij"), -1).reshape(-1, 2)
        self.level = float(stack.origin @ stack.normal)
        self.base = grid[:, :1] * stack.first + grid[:, 1:] * stack.second + self.level * stack.normal
        self.local = (grid - self.middle) / self.size
        self.covered = len(np.unique(np.floor((flat - low) / pitch).astype(int), axis=0))  # cells with samples

    def points(self, parameters: Array) -> Array:
        """(N, 3) the cells."""
        height = parameters[0] + self.local @ parameters[1:]
        return np.asarray(self.base + height[:, None] * self.stack.normal)

    def plane(self, parameters: Array) -> tuple[Array, Array]:
        """Unit normal (3,), and the point (3,) in the middle of the face."""
        stack = self.stack
        normal = stack.normal - (parameters[1] * stack.first + parameters[2] * stack.second) / self.size
        height = self.level + parameters[0]
        through = self.middle[0] * stack.first + self.middle[1] * stack.second + height * stack.normal
        return normal / np.linalg.norm(normal), through

    def parameters(self, normal: Array, through: Array) -> Array:
        """(3,) of a plane, the inverse of `plane`."""
        axes = self.stack.first, self.stack.second
        slopes = [-self.size * float(normal @ axis) / float(normal @ self.stack.normal) for axis in axes]
        return np.array([float(through @ self.stack.normal) - self.level, *slopes])


def _align(stack: Stack, candidate: Candidate, scene: Scene, holes: bool) -> Aligned | None:
    """The plane on which the regions agree best, with their holes or without."""
    if len(stack.views) < _LEAST_VIEWS:
        return None
    sheet, agree = _Sheet(stack, candidate), np.arange(len(stack.views))
    sweep = [np.array([h, 0.0, 0.0]) for h in _SWEEP]
    seen = stack.visible(sheet.points(sweep[0]), None)
    best = min(sweep, key=lambda p: _residuals(stack.sample(sheet.points(p), agree, holes), seen, _WIDTHS_PX[0])[1])
    for width in (_WIDTHS_PX[0], *_WIDTHS_PX):
        seen = stack.visible(sheet.points(best), scene)[agree]

        def residuals(parameters: Array, width: float = width, seen: NDArray[np.bool_] = seen) -> tuple[Array, float]:
            return _residuals(stack.sample(sheet.points(parameters), agree, holes), seen, width)  # noqa: B023

        best, _ = _gauss_newton(residuals, best)
        kept = _agreeing(stack.sample(sheet.points(best), agree, holes), seen, width)
        if kept.sum() < _LEAST_VIEWS:
            return None
        agree = agree[kept]
    seen = stack.visible(sheet.points(best), scene)[agree]
    values = stack.sample(sheet.points(best), agree, holes)
    value = _residuals(values, seen, _WIDTHS_PX[-1])[1]
    area = _mean(np.clip(values / _WIDTHS_PX[-1] + 0.5, 0, 1), seen).sum()
    if area < _LEAST_AREA * min(sheet.covered, len(candidate.points)):
        return None
    return Aligned(*sheet.plane(best), value, agree, holes)


def parallel(stack: Stack, candidate: Candidate, scene: Scene, aligned: Aligned, normals: Sequence[Array]) -> Aligned:
    """The plane turned to the first of some normals (3,) that is nearly its own, if views agree about as well.

    Where walls or bosses hide a part of a face's border, the rest turns its plane by a few degrees; on parts most
    faces that nearly are parallel are.
    """
    near = next((n for n in normals if _ALIGNED > n @ aligned.normal > _NEARLY), None)
    if near is None:
        return aligned
    sheet, width = _Sheet(stack, candidate), _WIDTHS_PX[-1]
    start = sheet.parameters(near, aligned.through)
    seen = stack.visible(sheet.points(start), scene)[aligned.views]

    def residuals(height: Array) -> tuple[Array, float]:
        points = sheet.points(np.concatenate([height, start[1:]]))
        return _residuals(stack.sample(points, aligned.views, aligned.holes), seen, width)

    height, value = _gauss_newton(residuals, start[:1])
    if value > _AS_WELL * aligned.disagreement:
        return aligned
    normal, through = sheet.plane(np.concatenate([height, start[1:]]))
    return replace(aligned, normal=normal, through=through, disagreement=value)


def _agreeing(values: Array, seen: NDArray[np.bool_], width: float) -> NDArray[np.bool_]:
    """(V,) whether each view shows about the face that most views show."""
    inside = np.clip(values / width + 0.5, 0, 1)
    middle = np.zeros(inside.shape[1])
    known = seen.any(axis=0)
    middle[known] = np.nanmedian(np.where(seen, inside, np.nan)[:, known], axis=0)
    off = np.where(seen, (inside - middle) ** 2, 0.0).sum(axis=1)
    area = np.where(seen, np.maximum(middle, inside), 0.0).sum(axis=1)
    share = off / np.maximum(area, 1e-9)
    return np.asarray((share <= np.maximum(_ODD * np.median(share), _EVEN)) & (area > 0))


def _mean(inside: Array, seen: NDArray[np.bool_]) -> Array:
    return np.asarray(np.where(seen, inside, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1))


def _residuals(values: Array, seen: NDArray[np.bool_], width: float) -> tuple[Array, float]:
    """How far views disagree on whether a cell is inside: (V * N,) residuals, and their squares over the face's cells.

    Args:
        values: (V, N) signed distances to the border in px; seen: (V, N) which count.
        width: px over which the border is blurred.
    """
    count = seen.sum(axis=0)
    seen = seen & (count >= _LEAST_COUNT)
    inside = np.where(seen, np.clip(values / width + 0.5, 0, 1), 0.0)
    mean = inside.sum(axis=0) / np.maximum(count, 1)
    off = np.where(seen, inside - mean, 0.0) / np.sqrt(np.maximum(count, 1))
    return off.ravel(), float((off**2).sum() / max(mean.sum(), 1e-9))


def _gauss_newton(function: Callable[[Array], tuple[Array, float]], start: Array) -> tuple[Array, float]:
    """Few, damped steps with differenced derivatives; the parameters and their cost."""
    best, (off, value) = start, function(start)
    damping = 1e-2
    for _ in range(_ROUNDS):
        jacobian = np.column_stack([(function(best + _STEP * e)[0] - off) / _STEP for e in np.eye(len(best))])
        hessian = jacobian.T @ jacobian
        step = np.linalg.solve(hessian + damping * np.diag(np.diag(hessian) + 1e-12), -jacobian.T @ off)
        step *= min(1.0, _MOST_STEP / max(float(np.abs(step).max()), 1e-12))
        trial = best + step
        trial_off, trial_value = function(trial)
        if trial_value < value:
            best, off, value, damping = trial, trial_off, trial_value, damping / 3
            if np.abs(step).max() < _CONVERGED:
                break
        else:
            damping *= 10
    return best, value


def _spread(views: list[int]) -> list[int]:
    """At most `_MOST_VIEWS` of the views, evenly chosen."""
    if len(views) <= _MOST_VIEWS:
        return views
    return [views[i] for i in np.linspace(0, len(views) - 1, _MOST_VIEWS).round().astype(int)]


def _mean_plane(candidate: Candidate) -> tuple[Array, Array]:
    """Median normal and centre: bulges are in the normals' mean, not in their median."""
    normal = np.median(candidate.normals, axis=0)
    return normal / max(float(np.linalg.norm(normal)), 1e-9), np.median(candidate.points, axis=0)


def _cut_out(region: NDArray[np.bool_]) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """The part of an image (H, W) with all that is `_REACH_PX` from a region, and (2,) x, y of its first pixel."""
    x, y, width, height = cv2.boundingRect(region.astype(np.uint8))
    margin = int(np.ceil(_REACH_PX)) + 1
    left, top = max(x - margin, 0), max(y - margin, 0)
    part = region[top : y + height + margin, left : x + width + margin]
    return part.astype(np.uint8), np.array([left, top])


def _border_distance(mask: NDArray[np.uint8]) -> NDArray[np.float32]:
    """(H, W) distance in px inside the border of a region, negative outside."""
    inner = cv2.distanceTransform(mask, cv2.DIST_L2, cv2.DIST_MASK_5)
    outer = cv2.distanceTransform(1 - mask, cv2.DIST_L2, cv2.DIST_MASK_5)
    signed = np.where(mask > 0, inner - 0.5, 0.5 - outer)
    return np.clip(signed, -_REACH_PX, _REACH_PX).astype(np.float32)
