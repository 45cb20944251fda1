"""What every source of objects gives, and the even subset of views."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.truth import Truth
from brepgaussian.artifacts.views import Views


@dataclass(frozen=True)
class Loaded:
    """One object: its views, and its truth where it is known and was asked for."""

    views: Views
    truth: Truth | None


def chosen_views(total: int, wanted: int) -> NDArray[np.int64]:
    """Indices of `wanted` of `total` views, evenly spread and always the same; all for 0 or too many."""
    if wanted <= 0 or wanted >= total:
        return np.arange(total)
    return np.floor((np.arange(wanted) + 0.5) * total / wanted).astype(np.int64)


def subset(views: Views, keep: NDArray[np.integer]) -> Views:
    """Some of the views."""
    cameras = replace(
        views.cameras, intrinsics=views.cameras.intrinsics[keep], cam_from_unit=views.cameras.cam_from_unit[keep]
    )
    return replace(
        views,
        names=tuple(views.names[i] for i in keep),
        rgb=views.rgb[keep],
        alpha=views.alpha[keep],
        cameras=cameras,
        edge_maps=None if views.edge_maps is None else views.edge_maps[keep],
    )
