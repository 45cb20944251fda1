"""Depths once more, along walls that are drawn: where these are a cell off, rays meet them and the floor elsewhere.

Cells are half as large as the ones in which an opening is found, as is the error of its outline.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian import log
from brepgaussian.splatting.concave.depth import looked_into
from brepgaussian.splatting.concave.drilled import is_narrow
from brepgaussian.splatting.concave.openings import Images, rectify
from brepgaussian.splatting.concave.prism import Lattice, Prism
from brepgaussian.splatting.concave.rays import Rays, exits
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.shapes import SURE, Opening, Shape
from brepgaussian.splatting.concave.shoulders import is_round

Array = NDArray[np.float64]

_FINER = 2  # cells for one
_NEAR_CELLS = 3.0  # by which a floor is moved where views agree better; farther only where they surely do
_AROUND_CELLS = 6  # of the face around the opening
_BLUR_CELLS = 1.0  # around what stands on a floor
_FEW_RAYS, _RAYS, _FINAL_RAYS = 8_000, 60_000, 240_000
_NARROWER = np.linspace(0.35, 0.8, 10)  # of its radius, that a hole may go on with below a shoulder,
_NEAR_SHARES = np.linspace(-0.05, 0.05, 5)  # about the best of these
_STEPS = np.linspace(0.7, 1.1, 9)  # of the depth of a flat floor, that this may have,
_DEEPER = 2.0  # times that depth, at least, it goes on to
_LESS = 0.9  # of the disagreement on a flat floor is left at most
_RATIO = 1.06  # of the depths that are tried,
_NEAR_RATIO, _NEAR = 1.01, 9  # of those about the best one, and how many to both sides

logger = log.get_logger("stage1")


def sounded(images: Images, scene: Scene, prism: Prism) -> Prism:
    """A blind concavity with a flat floor and drawn walls, as deep as views agree best along these, or with a shoulder.

    Args:
        images: of all views.
        scene: the hull, before it is cut.
        prism: anything else stays as it is, and what is so narrow that its depth was found in such cells. What stands
            on its floor keeps its top where it is.
    """
    bare = replace(prism, islands=())
    if bare.section is None or not is_plain(bare) or is_narrow(bare.outline):
        return prism
    looked = along_walls(images, scene, prism, (_FEW_RAYS, _RAYS, _FINAL_RAYS))
    if looked is None:
        return prism
    pitch, (few, opening, full) = looked
    depths = opening.deepest / _RATIO ** np.arange(np.log(opening.deepest / opening.shallowest) // np.log(_RATIO))
    shapes = [Shape(float(depth)) for depth in depths[::-1]]
    costs = {shape: opening.costs(shape) for shape in shapes}
    sure = opening.simplest(shapes, costs)
    likely = [s for s in shapes if opening.advantage(costs[sure], costs[s]) >= 0]
    best = min(likely, key=lambda shape: opening.score(shape)[0])
    old = Shape(prism.depth / pitch)
    narrower = None if prism.islands else _narrower(few, opening, old, best)
    if narrower is not None:
        depth, step, sink = narrower.depth * pitch, narrower.step * pitch, narrower.sink * pitch
        logger.info(
            "opening of area %.4f: shoulder %.4f deep and %.4f wide, no floor %.4f deep",
            prism.area, step, sink, prism.depth,
        )  # fmt: skip
        return replace(prism, depth=depth, step=step, sink=sink, endless=True)
    near = best.depth * _NEAR_RATIO ** np.arange(-_NEAR, _NEAR + 1.0)
    best = min((Shape(float(d)) for d in near if d <= opening.deepest), key=lambda shape: full.score(shape)[0])
    told = full.advantage(full.costs(shapes[-1]), full.costs(best)) >= SURE
    far = abs(best.depth - old.depth) > _NEAR_CELLS
    if far and full.advantage(full.costs(old), full.costs(best)) <= SURE:
        return prism
    depth = best.depth * pitch
    logger.info(
        "opening of area %.4f: along its walls %.4f deep, not %.4f%s",
        prism.area, depth, prism.depth, "" if told or not prism.endless else ": not told",
    )  # fmt: skip
    if prism.endless and not told:
        return prism
    islands = (replace(island, depth=island.depth + depth - prism.depth) for island in prism.islands)
    return replace(prism, depth=depth, endless=False, islands=tuple(i for i in islands if i.depth > 0))


def _narrower(few: Opening, opening: Opening, old: Shape, best: Shape) -> Shape | None:
    """A round hole that goes on narrower below about its `old` floor, where that surely explains the rays better.

    Few rays meet the shoulder that is left of a floor, and those that look past it contradict it; one opening with two
    numbers of rays. It has to beat the `best` flat floor, too.
    """
    if not is_round(opening.outline):
        return None
    radius, deeper = opening.middle[1], Shape(max(best.depth, _DEEPER * old.depth))
    if deeper.depth > opening.deepest:
        return None
    tried = [
        replace(deeper, step=float(step * old.depth), sink=float(radius * (1 - share)))
        for share in _NARROWER
        for step in _STEPS
        if step * old.depth >= opening.shallowest
    ]
    found = min(tried, key=lambda shape: few.score(shape)[0], default=None)
    if found is None:
        return None
    near = found.sink + radius * _NEAR_SHARES
    found = min((replace(found, sink=float(sink)) for sink in near), key=lambda shape: opening.score(shape)[0])
    costs = opening.costs(found)
    beaten = (opening.advantage(opening.costs(flat), costs) >= SURE for flat in (old, best))
    less = opening.score(found)[0] < _LESS * min(opening.score(flat)[0] for flat in (old, best))
    return found if less and all(beaten) else None


def is_plain(prism: Prism) -> bool:
    """Whether a concavity is blind, with straight upright walls and a flat floor on which nothing stands."""
    leaning = prism.draft or prism.above or any(prism.tilt)
    return not (prism.through or prism.domed or prism.step or leaning or prism.islands or prism.ring)


def along_walls(
    images: Images, scene: Scene, prism: Prism, counts: Sequence[int]
) -> tuple[float, list[Opening]] | None:
    """The side of finer cells, unit frame, and an opening in them along drawn walls for each number of rays.

    Rays at the rim count in none of them, nor do those that meet what stands in it; None where few rays look in.
    """
    taken = images.as_taken
    fine, places, inside = finer(prism)
    looked = looked_into(rectify(taken, scene, fine), inside, taken.views.cameras.centers, scene)
    if looked is None:
        return None
    every, ends, breaks = looked
    every = _past_islands(every, prism, fine, places, inside, max(ends))
    if not len(every):
        return None
    found = [Opening(every, count, inside, ends, taken.tolerance, breaks) for count in counts]
    for opening in found:
        opening.keep_clear(0.0)
    return fine.pitch, found


def _past_islands(
    rays: Rays, prism: Prism, fine: Lattice, places: Array, inside: NDArray[np.bool_], deepest: float
) -> Rays:
    """The rays into an opening that meet nothing which stands in it.

    Args:
        rays: in cells of the finer lattice.
        prism: the opening.
        fine, places, inside: see `finer`.
        deepest: of floors that are tried, cells.
    """
    if not prism.islands:
        return rays
    wall, past = exits(rays, inside, deepest), np.ones(len(rays), bool)
    for island in prism.islands:
        top = (prism.depth - island.depth) / fine.pitch
        free = island.lateral(places.reshape(-1, 2)).reshape(inside.shape) > _BLUR_CELLS * prism.lattice.pitch
        met = exits(replace(rays, entry=np.full(len(rays), top)), free, deepest)
        past &= (met >= wall) | (wall <= top)
    return rays.chosen(past)


def finer(prism: Prism) -> tuple[Lattice, Array, NDArray[np.bool_]]:
    """A finer lattice around an opening, its cells (R, C, 2) in those of the prism's, and which are in the section."""
    used = np.argwhere(prism.outline)
    low, high = used.min(axis=0) - _AROUND_CELLS, used.max(axis=0) + 1 + _AROUND_CELLS
    fine, places = prism.lattice.finer(low, high, _FINER)
    assert prism.section is not None
    return fine, places, prism.section.signed_distance(places) < 0
