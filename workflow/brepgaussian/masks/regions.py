"""Patch masks from one image: an over-segmenting watershed whose regions merge where their luminance continues."""

import heapq

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.morphology import reconstruction
from skimage.segmentation import watershed

_BORDER_WEIGHT = 0.02  # of pixels beside another region: antialiasing mixes two faces there
_RIDGE = 1e-9  # keeps normal equations of thin regions solvable
_DEGREE_AREAS = (24.0, 120.0)  # px from which a region's luminance is a plane, a quadric
_TERMS = (1, 3, 6)  # of a polynomial of degree 0, 1, 2
_MAX_SAMPLES = 48  # border samples that a pair of regions is compared at
_POWERS = np.array([(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)])


def oversegment(strength: NDArray[np.float32], inside: NDArray[np.bool_], depth: float) -> NDArray[np.int32]:
    """Basins of the step strength that are at least `depth` deep.

    Args:
        strength: (h, w) step strength, grey levels.
        inside: (h, w) silhouette.
        depth: grey levels.

    Returns:
        (h, w) int32 labels from 1, 0 off the object.
    """
    surface = np.where(inside, strength, strength.max() + 2 * depth).astype(np.float32)
    filled = reconstruction(surface + np.float32(depth), surface, method="erosion").astype(np.float32)
    minima = (filled - surface >= depth * 0.999) & inside
    markers, _ = ndimage.label(minima, structure=np.ones((3, 3)))
    return watershed(surface, markers, mask=inside).astype(np.int32)


