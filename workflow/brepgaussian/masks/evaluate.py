"""Scores of edge maps and patch masks against the faces that are really visible."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

EDGE_TOLERANCE_PX = 3.0  # the usual tolerance of edge benchmarks at this image size
EDGE_THRESHOLD = 128  # edge maps are probabilities 0..255
MINIMUM_REGION_PX = 100  # truth regions below count neither way: they are slivers of a few pixels' width


@dataclass(frozen=True)
class EdgeScore:
    """Precision and recall of an edge map at `EDGE_TOLERANCE_PX`, as counts so that views can be pooled."""

    hits: int = 0
    found: int = 0
    recalled: int = 0
    wanted: int = 0

    def __add__(self, other: "EdgeScore") -> "EdgeScore":
        return EdgeScore(
            self.hits + other.hits,
            self.found + other.found,
            self.recalled + other.recalled,
            self.wanted + other.wanted,
        )

    @property
    def precision(self) -> float:
        """Share of found edge pixels that lie near a true edge; 1 if none is found."""
        return self.hits / self.found if self.found else 1.0

    @property
    def recall(self) -> float:
        """Share of true edge pixels that lie near a found edge; 1 if there is none."""
        return self.recalled / self.wanted if self.wanted else 1.0

    @property
    def f(self) -> float:
        """Harmonic mean of precision and recall."""
        total = self.precision + self.recall
        return 2 * self.precision * self.recall / total if total else 0.0


@dataclass(frozen=True)
class RegionScore:
    """Regions of one or more views compared with the truth's, as counts."""

    hits_50: int = 0
    hits_75: int = 0
    found: int = 0
    wanted: int = 0
    split: int = 0
    joined: int = 0

    def __add__(self, other: "RegionScore") -> "RegionScore":
        return RegionScore(
            self.hits_50 + other.hits_50,
            self.hits_75 + other.hits_75,
            self.found + other.found,
            self.wanted + other.wanted,
            self.split + other.split,
            self.joined + other.joined,
        )

    @property
    def f_50(self) -> float:
        """2 hits / (found + wanted) at IoU > 0.5."""
        return 2 * self.hits_50 / max(self.found + self.wanted, 1)

    @property
    def f_75(self) -> float:
        """2 hits / (found + wanted) at IoU > 0.75."""
        return 2 * self.hits_75 / max(self.found + self.wanted, 1)

    @property
    def over(self) -> float:
        """Over-segmentation: share of true regions of which two or more found regions each cover a tenth or more."""
        return self.split / max(self.wanted, 1)

    @property
    def under(self) -> float:
        """Under-segmentation: share of found regions that hold a tenth or more of two or more true regions."""
        return self.joined / max(self.found, 1)


def true_regions(face_ids: NDArray[np.integer]) -> NDArray[np.int32]:
    """Connected components (4-connected) of each visible face in one view.

    Args:
        face_ids: (H, W) face per pixel, -1 = background.

    Returns:
        (H, W) int32 region ids from 1, 0 = background.
    """
    regions = np.zeros(face_ids.shape, np.int32)
    count = 0
    for face in np.unique(face_ids[face_ids >= 0]):
        labels, found = ndimage.label(face_ids == face)
        regions[labels > 0] = labels[labels > 0] + count
        count += found
    return regions


def borders(labels: NDArray[np.integer] | NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) bool: pixels with another label to their right or below (borders one pixel wide)."""
    edge = np.zeros(labels.shape, bool)
    edge[:, :-1] |= labels[:, :-1] != labels[:, 1:]
    edge[:-1] |= labels[:-1] != labels[1:]
    return edge


def score_edges(edges: NDArray[np.uint8], face_ids: NDArray[np.integer], *, interior: bool = False) -> EdgeScore:
    """Compare one view's edge map with the borders of the visible faces.

    The map is thresholded at one half and thinned to lines, so that wide lines count no more than thin ones.

    Args:
        edges: (H, W) uint8 edge probability.
        face_ids: (H, W) visible face, -1 = background.
        interior: leave out everything within the tolerance of the silhouette, in map and truth.
    """
    truth = borders(face_ids)
    found = thin(edges >= EDGE_THRESHOLD)
    to_truth, to_found = _distance(truth), _distance(found)
    counted = np.ones(truth.shape, bool)
    if interior:
        counted = _distance(borders(face_ids >= 0)) > EDGE_TOLERANCE_PX
    return EdgeScore(
        hits=int((found & counted & (to_truth <= EDGE_TOLERANCE_PX)).sum()),
        found=int((found & counted).sum()),
        recalled=int((truth & counted & (to_found <= EDGE_TOLERANCE_PX)).sum()),
        wanted=int((truth & counted).sum()),
    )


def thin(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Skeleton of a binary edge map."""
    from skimage.morphology import skeletonize

    return skeletonize(mask) if mask.any() else mask


def score_regions(
    patches: NDArray[np.integer], face_ids: NDArray[np.integer], minimum: int = MINIMUM_REGION_PX
) -> RegionScore:
    """Compare one view's patch masks with the connected components of the visible faces.

    Both sides are split into connected components, so per-view ids and ids shared by all views score alike.
    Truth regions under `minimum` pixels are left out, and so are found regions under `minimum` and those that lie
    mostly on left-out truth or on the background.

    Args:
        patches: (H, W) region ids, 0 = none.
        face_ids: (H, W) visible face, -1 = background.
        minimum: px.
    """
    truth, found = true_regions(face_ids), true_regions(np.where(patches > 0, patches, -1))
    table = np.zeros((found.max() + 1, truth.max() + 1), np.int64)
    np.add.at(table, (found.ravel(), truth.ravel()), 1)
    area_truth, area_found = table.sum(0), table.sum(1)
    big = area_truth >= minimum
    big[0] = False
    on_big = table[:, big].sum(1)
    counted = (area_found >= minimum) & (on_big > 0.5 * area_found)
    counted[0] = False
    inner = table[np.ix_(counted, big)]
    if not inner.size:
        return RegionScore(found=int(counted.sum()), wanted=int(big.sum()))
    union = area_found[counted][:, None] + area_truth[big][None] - inner
    iou = inner / union
    best = iou.max(0)  # IoU > 0.5 pairs are one-to-one by themselves
    tenth = inner >= 0.1 * area_truth[big][None]
    return RegionScore(
        hits_50=int((best > 0.5).sum()),
        hits_75=int((best > 0.75).sum()),
        found=int(counted.sum()),
        wanted=int(big.sum()),
        split=int((tenth.sum(0) > 1).sum()),
        joined=int((tenth.sum(1) > 1).sum()),
    )


def _distance(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Distance in pixels to the nearest set pixel (infinite if none is set)."""
    if not mask.any():
        return np.full(mask.shape, np.inf, np.float32)
    return np.asarray(cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE), np.float32)
