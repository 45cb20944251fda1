"""The depth of an opening: that at which all views agree on its walls and its floor.

Walls and floor follow from the outline and a depth. Were the floor higher or lower than it is, one place on
it would be hit by rays that in truth meet different places, of different greys. Where all depths below the
true one explain the images equally well (all the floor has one grey), the least is right.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.splatting.concave.leaning import (
    countersunk,
    domed,
    funnels,
    has_throat,
    oblique,
    stepped,
    tapered,
    to_best_dome,
    to_best_funnel,
    to_best_sink,
    to_best_taper,
)
from brepgaussian.splatting.concave.openings import Images, Stack, rectify
from brepgaussian.splatting.concave.prism import Prism, signed_outline
from brepgaussian.splatting.concave.rays import Rays, crossings_below, gather
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.shapes import FINEST, SURE, Ends, Opening, Shape, best_depth

Array = NDArray[np.float64]

_LEAST_RAYS = 200
_SEARCH_RAYS = 40_000  # more make the search slower, not better
_DEPTHS = 36  # tried at first, from the shallowest on in equal ratios
_BREAKING = 0.5  # of the rays meet another opening below
_MOST_DEEPER = 16  # depths tried with all rays
_FINAL_RAYS = 240_000  # for a floor that few of the rays reach
_FINAL_RATIO = 1.04  # of the depths tried with them
_NEAR_RATIO = 1.02  # of the depths tried about the one that few rays tell,
_SHALLOWER, _DEEPER = -3, 18  # from how many steps above it to how many below
_TOLD_SHARE = 0.9  # of the rays through an opening leave the hull before the depth of a hole through its nearest part
_GROWS = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])  # cells by which an outline may be off
_RIM_RAYS = 60_000
_OFF_CELLS = 1.0  # by which walls are moved: the depth that was found with them has no say any more
_FEW_RAYS = 8_000  # for many shapes of leaning walls
_LEANING = 0.9  # walls lean only if that leaves at most this share of the straight ones' disagreement
_CHAMFERED = 0.97  # the same for a hole's rim alone
_DEEP = 7.0  # cells; as deep a concavity has to gain as a shallow one, twice as deep as any deep one
_SHALLOW_GAIN = 0.4  # for what is shallow: a lid that is badly placed looks like it
_CORE_CELLS = 2  # from an opening's border, clear of its blur
_REFUTED = 0.5  # share of the views that see a cell there
_MOST_AGAINST = 0.12  # of the rays, where none tells a floor: holes have up to .08, a dent in a fillet had .24
_GAIN = 0.75  # a concavity leaves at most this share of the disagreement on its lid,
# or more, where so few rays contradict it: of openings that leave .7-.85, true ones had .11-.13, false ones .18-.30
_LITTLE_GAIN, _FEW_AGAINST = 0.85, 0.15
_THROUGH_GAIN = 0.65  # the same for a hole through the part: true ones leave .11-.49, a dent in a curved wall left .80
_MOST_PAST = 0.2  # of the rays that contradict a hole through the part; true ones have up to .14, skew false ones .22


def measured(images: Images, scene: Scene, stack: Stack, outline: NDArray[np.bool_]) -> tuple[Prism, float] | None:
    """`measure`; of noisy images, smoothed ones tell best whether there is a concavity, and those as taken how deep.

    Args:
        images: of all views.
        scene: the hull.
        stack, outline: as for `measure`.
    """
    centers, taken = images.views.cameras.centers, images.as_taken
    found = measure(stack, outline, centers, scene, images.tolerance)
    if taken is images:
        return found
    exact = measure(as_taken(images, scene, stack), outline, centers, scene, taken.tolerance)
    if found is None or exact is None:
        return exact or found
    return exact[0], found[1]  # gains are in tolerances: of the same images, they are alike


def as_taken(images: Images, scene: Scene, stack: Stack) -> Stack:
    """What the views show on a lattice, with the grey levels of the images as they were taken."""
    if images.as_taken is images:
        return stack
    return replace(stack, grey=rectify(images.as_taken, scene, stack.lattice, stack.relief).grey)


def measure(
    stack: Stack,
    outline: NDArray[np.bool_],
    centers: Array,
    scene: Scene,
    tolerance: float,
    most_against: float = _MOST_AGAINST,
) -> tuple[Prism, float] | None:
    """The concavity under one opening, or None if the rays do not tell one.

    With it comes its gain: by how much less the rays disagree than on a lid, summed over cells of the lattice.

    Args:
        stack: what the views show on the opening's plane.
        outline: (R, C) cells of the opening.
        centers: (V, 3) camera centres.
        scene: the hull.
        tolerance: grey levels that one place may differ by.
        most_against: share of the rays that may contradict one whose floor none tells.
    """
    pitch = stack.lattice.pitch
    looked = looked_into(stack, outline, centers, scene)
    if looked is None:
        return None
    every, ends, breaks = looked
    opening = Opening(every, _SEARCH_RAYS, outline, ends, tolerance, breaks)
    rim = Opening(every, _RIM_RAYS, outline, ends, tolerance, breaks)
    best = _again(opening, rim, _refine(rim, best_depth(opening, _DEPTHS)))
    few = Opening(every, _FEW_RAYS, outline, ends, tolerance, breaks)
    best = _leaning(opening, rim, few, best)
    if best.domed and _is_endless(opening, best):  # that its floor is a cap isn't told either
        best = _refine(rim, best_depth(opening, _DEPTHS, replace(best, domed=False)))
    opening.keep_clear(best.grow)
    disagreeing, error = opening.score(best)
    closed = opening.closed()
    sure = best.through or _refuted(stack, outline)
    deep = 1.0 if sure else float(np.clip((best.depth - opening.face) / _DEEP - 1, 0, 1))
    little = _THROUGH_GAIN if best.through else _LITTLE_GAIN if error < _FEW_AGAINST else _GAIN
    most = _SHALLOW_GAIN + deep * (little - _SHALLOW_GAIN)
    passes = not best.through or error <= _MOST_PAST
    if not passes or disagreeing > most * closed or (not deep and best.depth < opening.shallowest + 1):
        return None
    endless = False
    if not best.through:
        endless = _is_endless(opening, best)
        if endless and error > most_against:
            return None
        best = _deepen(opening, Opening(every, _FINAL_RAYS, outline, ends, tolerance, breaks), best)
    fitted = signed_outline(outline) < best.grow
    gain = (closed - disagreeing) * float(np.count_nonzero(fitted))
    prism = Prism(
        stack.lattice,
        fitted,
        best.depth * pitch,
        best.through,
        error,
        best.tilt,
        best.draft,
        best.sink * pitch,
        endless,
        best.domed,
        step=best.step * pitch,
    )
    return prism, gain


def _is_endless(opening: Opening, best: Shape) -> bool:
    """Whether rays don't tell a blind shape from one that goes on to the hull's other side."""
    return opening.advantage(opening.costs(replace(best, depth=opening.ends[0])), opening.costs(best)) < SURE


def shoulder(
    stack: Stack, outline: NDArray[np.bool_], centers: Array, scene: Scene, tolerance: float, hollow: float
) -> float | None:
    """Depth of the floor around a narrower hole under a round opening, unit frame; None if few rays tell.

    Rays into the hole contradict a floor, and where walls and floor have one grey a deeper one loses them.

    Args:
        stack, outline, centers, scene, tolerance: as for `measure`.
        hollow: radius of the hole, cells.
    """
    looked = looked_into(stack, outline, centers, scene)
    if looked is None:
        return None
    every, ends, breaks = looked
    opening = Opening(every, _RIM_RAYS, outline, ends, tolerance, breaks)
    opening.keep_clear(0.0)
    depths = np.geomspace(opening.shallowest, max(opening.deepest, opening.shallowest), _DEPTHS)
    first = opening.simplest([Shape(float(depth), hollow=hollow) for depth in depths])
    # the shallowest that none surely betters, and about it, by all rays, the one that is best
    full = Opening(every, _FINAL_RAYS, outline, ends, tolerance, breaks)
    full.keep_clear(0.0)
    ratios = _NEAR_RATIO ** np.arange(_SHALLOWER, _DEEPER + 1.0)
    costs = [full.score(replace(first, depth=float(first.depth * ratio)))[0] for ratio in ratios]
    best = int(np.clip(np.argmin(costs), 1, len(costs) - 2))
    left, least, right = costs[best - 1 : best + 2]
    bend = left - 2 * least + right
    moved = np.clip((left - right) / (2 * bend), -1, 1) if bend > 0 else 0.0  # to the bottom of a parabola
    return float(first.depth * ratios[best] * _NEAR_RATIO**moved * stack.lattice.pitch)


def looked_into(
    stack: Stack, outline: NDArray[np.bool_], centers: Array, scene: Scene
) -> tuple[Rays, Ends, bool] | None:
    """All rays through an opening, and what `_ends` says of it; None if there is nothing to tell, or few that do."""
    ends, breaks = _ends(scene, stack, outline)
    every = gather(stack, outline, centers, scene)
    return None if len(every) < _LEAST_RAYS or not ends else (every, ends, breaks)


def _refuted(stack: Stack, outline: NDArray[np.bool_]) -> bool:
    """Whether most views show something else than the lid all over an opening: no lid that is badly placed does."""
    core = ndimage.binary_erosion(outline, iterations=_CORE_CELLS)
    return bool(core.any() and np.median(stack.against[core]) >= _REFUTED)


def _again(opening: Opening, rim: Opening, best: Shape) -> Shape:
    """The depth sought once more with the walls found: walls that are off, and blur, hide it."""
    opening.keep_clear(best.grow)
    deeper = best_depth(opening, _DEPTHS, best)
    least = SURE if abs(best.grow) < _OFF_CELLS else 0.0  # the first depth was found with walls that are wrong
    better = opening.advantage(opening.costs(best), opening.costs(deeper)) > least
    opening.keep_clear(None)
    return _refine(rim, deeper) if better else best


def _leaning(opening: Opening, rim: Opening, few: Opening, best: Shape) -> Shape:
    """The best shape, straight or not; one opening with three numbers of rays.

    What leans all the way down comes before what does at its mouth only, which has to explain the rays surely better.
    """
    tried = [tapered(few), countersunk(few, best), *([oblique(few)] if few.holed else []), *domed(few, best)]
    for shape in tried:
        if few.score(shape)[0] >= few.score(best)[0]:
            continue
        sunk = np.isfinite(shape.sink)
        if shape.domed:
            shape = to_best_dome(opening, [shape])
        else:
            shape = _refine(rim, shape if shape.through or sunk else best_depth(opening, _DEPTHS, shape))
            if sunk:
                shape = to_best_sink(opening, [shape])
            elif shape.draft and not shape.through:
                shape = to_best_taper(opening, shape)
        sure = opening.advantage(opening.costs(best), opening.costs(shape)) > SURE
        most = (_CHAMFERED if sunk else _LEANING) * opening.score(best)[0]
        if sure and opening.score(shape)[0] < most and (not sunk or has_throat(opening.outline, shape)):
            best = shape
    return _shouldered(opening, few, _funnelled(opening, few, best))


def _funnelled(opening: Opening, few: Opening, best: Shape) -> Shape:
    """A funnel in place of a shape that is not straight, if that surely explains the rays better."""
    if not (best.domed or best.draft):
        return best
    tried = [shape for shape in funnels(few, best) if few.score(shape)[0] < few.score(best)[0]]
    found = [shape for shape in (to_best_funnel(opening, [shape]) for shape in tried) if shape is not None]
    if not found:
        return best
    shape = opening.simplest(found)  # where something shows through, a hole is the simplest
    sure = opening.advantage(opening.costs(best), opening.costs(shape)) > SURE
    return shape if sure and opening.score(shape)[0] < _LEANING * opening.score(best)[0] else best


def _shouldered(opening: Opening, few: Opening, best: Shape) -> Shape:
    """A countersunk blind shape with a shoulder instead, if that surely explains the rays better."""
    if best.through or best.domed or not best.top:
        return best
    shape = stepped(opening, stepped(few, best))
    sure = shape.step and opening.advantage(opening.costs(best), opening.costs(shape)) > SURE
    less = opening.score(shape)[0] < _CHAMFERED * opening.score(best)[0]
    return shape if sure and less and has_throat(opening.outline, shape) else best


def _ends(scene: Scene, stack: Stack, outline: NDArray[np.bool_]) -> tuple[Ends, bool]:
    """Depths in cells at which a hole is through: past the nearest part of the hull below, and past all of it.

    With them, whether most of the opening lies over another one.
    """
    lattice = stack.lattice
    below = stack.surface()[outline]
    crossings, inside = crossings_below(scene, below, lattice)
    crossings += stack.relief[outline][:, None] / lattice.pitch
    if not crossings.shape[1]:
        return (), False
    breaks = bool(np.isfinite(crossings[:, 2:]).any(axis=1).mean() > _BREAKING)  # out of the hull, in again and out
    near = np.where(inside, crossings[:, 0], np.nan)
    near = near[np.isfinite(near)]
    far = float(crossings[np.isfinite(crossings)].max())
    nearest = float(np.quantile(near, _TOLD_SHARE)) + 1 if len(near) else far + 1
    return ((nearest, far + 1) if far > nearest else (far + 1,)), breaks


def _deepen(opening: Opening, full: Opening, best: Shape) -> Shape:
    """The floor's depth from all rays, where some of them do not tell how much deeper it is."""
    costs = opening.costs(best)
    count = min(int(np.log(opening.deepest / best.depth) / np.log(_FINAL_RATIO)), _MOST_DEEPER)
    deeper = [replace(best, depth=best.depth * _FINAL_RATIO**k) for k in range(1, count + 1)]
    open_ones = [shape for shape in deeper if opening.advantage(opening.costs(shape), costs) < SURE]
    if not open_ones:
        return best
    found = full.simplest([best, *open_ones])
    near = [replace(found, depth=found.depth * _FINAL_RATIO ** (k / 4)) for k in range(-4, 5)]
    return found if found is best else min(near, key=full.cost)


def _refine(rim: Opening, best: Shape) -> Shape:
    """Depth and outline in turn, in ever smaller steps."""
    step, grows = max(0.1 * best.depth, 2 * FINEST), best.grow + _GROWS
    while step > FINEST:
        best = min((replace(best, grow=float(g)) for g in grows), key=rim.rim_cost)
        if np.isfinite(best.sink):
            far = rim.deepest - best.depth  # the countersink at the far end, of the same size or none
            sinks = [max(best.sink + float(k), 0.0) for k in _GROWS / 2]
            tried = [replace(best, sink=k) for k in sinks]
            if best.through:
                tried = [replace(t, depth=rim.deepest - (t.sink if far > 0 else 0.0)) for t in tried]
            best = min(tried, key=rim.rim_cost)
        if not best.through:
            tried = [replace(best, depth=best.depth + k * step) for k in (-1, -0.5, 0, 0.5, 1)]
            best = min((t for t in tried if rim.shallowest <= t.depth <= rim.deepest), key=rim.rim_cost, default=best)
        step /= 2
    return best
