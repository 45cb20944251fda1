"""Faces that the images confirm: their outline on the plane, and one grey level in all views within it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.prism import Lattice, over, plane_axes
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.faces.align import Aligned, Stack
from brepgaussian.splatting.faces.candidates import Candidate
from brepgaussian.splatting.faces.even import evenness

Array = NDArray[np.float64]

_MOST_DISAGREEMENT = 0.012  # of the face's area: .001-.009 on planes, from .013 on others
_MINORITY_DISAGREEMENT = 0.004  # the same where most views merge the face with a neighbour
# Masks may also disagree about a face's holes and countersinks. Then its grey has to speak for it, and its size:
# a strip of a curved face looks the same from everywhere too, but is narrow.
_DOUBTFUL_DISAGREEMENT = 0.04
_DOUBTFUL_EVEN_SHARE = 0.92
_DOUBTFUL_AREA = 0.03
_LEAST_AGREEING, _MINORITY = 5, 0.4  # views, and the share of all below which they are a minority
_LEAST_SURE = 4  # views that do where they agree so well: of few views fewer see a face
_MOST_CELLS = 160  # along the longer side of the outline's lattice
_PITCH_PIXELS = 1.25
_MARGIN_CELLS = 4
_INSIDE = 0.5  # of the views put the cell inside
_SURELY_INSIDE = 0.8  # of those that would see it, if the hull hides it
_BORDER_PX = 3.0  # from the border, cells whose height is measured
_LEAST_SEEN = 4  # views of such a cell, and of one that is surely seen
_LEAST_PARALLAX = 1.0  # px squared, summed over views, for a rise of one cell
_LEVEL_PIXELS = 0.8  # footprints of a pixel: a border this near to the plane is on it
_BORDER_NOISE_PX = 0.4  # of a border in one view
_LEVEL_SHARE = 0.85  # of the border; occluders and bad masks spoil some
_SIGMAS = 3.0
_EVEN_SHARE = 0.7  # of the inner cells look alike in all views
_BLUR_PX = 2.0  # of the border between two regions


@dataclass(frozen=True)
class Face:
    """A planar face that is confirmed.

    Attributes:
        lattice: on its plane.
        outline: (R, C) cells on the face.
        disagreement: see `Aligned`.
        bulge: how far the hull stands out of it, unit frame.
    """

    lattice: Lattice
    outline: NDArray[np.bool_]
    disagreement: float
    bulge: float

    @property
    def area(self) -> float:
        """Area of the outline."""
        return float(self.outline.sum()) * self.lattice.pitch**2


def confirm(
    images: Images, stack: Stack, candidate: Candidate, aligned: Aligned, scene: Scene, strict: bool = False
) -> Face | None:
    """The face of an aligned candidate, or None where the views contradict it.

    Args:
        images: of all views.
        stack, candidate, aligned: the candidate with its plane.
        scene: the hull.
        strict: don't let a face's grey outweigh that masks disagree about it.
    """
    few = len(aligned.views) < _MINORITY * len(stack.views)
    doubtful = aligned.disagreement > _MOST_DISAGREEMENT
    most = _MINORITY_DISAGREEMENT if few else _MOST_DISAGREEMENT if strict else _DOUBTFUL_DISAGREEMENT
    sure = not few and aligned.disagreement <= _MINORITY_DISAGREEMENT
    if aligned.disagreement > most or len(aligned.views) < (_LEAST_SURE if sure else _LEAST_AGREEING):
        return None
    lattice = _lattice(candidate, aligned, _PITCH_PIXELS * images.views.cameras.footprint())
    cells = lattice.centers().reshape(-1, 3)
    bare = stack.visible(cells, scene)[aligned.views]
    depth = stack.sample(cells, aligned.views, holes=True)
    outline = _outline(lattice, depth, bare)
    large = doubtful or len(aligned.views) < _LEAST_AGREEING
    if outline.sum() * lattice.pitch**2 < (_DOUBTFUL_AREA if large else 0.0) or not outline.any():
        return None
    values = depth if aligned.holes else stack.sample(cells, aligned.views, holes=False)
    if not _is_level(stack, aligned, cells, values, bare, lattice.pitch):
        return None
    chosen = [stack.views[r] for r in aligned.views]
    even, crowded = evenness(images, lattice, outline, chosen, bare)
    if even < (_DOUBTFUL_EVEN_SHARE if doubtful else _EVEN_SHARE):
        return None
    outline &= ~crowded
    if not doubtful:
        believed = bare | (depth > 0) & stack.visible(cells, None)[aligned.views]
        hidden = _outline(lattice, depth, believed) & ~outline
        even, crowded = evenness(images, lattice, hidden, chosen, believed & (depth > _BLUR_PX))
        if even >= _EVEN_SHARE:
            shown = outline & (bare.sum(axis=0) >= _LEAST_SEEN).reshape(outline.shape)
            outline = ndimage.binary_propagation(shown, mask=outline | hidden & ~crowded)
    return Face(lattice, outline, aligned.disagreement, _bulge(lattice, outline, candidate.points))


def in_doubt(face: Face, stack: Stack, aligned: Aligned, before: Scene, after: Scene) -> NDArray[np.bool_]:
    """(R, C) hidden cells that not nearly all views have inside which would see them if the face's bulge were none.

    What a hull hides is believed of the views whose region covers it, and regions merge the side of a rib with what
    this stands on more often than they split a face there.

    Args:
        face: of the candidate.
        stack, aligned: the candidate with its plane.
        before, after: the hull, with and without the bulge.
    """
    cells = face.lattice.centers().reshape(-1, 3)
    bare, seen = (stack.visible(cells, scene)[aligned.views] for scene in (before, after))
    depth = stack.sample(cells, aligned.views, holes=True) + _BLUR_PX  # what is at the border is not surely outside
    inside = _outline(face.lattice, depth, seen, _SURELY_INSIDE)
    shown, told = ((some.sum(axis=0) >= _LEAST_SEEN).reshape(inside.shape) for some in (bare, seen))
    return np.asarray(face.outline & told & ~inside & ~shown)


def _outline(lattice: Lattice, depth: Array, seen: NDArray[np.bool_], share: float = _INSIDE) -> NDArray[np.bool_]:
    """(R, C) cells that a share of the views which see them (V, N) has inside the border, by depths (V, N) px."""
    inside = np.where(seen, np.clip(depth + 0.5, 0, 1), 0).sum(axis=0)
    return np.asarray((inside > share * np.maximum(seen.sum(axis=0), 1)).reshape(lattice.shape))


def _bulge(lattice: Lattice, outline: NDArray[np.bool_], points: Array) -> float:
    """How far points over the outline stand out of the plane."""
    within, heights = over(lattice, outline, points)
    return max(float(heights[within].max(initial=0.0)), 0.0)


def _is_level(
    stack: Stack, aligned: Aligned, cells: Array, values: Array, seen: NDArray[np.bool_], pitch: float
) -> bool:
    """Whether nearly all of the border lies on the plane: its height above it follows from each cell's parallax.

    Two parallel faces of one grey, or an arc of a cone, have a border that no plane holds.
    """
    border = (np.abs(np.median(values, axis=0)) < _BORDER_PX) & (seen.sum(axis=0) >= _LEAST_SEEN)
    if not border.any():
        return False
    cells, values, seen = cells[border], values[:, border], seen[:, border]
    raised = stack.sample(cells + pitch * aligned.normal, aligned.views, aligned.holes)
    slope = np.where(seen, (raised - values) / pitch, np.nan)  # px per unit of height
    slope -= np.nanmean(slope, axis=0)
    offset = np.where(seen, values, np.nan)
    offset -= np.nanmean(offset, axis=0)
    stiffness = np.nansum(slope**2, axis=0)
    told = stiffness > _LEAST_PARALLAX / pitch**2
    height = -np.nansum(slope * offset, axis=0) / np.maximum(stiffness, 1e-9)
    allowed = _LEVEL_PIXELS * pitch / _PITCH_PIXELS + _SIGMAS * _BORDER_NOISE_PX / np.sqrt(np.maximum(stiffness, 1e-9))
    level = np.abs(height[told]) < allowed[told]
    return bool(level.sum() > _LEVEL_SHARE * max(len(level), 1))


def _lattice(candidate: Candidate, aligned: Aligned, pitch: float) -> Lattice:
    first, second = plane_axes(aligned.normal)
    flat = np.column_stack([candidate.points @ first, candidate.points @ second])
    low, high = flat.min(axis=0), flat.max(axis=0)
    pitch = max(pitch, float((high - low).max()) / _MOST_CELLS)
    low, high = low - _MARGIN_CELLS * pitch, high + _MARGIN_CELLS * pitch
    rows, columns = np.ceil((high - low) / pitch).astype(int)
    origin = low[0] * first + low[1] * second + (aligned.through @ aligned.normal) * aligned.normal
    return Lattice(origin, first, second, aligned.normal, pitch, (int(rows), int(columns)))
