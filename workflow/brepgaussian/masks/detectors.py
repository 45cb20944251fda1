"""The detectors by name: one interface for edge maps, one for patch masks."""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.truth import Truth
from brepgaussian.artifacts.views import Views
from brepgaussian.errors import InputError
from brepgaussian.masks import edges as edge_maps
from brepgaussian.masks.regions import merge_regions, oversegment
from brepgaussian.masks.steps import Crop, step_strength, without_shading
from brepgaussian.settings.masks import MasksSettings


class PatchDetector(Protocol):
    """Finds the patches of one view."""

    def patches(self, view: int, crop: Crop, edges: NDArray[np.uint8] | None) -> NDArray[np.int16]:
        """(H, W) int16 region ids, 0 = none; `edges` is the view's map where the edges come first."""
        ...


class EdgeDetector(Protocol):
    """Finds the edges of one view."""

    needs_patches: bool

    def edges(self, view: int, crop: Crop, patches: NDArray[np.int16] | None) -> NDArray[np.uint8]:
        """(H, W) uint8 edge probability; `patches` are the view's masks where the detector needs them."""
        ...


class ClassicalPatches:
    """Watershed on the step strength and best-first merging of regions."""

    def __init__(self, views: Views, settings: MasksSettings, truth: Truth | None) -> None:
        self.settings, self.shape = settings, views.alpha.shape[1:]

    def patches(self, view: int, crop: Crop, edges: NDArray[np.uint8] | None) -> NDArray[np.int16]:
        """See `PatchDetector`."""
        s = self.settings
        strength, _ = step_strength(crop.grey, crop.inside, s.radius)
        depth = max(s.minima_depth, s.minima_noise * crop.noise)
        regions = merge_regions(
            oversegment(strength, crop.inside, depth),
            crop.grey,
            without_shading(strength, s.radius),
            noise=crop.noise,
            step=s.merge_step,
            significance=s.merge_significance,
            minimum_area=s.minimum_area,
        )
        return crop.paste(regions.astype(np.int16), self.shape)


class TruthPatches:
    """Visible faces of the known model: an upper bound, for tests and comparisons."""

    def __init__(self, views: Views, settings: MasksSettings, truth: Truth | None) -> None:
        if truth is None or truth.face_ids is None:
            raise InputError(
                f"{views.object_name} has no known faces",
                fix="choose masks.patches: classical for objects without truth",
            )
        self.face_ids = truth.face_ids

    def patches(self, view: int, crop: Crop, edges: NDArray[np.uint8] | None) -> NDArray[np.int16]:
        """See `PatchDetector`."""
        return (self.face_ids[view] + 1).astype(np.int16)


def _sam(views: Views, settings: MasksSettings, truth: Truth | None) -> PatchDetector:
    from brepgaussian.masks.sam import SamPatches  # transformers is an optional extra

    return SamPatches(views, settings)


class ClassicalEdges:
    """Step strength with non-maximum suppression and hysteresis, and the silhouette."""

    needs_patches = False

    def __init__(self, views: Views, settings: MasksSettings) -> None:
        self.settings, self.shape = settings, views.alpha.shape[1:]

    def edges(self, view: int, crop: Crop, patches: NDArray[np.int16] | None) -> NDArray[np.uint8]:
        """See `EdgeDetector`."""
        s = self.settings
        return crop.paste(edge_maps.classical_edges(crop, s.radius, s.edge_step, s.edge_width), self.shape)


class RegionEdges:
    """Borders of the patch masks."""

    needs_patches = True

    def __init__(self, views: Views, settings: MasksSettings) -> None:
        self.width = settings.edge_width

    def edges(self, view: int, crop: Crop, patches: NDArray[np.int16] | None) -> NDArray[np.uint8]:
        """See `EdgeDetector`."""
        assert patches is not None
        return edge_maps.region_edges(patches, self.width)


class DatasetEdges:
    """Maps that came with the dataset, moved onto the silhouettes."""

    needs_patches = False

    def __init__(self, views: Views, settings: MasksSettings) -> None:
        if views.edge_maps is None:
            raise InputError(
                f"{views.object_name} came without edge maps", fix="choose masks.edges: classical for this object"
            )
        self.offset = edge_maps.measure_offset(views.edge_maps, views.alpha)
        self.maps = edge_maps.shift(views.edge_maps, -self.offset[0], -self.offset[1])

    def edges(self, view: int, crop: Crop, patches: NDArray[np.int16] | None) -> NDArray[np.uint8]:
        """See `EdgeDetector`."""
        return self.maps[view]


class NetworkEdges:
    """The user's own TorchScript network."""

    needs_patches = False

    def __init__(self, views: Views, settings: MasksSettings) -> None:
        self.path, self.rgb = settings.weights, views.rgb
        self.network = edge_maps.load_network(settings.weights)

    def edges(self, view: int, crop: Crop, patches: NDArray[np.int16] | None) -> NDArray[np.uint8]:
        """See `EdgeDetector`."""
        return edge_maps.network_edges(self.network, self.rgb[view], self.path)


PATCHES: dict[str, Callable[[Views, MasksSettings, Truth | None], PatchDetector]] = {
    "classical": ClassicalPatches,
    "truth": TruthPatches,
    "sam": _sam,
}
EDGES: dict[str, Callable[[Views, MasksSettings], EdgeDetector]] = {
    "classical": ClassicalEdges,
    "regions": RegionEdges,
    "dataset": DatasetEdges,
    "torchscript": NetworkEdges,
}
