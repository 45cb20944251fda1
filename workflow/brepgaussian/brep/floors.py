"""Floors of bores that end where no view looks: the wall's points stop, and nothing else is there.

Deep narrow holes show their walls' upper part at best. Without a floor nothing closes them, and the cut fills them.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.patches import Patch, guessed
from brepgaussian.geometry.surfaces import Surface, plane

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_NEAR_END = 4.0  # reaches from a wall's end within which its open border lies,
_MOSTLY = 0.8  # most of it
_HALF_TURN = np.pi  # the widest gap around the axis that the border may have
_BESIDE = 3.0  # reaches from its wall that the open border lies where a bore comes out
_LEAST = 6  # points of such a border
_BORDER = 0.15  # quantile of the border's distances from the end: beyond are stray points
_ROUND = 40  # points that stand for the floor's rim


def floors_of_bores(patches: Sequence[Patch], borders: Sequence[Indices]) -> list[Patch]:
    """A plane across every bore that is open at one end all around.

    Args:
        patches: with their points.
        borders: of each, the indices of its points on an open border.
    """
    opened = [p.xyz[b] for p, b in zip(patches, borders, strict=True)]
    found = [
        _floor(patch, border, np.concatenate([*opened[:i], *opened[i + 1 :], np.zeros((0, 3))]))
        for i, (patch, border) in enumerate(zip(patches, borders, strict=True))
        if len(border)
    ]
    return [floor for floor in found if floor is not None]


def _floor(patch: Patch, border: Indices, elsewhere: Array) -> Patch | None:
    """The floor of a bore, or None if the patch is no bore that ends so, or goes on to an open border `elsewhere`."""
    bore = patch.surface
    if bore.kind != "cylinder" or not bore.flipped:
        return None
    height = (patch.xyz - bore.origin) @ bore.axis
    up = 1.0 if np.median(height[border]) < np.median(height) else -1.0  # from the floor to the mouth
    height = up * height
    over_end = height[border] - height.min()
    if np.mean(over_end <= _NEAR_END * patch.reach) < _MOSTLY:
        return None
    beyond = up * ((elsewhere - bore.origin) @ bore.axis) < height.min() - patch.reach
    on_wall = np.abs(bore.signed_distance(elsewhere)) < _BESIDE * patch.reach
    if not _all_around(bore, patch.xyz[border]) or _all_around(bore, elsewhere[beyond & on_wall]):
        return None
    x, y, _ = bore.frame()
    middle = bore.origin + up * float(np.quantile(height[border], _BORDER)) * bore.axis
    turn = np.linspace(0, 2 * np.pi, _ROUND, endpoint=False)
    rim = middle + bore.radius * (np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * y)
    return guessed(plane(middle, up * bore.axis), rim, patch.reach)


def _all_around(bore: Surface, places: Array) -> bool:
    """Whether places (N, 3) lie on more than half a turn about a bore's axis."""
    if len(places) < _LEAST:
        return False
    x, y, _ = bore.frame()
    angle = np.sort(np.arctan2((places - bore.origin) @ y, (places - bore.origin) @ x))
    return float(np.diff(np.append(angle, angle[0] + 2 * np.pi)).max()) <= _HALF_TURN
