"""Which parts of a hull's surface the masks show as one region: candidates for planar faces."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.cameras import Cameras
from brepgaussian.splatting.concave.scene import Scene

Array = NDArray[np.float64]

_FACING = 0.15  # cosine under which a surface is seen too flat to say which region it shows
_SMALLEST = 15  # samples of a region that proposes a candidate
_PURE = 0.9  # of the samples that a region shows belong to the candidate, else it is merged with a neighbour
_WHOLE = 0.9  # of a candidate's visible samples are in its region, else it is split
_LEAST_VISIBLE = 10  # samples that a view must show
_LEAST_VIEWS = 4  # that confirm a candidate
_FRESH = 0.5  # of a candidate's regions belong to no better one, else it is the same


@dataclass(frozen=True)
class Candidate:
    """A piece of the hull that is one region in the images.

    Attributes:
        points, normals: (M, 3) samples of the hull on it.
        regions: the region that shows it and nothing else, by view; views that merge or split it are missing.
    """

    points: Array
    normals: Array
    regions: dict[int, int]


def candidates(
    cameras: Cameras, patches: NDArray[np.integer], scene: Scene, points: Array, normals: Array
) -> list[Candidate]:
    """The sets of samples that a region of some view shows, as far as other views confirm them; best confirmed first.

    Every region of every view proposes what it shows. A view that merges a face with its neighbour proposes both
    together, and other views the face alone; which of them is planar is not decided here.

    Args:
        cameras: V views.
        patches: (V, H, W) region ids, 0 = none.
        scene: the hull.
        points, normals: (N, 3) samples spread evenly over the hull.
    """
    shown = _regions(cameras, patches, scene, points, normals)
    found: list[tuple[NDArray[np.bool_], dict[int, int]]] = []
    for view, ids in enumerate(shown):
        for region in np.unique(ids[ids > 0]):
            members = ids == region
            if members.sum() >= _SMALLEST:
                found.append((members, _alike(shown, members, view)))
    found = [f for f in found if len(f[1]) >= _LEAST_VIEWS]
    found.sort(key=lambda f: -len(f[1]) * int(f[0].sum()))
    kept: list[Candidate] = []
    taken: set[tuple[int, int]] = set()
    for _, regions in found:
        fresh = [item for item in regions.items() if item not in taken]
        if len(fresh) > _FRESH * len(regions):
            taken |= set(regions.items())
            whole = _joined(shown, regions)
            kept.append(Candidate(points[whole], normals[whole], regions))
    return kept


def _regions(
    cameras: Cameras, patches: NDArray[np.integer], scene: Scene, points: Array, normals: Array
) -> NDArray[np.int32]:
    """(V, N) region in which each view shows each sample, 0 = hidden or in none."""
    shown = np.zeros((len(cameras), len(points)), np.int32)
    height, width = patches.shape[1:]
    lift = 1e-3 * normals
    for view, center in enumerate(cameras.centers):
        sight = center - points
        length = np.linalg.norm(sight, axis=1)
        index = np.flatnonzero((sight * normals).sum(1) > _FACING * length)
        index = index[~scene.occluded(points[index] + lift[index], sight[index] / length[index, None])]
        pixels = np.floor(cameras.project(view, points[index])[0]).astype(int)
        inside = (pixels >= 0).all(1) & (pixels[:, 0] < width) & (pixels[:, 1] < height)
        index, pixels = index[inside], pixels[inside]
        shown[view, index] = patches[view, pixels[:, 1], pixels[:, 0]]
    return shown


def _alike(shown: NDArray[np.int32], members: NDArray[np.bool_], view: int) -> dict[int, int]:
    """The region of each view that shows some samples and nothing else that `view` sees, by view."""
    visible = shown[view] > 0  # samples that the proposing view knows
    result = {}
    for other, ids in enumerate(shown):
        inside = ids[members & (ids > 0)]
        if len(inside) < _LEAST_VISIBLE:
            continue
        count = np.bincount(inside)
        region = int(count.argmax())
        both = (ids == region) & visible
        if count[region] >= _WHOLE * len(inside) and count[region] >= _PURE * both.sum():
            result[other] = region
    return result


def _joined(shown: NDArray[np.int32], regions: dict[int, int]) -> NDArray[np.bool_]:
    """(N,) samples that most of the regions hold, of the views that show them."""
    views = sorted(regions)
    inside = sum((shown[v] == regions[v]).astype(int) for v in views)
    visible = sum((shown[v] > 0).astype(int) for v in views)
    return np.asarray((visible > 0) & (2 * inside > visible))
