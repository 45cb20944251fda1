"""How deep holes are whose floors no ray surely tells; those of one pattern (round, as wide, in one face) alike.

What is found of an untold floor is the least depth that explains the views, and how much of a wall they show is another
matter for each hole: four alike were .11 to .19 deep, and .2 in truth. So they are as deep as the deepest, and, where
rays tell of something deeper, though not surely, as they all together make likeliest.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from brepgaussian import log
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.planes import PARALLEL
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.sections import Rounded
from brepgaussian.splatting.concave.shapes import SURE, Opening, Shape
from brepgaussian.splatting.concave.sounded import along_walls, is_plain

_AS_WIDE_CELLS = 0.4  # by which radii of one drill differ: a rim is told to .1
_LEVEL_CELLS = 2.0  # between the planes that two mouths lie on, if they lie on one
_DEEPER_CELLS = 0.5  # less is no other depth
_LIKELY = 2.0  # standard errors by which a depth explains the rays better: floors that views tell have `SURE`
_ABOUT_AS_LIKELY = 0.5  # standard errors: on walls of one grey, rays that contradict deeper floors are lost
_RATIO = 1.04  # of the depths that are tried
_RAYS = 60_000

logger = log.get_logger("stage1")

Looked = tuple[float, Sequence[Opening]]  # see `along_walls`


def evened(images: Images, scene: Scene, prisms: Mapping[int, Prism]) -> dict[int, Prism]:
    """Those of some concavities that become deeper.

    Args:
        images: of all views.
        scene: the hull, before they are cut.
        prisms: concavities by any number; what is not plain and blind, with drawn walls, stays.
    """
    plain = [k for k, prism in prisms.items() if is_plain(prism) and prism.section is not None]

    @cache
    def looked(k: int) -> Looked | None:
        return along_walls(images, scene, prisms[k], (_RAYS,))

    @cache  # of each pattern once
    def depth_of(alike: tuple[int, ...]) -> tuple[float, bool]:
        """How deep some holes of one pattern are, and whether that is told."""
        deepest = max((prisms[j] for j in alike), key=lambda p: p.depth)
        if not deepest.endless:
            return deepest.depth, True
        seen = [looked(j) for j in alike if prisms[j].endless]
        return _likeliest([some for some in seen if some is not None], deepest.depth), False

    result: dict[int, Prism] = {}
    for k in plain:
        alike = tuple(j for j in plain if j == k or _alike(prisms[k], prisms[j]))
        depth, told = depth_of(alike)
        if depth < prisms[k].depth + _DEEPER_CELLS * prisms[k].lattice.pitch:
            continue
        if not _surely_shallower(looked(k), prisms[k].depth, depth):
            why = "as one like it" if any(prisms[j].depth == depth for j in alike) else "more likely"
            logger.info("opening of area %.4f: %.4f deep %s, not %.4f", prisms[k].area, depth, why, prisms[k].depth)
            shown = 0.0 if told else prisms[k].least_depth
            result[k] = replace(prisms[k], depth=depth, endless=prisms[k].endless and not told, shown=shown)
    return result


def _likeliest(looked: Sequence[Looked], least: float) -> float:
    """The least depth (unit frame) of those that rays make likeliest, or the `least` of all if they tell of none.

    Each hole's advantage over the least depth is in standard errors, so their sum is in roots of their number.
    """
    if not looked:
        return least
    deepest = min(pitch * opening.deepest for pitch, (opening,) in looked) / _RATIO
    depths = least * _RATIO ** np.arange(max(int(np.log(deepest / least) / np.log(_RATIO)), 0) + 1)
    sums = np.zeros(len(depths))
    for pitch, (opening,) in looked:
        old = opening.costs(Shape(least / pitch))
        sums += [opening.advantage(old, opening.costs(Shape(float(depth) / pitch))) for depth in depths]
    sums /= np.sqrt(len(looked))
    best = int(np.argmax(sums >= sums.max() - _ABOUT_AS_LIKELY))
    return float(depths[best]) if sums[best] >= _LIKELY else least


def _radius(prism: Prism) -> float | None:
    """Of a round section, cells."""
    shape = None if prism.section is None else prism.section.shape
    return shape.radius if isinstance(shape, Rounded) and max(shape.half) <= shape.radius else None


def _alike(one: Prism, other: Prism) -> bool:
    """Whether two round holes are as wide, and their mouths in one plane."""
    mine, its = _radius(one), _radius(other)
    if mine is None or its is None or float(one.lattice.normal @ other.lattice.normal) < PARALLEL:
        return False
    pitch = one.lattice.pitch
    apart = abs(float((one.lattice.origin - other.lattice.origin) @ one.lattice.normal))
    return abs(mine * pitch - its * other.lattice.pitch) < _AS_WIDE_CELLS * pitch and apart < _LEVEL_CELLS * pitch


def _surely_shallower(looked: Looked | None, depth: float, deeper: float) -> bool:
    """Whether views surely agree better on a hole of one depth than on a deeper one."""
    if looked is None:
        return False
    pitch, (opening,) = looked
    if deeper / pitch > opening.deepest:
        return True
    old, new = (opening.costs(Shape(one / pitch)) for one in (depth, deeper))
    return opening.advantage(new, old) >= SURE
