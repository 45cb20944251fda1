"""Holes of one pattern: round, as wide, in one face. Those whose floors no ray tells are as deep as the deepest is.

What is found of an untold floor is the least depth that explains the views, and how much of a wall they show is another
matter for each hole: four alike were .11 to .19 deep, and .2 in truth.
"""

from collections.abc import Mapping
from dataclasses import replace

from brepgaussian import log
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.planes import PARALLEL
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.sections import Rounded
from brepgaussian.splatting.concave.shapes import SURE, Shape
from brepgaussian.splatting.concave.sounded import along_walls, is_plain

_AS_WIDE_CELLS = 0.4  # by which radii of one drill differ: a rim is told to .1
_LEVEL_CELLS = 2.0  # between the planes that two mouths lie on, if they lie on one
_DEEPER_CELLS = 0.5  # less is no other depth
_RAYS = 60_000

logger = log.get_logger("stage1")


def evened(images: Images, scene: Scene, prisms: Mapping[int, Prism]) -> dict[int, Prism]:
    """Those of some holes that become deeper.

    Args:
        images: of all views.
        scene: the hull, before they are cut.
        prisms: holes by any number; what is not round, plain and blind stays.
    """
    result: dict[int, Prism] = {}
    drilled = [k for k, prism in prisms.items() if is_plain(prism) and _radius(prism) is not None]
    for k in drilled:
        deepest = max((prisms[j] for j in drilled if _alike(prisms[k], prisms[j])), key=lambda p: p.depth)
        if deepest.depth < prisms[k].depth + _DEEPER_CELLS * prisms[k].lattice.pitch:
            continue
        if not _surely_shallower(images, scene, prisms[k], deepest.depth):
            logger.info(
                "opening of area %.4f: %.4f deep as one like it, not %.4f",
                prisms[k].area, deepest.depth, prisms[k].depth,
            )  # fmt: skip
            result[k] = replace(prisms[k], depth=deepest.depth, endless=prisms[k].endless and deepest.endless)
    return result


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


def _surely_shallower(images: Images, scene: Scene, prism: Prism, depth: float) -> bool:
    """Whether views surely agree better on a hole as it is than on one of some greater depth."""
    looked = along_walls(images, scene, prism, (_RAYS,))
    if looked is None:
        return False
    pitch, (opening,) = looked
    if depth / pitch > opening.deepest:
        return True
    old, new = (opening.costs(Shape(one / pitch)) for one in (prism.depth, depth))
    return opening.advantage(new, old) >= SURE
