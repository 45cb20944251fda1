"""Whether a concavity that was found is believed: what rays into it say, and how views like the hull without it."""

import numpy as np

from brepgaussian import log
from brepgaussian.splatting.concave.agreement import better, disagreements, one_surface
from brepgaussian.splatting.concave.drilled import MOST_AGAINST, is_narrow
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume

_GAIN = 0.9  # of the views' disagreement is left at most by an opening in a curved face
_LEAST_RAYS = 100  # that tell, for them to judge
_FEW_RAYS = 30  # that refuse what they like much less
_REFUTED = 1.0  # tolerances by which views differ about a surface that is none (openings that are true: up to .92),
_SURE = 2.0  # and standard errors more, of rays that err by a tolerance each
_LOSS = 1.2  # times the views' disagreement left by a hole that is none (in a ring 1.4-1.8, in bores .35-.8),
_LOSS_OF_FEW = 2.0  # where few rays tell
_CHANGED_VOXELS = 0.5  # by as much a ray ends elsewhere in such a hole
_WALLED = 0.45  # of rays agree about what a hole would come out in: at true ends up to .26, at a slot's floor .65
_MOST_MET = 0.16  # of the rays contradict a deep blind opening with nothing in it: true ones have up to .07, more
# where bosses stand in them; a strip that lay below its fillet had .18
_DEEP_CELLS = 14  # of shallower ones, rays that hit the blur of a rim count for more: up to .17

logger = log.get_logger("stage1")


def contradicted(prism: Prism) -> bool:
    """Whether too many rays contradict a blind opening for there to be one."""
    deep = prism.depth > _DEEP_CELLS * prism.lattice.pitch
    by_rim = prism.section is not None and prism.section.at_rim and is_narrow(prism.outline)
    most = MOST_AGAINST if by_rim else _MOST_MET
    wrong = deep and not (prism.through or prism.islands) and prism.error > most
    if wrong:
        logger.info("opening of area %.4f: %.0f %% of rays contradict it, not believed", prism.area, 100 * prism.error)
    return wrong


def disliked(images: Images, hull: Volume, opened: Volume, prism: Prism) -> bool:
    """Whether views agree less about a hull that a concavity was cut into, where that has changed it.

    The round side of a ring looks like the face around a countersunk hole, which silhouettes see through, the gaps
    between the spokes of a wheel like a bowl, and in a bore's wall a keyway that shows through like a hole.
    """
    old, new, count = disagreements(images, hull.scene(), opened.scene(), _CHANGED_VOXELS * hull.spacing)
    worse = count >= _FEW_RAYS and new > (_LOSS if count >= _LEAST_RAYS else _LOSS_OF_FEW) * old
    if worse:
        logger.info(
            "opening of area %.4f: views disagree by %.2f for %.2f of the hull, %d rays: not believed",
            prism.area, new, old, count,
        )  # fmt: skip
    return worse


def walled(images: Images, hull: Volume, opened: Volume, prism: Prism) -> bool:
    """Whether views see that what a hole would come out in is closed there: a slot's floor may be seen by all."""
    closed = one_surface(images, hull.scene(), opened.scene(), _CHANGED_VOXELS * hull.spacing)
    if closed > _WALLED:
        logger.info(
            "opening of area %.4f: %.0f %% of rays agree about what is there: not believed", prism.area, 100 * closed
        )
    return closed > _WALLED


def agreeable(
    images: Images, before: Scene, after: Scene, prism: Prism, reach: float, floor_told: bool = False
) -> bool:
    """Whether views agree better where an opening has changed the hull, as far as they tell.

    In a bore, what shows through its far mouth passes for a hole in its wall. Against a floor that was told, the few
    rays that tell anything may not disagree more; else not so much more that they refute what was opened, too.
    """
    old, new, count = said = disagreements(images, before, after, reach)
    refuted = new > _REFUTED + _SURE / np.sqrt(max(count, 1))
    untold = new <= old or not (floor_told or refuted)
    good = better(said, _GAIN, _LEAST_RAYS, untold)
    logger.info(
        "opening of area %.4f, as far as told: views disagree by %.2f for %.2f of the hull, %d rays%s",
        prism.area, new, old, count, "" if good else ": not believed",
    )  # fmt: skip
    return good