class RegionGraph:
    """Regions of one image with the luminance polynomials and the borders that decide which of them merge.

    A region's luminance is a polynomial of degree 2 in the position (1 or 0 for small regions), fitted by least
    squares from moments, which add up when regions merge.

    Args:
        labels: (h, w) int32, 0 = none, ids 1..N.
        grey: (h, w) luminance.
        ridge: (h, w) step strength without shading: what stands out above a smooth change of luminance.
        noise: standard deviation of the image noise, grey levels.
    """

    def __init__(
        self, labels: NDArray[np.int32], grey: NDArray[np.float32], ridge: NDArray[np.float32], noise: float
    ) -> None:
        self.noise = noise
        self.count = int(labels.max())
        self._scale = 2.0 / max(labels.shape)
        self._centre = np.array(labels.shape[::-1]) / 2
        self.area = np.bincount(labels.ravel(), minlength=self.count + 1).astype(float)
        self._moments(labels, grey)
        self.borders = self._find_borders(labels, ridge)
        self.neighbours: list[set[int]] = [set() for _ in range(self.count + 1)]
        for a, b in self.borders:
            self.neighbours[a].add(b)
            self.neighbours[b].add(a)
        self._fits: dict[int, tuple[NDArray, NDArray]] = {}

    def _monomials(self, x: NDArray, y: NDArray) -> NDArray[np.float64]:
        u, v = (x - self._centre[0]) * self._scale, (y - self._centre[1]) * self._scale
        return np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], -1)

    def _moments(self, labels: NDArray[np.int32], grey: NDArray[np.float32]) -> None:
        beside = cv2.morphologyEx(labels.astype(np.int16), cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8)) > 0
        rows, columns = np.nonzero(labels)
        ids = labels[rows, columns]
        weight = np.where(beside[rows, columns], _BORDER_WEIGHT, 1.0)
        value = grey[rows, columns].astype(np.float64)
        u, v = (columns - self._centre[0]) * self._scale, (rows - self._centre[1]) * self._scale
        size = self.count + 1
        power = {}
        for i in range(5):
            for j in range(5 - i):
                power[i, j] = np.bincount(ids, weight * u**i * v**j, size)
        terms = len(_POWERS)
        self.gram = np.empty((size, terms, terms))
        for r, (a, b) in enumerate(_POWERS):
            for c, (d, e) in enumerate(_POWERS):
                self.gram[:, r, c] = power[int(a + d), int(b + e)]
        self.right = np.stack([np.bincount(ids, weight * value * u**a * v**b, size) for a, b in _POWERS], 1)

    def _find_borders(
        self, labels: NDArray[np.int32], ridge: NDArray[np.float32]
    ) -> dict[tuple[int, int], NDArray[np.float64]]:
        """Monomials and ridge strength, (n, 7), at the cracks between each pair of adjacent regions."""
        pairs, x, y, height = [], [], [], []
        for axis in (0, 1):
            first = labels[:-1] if axis == 0 else labels[:, :-1]
            second = labels[1:] if axis == 0 else labels[:, 1:]
            rows, columns = np.nonzero((first != second) & (first > 0) & (second > 0))
            pairs.append(np.stack([first[rows, columns], second[rows, columns]], 1))
            x.append(columns + (0.5 if axis else 0.0))
            y.append(rows + (0.0 if axis else 0.5))
            beyond = ridge[rows + 1 - axis, columns + axis]
            height.append(np.maximum(ridge[rows, columns], beyond))
        pair = np.sort(np.concatenate(pairs), 1).astype(np.int64)
        if not len(pair):
            return {}
        monomials = self._monomials(np.concatenate(x), np.concatenate(y))
        monomials = np.column_stack([monomials, np.concatenate(height)])
        key = pair[:, 0] * (self.count + 1) + pair[:, 1]
        order = np.argsort(key, kind="stable")
        key, monomials = key[order], monomials[order]
        starts = np.flatnonzero(np.r_[True, key[1:] != key[:-1]])
        return {
            (int(k // (self.count + 1)), int(k % (self.count + 1))): part
            for k, part in zip(key[starts], np.split(monomials, starts[1:]), strict=True)
        }

    def _fit(self, region: int) -> tuple[NDArray, NDArray]:
        """Coefficients (6,) and their covariance (6, 6) for unit noise; 0 beyond the region's degree."""
        if region not in self._fits:
            weight = self.gram[region, 0, 0]
            terms = _TERMS[int(np.searchsorted(_DEGREE_AREAS, weight))]
            gram = self.gram[region, :terms, :terms]
            inverse = np.linalg.inv(gram + _RIDGE * weight * np.eye(terms))
            coefficients, covariance = np.zeros(len(_POWERS)), np.zeros((len(_POWERS), len(_POWERS)))
            coefficients[:terms] = inverse @ self.right[region, :terms]
            covariance[:terms, :terms] = inverse
            self._fits[region] = coefficients, covariance
        return self._fits[region]

    def step(self, a: int, b: int) -> tuple[float, float]:
        """Luminance step across the common border of two regions, and its standard error, grey levels.

        The smaller of two medians along the border: the difference of the two polynomials, which long shading
        makes too large, and the height of the step's ridge, which noise makes too large.
        """
        samples = self.borders[min(a, b), max(a, b)]
        samples = samples[:: -(-len(samples) // _MAX_SAMPLES)]
        (first, covariance_a), (second, covariance_b) = self._fit(a), self._fit(b)
        ridge = samples[:, -1].copy()
        samples = samples[:, :-1]
        difference = np.abs(samples @ (first - second))
        variance = ((samples @ (covariance_a + covariance_b)) * samples).sum(1)
        middle = len(samples) // 2
        difference.partition(middle)
        variance.partition(middle)
        ridge.partition(middle)
        return float(min(difference[middle], ridge[middle])), self.noise * float(variance[middle]) ** 0.5

    def merge(self, a: int, b: int) -> int:
        """Join two adjacent regions under the smaller id, which is returned."""
        a, b = min(a, b), max(a, b)
        del self.borders[a, b]
        self.area[a] += self.area[b]
        self.gram[a] += self.gram[b]
        self.right[a] += self.right[b]
        self._fits.pop(a, None)
        self.neighbours[a].discard(b)
        self.neighbours[b].discard(a)
        for c in sorted(self.neighbours[b]):
            moved = self.borders.pop((min(b, c), max(b, c)))
            key = (min(a, c), max(a, c))
            self.borders[key] = np.concatenate([self.borders[key], moved]) if key in self.borders else moved
            self.neighbours[c].discard(b)
            self.neighbours[c].add(a)
            self.neighbours[a].add(c)
        self.neighbours[b].clear()
        return a


def merge_regions(
    labels: NDArray[np.int32],
    grey: NDArray[np.float32],
    ridge: NDArray[np.float32],
    *,
    noise: float,
    step: float,
    significance: float,
    minimum_area: int,
) -> NDArray[np.int32]:
    """Merge adjacent regions best-first while their luminance continues across the border.

    Args:
        labels: (h, w) int32 over-segmentation, 0 = none.
        grey: (h, w) luminance.
        ridge: (h, w) step strength without shading.
        noise: standard deviation of the image noise, grey levels.
        step: regions merge up to this median step along their border, grey levels ...
        significance: ... plus so many of its standard errors.
        minimum_area: smaller regions go to the neighbour with the smallest step, px.

    Returns:
        (h, w) int32 labels from 1, 0 = none.
    """
    graph = RegionGraph(labels, grey, ridge, noise)
    parent = np.arange(graph.count + 1)
    version = np.zeros(graph.count + 1, int)

    def score(a: int, b: int) -> float:
        difference, error = graph.step(a, b)
        return difference / (step + significance * error)

    heap = [(score(a, b), a, b, 0, 0) for a, b in graph.borders]
    heapq.heapify(heap)
    while heap:
        value, a, b, version_a, version_b = heapq.heappop(heap)
        if value > 1:
            break
        if version[a] != version_a or version[b] != version_b:
            continue
        kept = graph.merge(a, b)
        gone = b if kept == a else a
        parent[gone] = kept
        version[gone] = -1
        version[kept] += 1
        for c in graph.neighbours[kept]:
            heapq.heappush(heap, (score(kept, c), kept, c, version[kept], version[c]))
    _absorb_small(graph, parent, minimum_area, score)
    while (parent[parent] != parent).any():
        parent = parent[parent]
    _, dense = np.unique(parent[labels], return_inverse=True)
    return (dense.reshape(labels.shape) + (0 if (labels == 0).any() else 1)).astype(np.int32)


def _absorb_small(graph: RegionGraph, parent: NDArray, minimum_area: int, score) -> None:  # type: ignore[no-untyped-def]
    """Give regions under the minimum area to the neighbour with the smallest step, smallest region first."""
    heap = [(graph.area[i], i) for i in range(1, graph.count + 1) if parent[i] == i and graph.area[i] < minimum_area]
    heapq.heapify(heap)
    while heap:
        area, region = heapq.heappop(heap)
        if parent[region] != region or graph.area[region] != area or not graph.neighbours[region]:
            continue
        best = min(sorted(graph.neighbours[region]), key=lambda c: score(region, c))
        kept = graph.merge(region, best)
        parent[best if kept == region else region] = kept
        if graph.area[kept] < minimum_area:
            heapq.heappush(heap, (graph.area[kept], kept))
