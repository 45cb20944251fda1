"""The rim of an opening, to a fraction of a cell: where the grey of a plane ends, all views show it in one place.

What lies behind the rim moves from view to view; the step at the rim doesn't. That is measured along a section's
normals, where an outline of cells is wrong by up to two: at the ends of slots walls are seen by few views.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.splatting.concave.draw import refitted, sure_of
from brepgaussian.splatting.concave.openings import Stack
from brepgaussian.splatting.concave.sections import Section

Array = NDArray[np.float64]
Covered = Callable[[Array], NDArray[np.bool_]]

_PLACES = 96  # of a section's border
_REACH_CELLS, _STEP_CELLS = 3.0, 0.25  # how far from it, how finely
_SPAN = 4  # steps over which the slope is taken: a cell
_BLUR_CELLS = 1.25  # to both sides of the steepest: pixels and cells blur a step by that
CONTRAST = 3.0  # tolerances of grey that a step has at least,
FAINT = 1.0  # or where none has so much: between a lit floor and a hole in it
_SEEN = 0.7  # of a profile, for a view to be asked
_LEAST_VIEWS = 4  # that show a step there,
_SPREAD_CELLS = 0.4  # and their median deviation at most
_ROUNDS, _FIRM_CELLS = 6, 0.1  # of the search for the plane's height; deviations below that count the same
_TOLD = 0.6  # of the places, for the rim to say more than the cells


@dataclass(frozen=True)
class Rim:
    """Where views show the border of a `section`, `height` cells above the lattice; `told` is the share they show."""

    section: Section
    height: float
    told: float


def at_rim(section: Section, stack: Stack, centers: Array, tolerance: float) -> Section | None:
    """The section whose border is the rim that the views show, or None if theirs is another.

    If they show none, it is the section itself where that goes through its cells well enough to be no other.

    Args:
        section: fitted to cells.
        stack: what the views show on its lattice.
        centers: (V, 3) of the cameras.
        tolerance: grey levels by which views of one place may differ.
    """
    rim = rim_of(section, stack, centers, tolerance, _TOLD)
    if rim is None or rim.told < _TOLD:
        faint = rim_of(section, stack, centers, tolerance, _TOLD, contrast=FAINT)
        rim = faint if faint is not None and faint.told >= _TOLD else rim
    if rim is not None and rim.told < _TOLD:
        return rim.section if rim.section.at_rim or sure_of(rim.section) else None
    return None if rim is None else rim.section


def rim_of(
    section: Section,
    stack: Stack,
    centers: Array,
    tolerance: float,
    least: float,
    covered: Covered | None = None,
    contrast: float = CONTRAST,
) -> Rim | None:
    """The rim that the views show of a section, None if theirs is another; as it is where they show less than `least`.

    Args:
        section, stack, centers, tolerance: see `at_rim`.
        least: share of the rim that has to be shown.
        covered: which places of its border (N, 2) no view can show; pieces of the border that are shown nowhere else
            stay where they are.
        contrast: tolerances of grey that a step has at least.
    """
    height, share = 0.0, 0.0
    for _ in range(2):  # the second time along the normals of what the first found
        places = section.border(_PLACES)
        hidden = np.zeros(len(places), bool) if covered is None else covered(places)
        outward = section.gradient(places)
        steps = _steps(stack, places, outward, contrast * tolerance)
        moved, told, height = _common(steps, _leans(stack, centers, places, outward))
        told &= ~hidden
        share = float(told.sum() / max(np.count_nonzero(~hidden), 1))
        if share < least:
            break
        pieces = section.pieces(places)
        held = hidden & ~np.isin(pieces, pieces[told])
        better = refitted(np.concatenate([(places + moved[:, None] * outward)[told], places[held]]), section)
        if better is None:
            return None
        section = replace(better, at_rim=True)
    return Rim(section, height, share)


def _steps(stack: Stack, places: Array, outward: Array, contrast: float) -> Array:
    """(V, P) how far outwards of places (P, 2) each view shows the steepest step, cells; NaN where it shows none."""
    offsets = np.arange(-_REACH_CELLS, _REACH_CELLS + _STEP_CELLS / 2, _STEP_CELLS)
    profile = places[:, None] + offsets[:, None] * outward[:, None]  # (P, K, 2)
    at = profile.reshape(-1, 2).T
    middle = offsets[:-1] + _STEP_CELLS / 2
    found = np.full((len(stack.grey), len(places)), np.nan)
    for view, grey in enumerate(stack.grey):
        seen = np.isfinite(grey) & (grey >= 0)
        sure = ndimage.map_coordinates(seen.astype(float), at, order=1).reshape(profile.shape[:2]) > 1 - 1e-6
        level = ndimage.map_coordinates(np.where(seen, grey, 0), at, order=1).reshape(profile.shape[:2])
        rise = np.diff(level, axis=1) * (sure[:, 1:] & sure[:, :-1])  # (P, K - 1)
        over = ndimage.convolve1d(rise, np.ones(_SPAN), axis=1, mode="constant")
        best = np.abs(over).argmax(axis=1)
        height = np.take_along_axis(over, best[:, None], axis=1)
        near = np.abs(middle - middle[best][:, None]) <= _BLUR_CELLS
        share = np.where(near, np.maximum(rise * np.sign(height), 0), 0)  # of the step, that is up to there
        inner = np.abs(middle[best]) < _REACH_CELLS - _BLUR_CELLS / 2
        shows = (np.abs(height[:, 0]) > contrast) & inner & (sure.mean(axis=1) > _SEEN)
        found[view, shows] = (share[shows] @ middle) / share[shows].sum(axis=1)
    return found


def _leans(stack: Stack, centers: Array, places: Array, outward: Array) -> Array:
    """(V, P) how far outwards what lies above the lattice seems to move, for its height, both in cells."""
    lattice = stack.lattice
    basis = np.stack([lattice.first, lattice.second])
    xyz = lattice.origin + lattice.pitch * (places + 0.5) @ basis  # (P, 3)
    sight = centers[:, None] - xyz
    return np.asarray(-np.einsum("vpc,pc->vp", sight, outward @ basis) / (sight @ lattice.normal))


def _common(steps: Array, leans: Array) -> tuple[Array, NDArray[np.bool_], float]:
    """(P,) where steps (V, P) of all views would meet, (P,) whether enough views agree on it, and at which height.

    The plane may lie a little above or below the lattice: its height is the one at which they agree best.
    """
    shown = np.isfinite(steps)
    told = shown.sum(axis=0) >= _LEAST_VIEWS
    if not told.any():
        return np.zeros(steps.shape[1]), told, 0.0
    steps = np.where(shown & told, steps, np.nan)
    height = 0.0
    for _ in range(_ROUNDS):
        level = steps - height * leans
        middle = _median(level, told)
        off = level - middle
        weight = np.where(shown & told, 1 / np.maximum(np.abs(off), _FIRM_CELLS), 0.0)  # least absolute deviations
        lean = leans - (weight * leans).sum(axis=0) / np.maximum(weight.sum(axis=0), 1e-12)
        height += float(np.nansum(weight * lean * off) / max(float((weight * lean**2).sum()), 1e-12))
    level = steps - height * leans
    middle = _median(level, told)
    return middle, told & (_median(np.abs(level - middle), told, np.inf) <= _SPREAD_CELLS), height


def _median(values: Array, told: NDArray[np.bool_], otherwise: float = 0.0) -> Array:
    """(P,) medians over the views of (V, P), where they are told."""
    result = np.full(values.shape[1], otherwise)
    result[told] = np.nanmedian(values[:, told], axis=0)
    return result
