"""`views.h5`: calibrated images of one object in the unit frame."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.base import Provenance, create_h5, open_h5, put, require_finite, strings
from brepgaussian.geometry.cameras import Cameras

KIND = "views"
OPAQUE, CLEAR = 250, 5  # alpha levels of surely object and surely background
_LUMINANCE = np.array([0.299, 0.587, 0.114], np.float32)  # Rec. 601


@dataclass(frozen=True)
class Views:
    """Images, silhouettes and cameras of one object.

    Attributes:
        object_name: the object's name in `config/objects.tsv`.
        names: file names of the images, one a view.
        rgb: (V, H, W, 3) uint8, straight (not premultiplied) colour; 0 where alpha is 0. Noisy images are smoothed.
        alpha: (V, H, W) uint8, the silhouette with antialiased borders.
        cameras: intrinsics and `cam_from_unit` poses.
        world_from_unit: (4, 4) float64 similarity from the unit frame to the user's world frame.
        unit: the world's unit of length: `mm`, `m` or `arbitrary`.
        edge_maps: (V, H, W) uint8 edge maps that came with a dataset, or None.
        taken: (V, H, W, 3) uint8 the images before they were smoothed, None if they were not.
    """

    object_name: str
    names: tuple[str, ...]
    rgb: NDArray[np.uint8]
    alpha: NDArray[np.uint8]
    cameras: Cameras
    world_from_unit: NDArray[np.float64]
    unit: str = "arbitrary"
    edge_maps: NDArray[np.uint8] | None = None
    taken: NDArray[np.uint8] | None = None

    @property
    def as_taken(self) -> "Views":
        """With the images before they were smoothed: means over many pixels are right there."""
        return self if self.taken is None else replace(self, rgb=self.taken, taken=None)

    @property
    def luminance(self) -> NDArray[np.float32]:
        """(V, H, W) float32 grey levels 0..255 (Rec. 601 weights; equal to R on grey images)."""
        return np.stack([self.grey(view) for view in range(len(self.rgb))])

    def grey(self, view: int) -> NDArray[np.float32]:
        """(H, W) float32 grey levels of one view: a float copy of all colours would take half a gigabyte."""
        return np.asarray(self.rgb[view].astype(np.float32) @ _LUMINANCE, np.float32)

    def write(self, path: str | Path, provenance: Provenance) -> None:
        """Write `views.h5`."""
        with create_h5(path, KIND, provenance) as file:
            file.attrs["object"] = self.object_name
            file.attrs["length_unit"] = self.unit
            file.attrs["camera_axes"] = "OpenCV: x right, y down, z forward; pixel centres at integer + 0.5"
            put(file, "names", self.names, axes="view")
            put(file, "rgb", self.rgb, axes="view,row,column,channel", unit="grey level 0..255")
            put(file, "alpha", self.alpha, axes="view,row,column", unit="coverage 0..255")
            put(file, "intrinsics", self.cameras.intrinsics, axes="view,(fx fy cx cy)", unit="px")
            put(file, "cam_from_unit", self.cameras.cam_from_unit, axes="view,4,4", unit="unit frame")
            put(file, "world_from_unit", self.world_from_unit, axes="4,4", unit=self.unit)
            if self.edge_maps is not None:
                put(file, "edge_maps", self.edge_maps, axes="view,row,column", unit="0..255")
            if self.taken is not None:
                put(file, "rgb_as_taken", self.taken, axes="view,row,column,channel", unit="grey level 0..255")


def read_views(path: str | Path) -> Views:
    """Read `views.h5`.

    Raises:
        ArtifactError: the file is missing, damaged or of another version.
    """
    with open_h5(path, KIND) as file:
        alpha = file["alpha"][...]
        cameras = Cameras(
            intrinsics=file["intrinsics"][...],
            cam_from_unit=file["cam_from_unit"][...],
            width=alpha.shape[2],
            height=alpha.shape[1],
        )
        require_finite(cameras.cam_from_unit, "cam_from_unit", path)
        return Views(
            object_name=str(file.attrs["object"]),
            names=strings(file["names"]),
            rgb=file["rgb"][...],
            alpha=alpha,
            cameras=cameras,
            world_from_unit=file["world_from_unit"][...],
            unit=str(file.attrs["length_unit"]),
            edge_maps=file["edge_maps"][...] if "edge_maps" in file else None,
            taken=file["rgb_as_taken"][...] if "rgb_as_taken" in file else None,
        )
