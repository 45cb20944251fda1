"""How many independent observations the points of a patch make: fewer than points where errors are smooth.

The errors of surfels are smooth, and a patch of a thousand points tells little more than twenty; those of a scanner are
every point's own. The correlation of neighbours' errors tells which.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.geometry.surfaces import Surface

Array = NDArray[np.float64]

SLOW = 0.2  # of the errors' variance that is common to neighbours where errors are slow: points of surfels have more
BESIDE = 10  # neighbours of a point
EXACT = 5e-5  # unit frame: errors this small are rounding, not those of a reconstruction, and have nothing in common


def shared_errors(surface: Surface, points: Array, cut: float) -> tuple[float, int]:
    """Correlation of neighbours' distances from a surface, and the number of points (N, 3) within `cut` of it."""
    error = surface.signed_distance(points)
    near = np.abs(error) < max(cut, EXACT)
    error = error[near]
    if len(error) <= BESIDE:
        return 1.0, len(error)
    if np.sqrt(np.mean(error**2)) < EXACT:
        return 0.0, len(error)
    # neighbours along the surface: nearest points in space are the nearer the more alike their errors are
    foot = surface.project(points[near])
    beside = cKDTree(foot).query(foot, BESIDE + 1)[1][:, 1:]
    return float(np.mean(error[:, None] * error[beside]) / np.mean(error**2)), len(error)


def own_share(shared: float, points: int) -> float:
    """Share of the errors that is every point's own, 0..1, for their correlation: not more than chance leaves sure."""
    return 1 - float(np.clip((shared + _chance(points)) / SLOW, 0.0, 1.0))


def own_among(own: float, shared: float, points: int) -> float:
    """Share of one patch's own errors in a cloud that has `own`: less only if the patch's correlation shows it surely.

    Few points tell little of their correlation, and the cloud's other patches tell more.
    """
    return min(own, 1 - float(np.clip((shared - _chance(points)) / SLOW, 0.0, 1.0)))


def _chance(points: int) -> float:
    """Standard deviation of the correlation of independent errors."""
    return float(1 / np.sqrt(BESIDE * max(points, 1)))


def observations(points: int, own: float, least: int) -> float:
    """Number of independent observations; errors that neighbours share count as `least` of them."""
    least = max(min(points, least), 1)
    return 1 / ((1 - own) / least + own / max(points, 1))
