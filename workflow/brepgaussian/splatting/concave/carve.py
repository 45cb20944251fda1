"""Open the concavities of a hull's field, level by level (a counterbore's bore lies under its first floor)."""

from brepgaussian.splatting.concave.find import find_curved, find_prisms
from brepgaussian.splatting.concave.join import joined, told_once
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.shorten import shortened
from brepgaussian.splatting.concave.sweep import straighten
from brepgaussian.splatting.concave.trim import flatten
from brepgaussian.splatting.concave.turned import turn
from brepgaussian.splatting.concave.volume import Volume

_LEVELS = 3
_MARGIN_CELLS = 2.0  # a concavity is cut this far out of its opening, so that no skin of the lid remains


def open_channels(images: Images, hull: Volume) -> tuple[Volume, list[Prism]]:
    """Cut a hull at its outer planes, and carry on all along what it leaves empty at one end or at one angle.

    Arguments and results are those of `open_concavities`.
    """
    hull, _ = flatten(images.views, hull)
    hull, channels = straighten(images, hull)
    return turn(images, hull), channels


def open_concavities(images: Images, hull: Volume) -> tuple[Volume, list[Prism]]:
    """Carve pockets and holes that views show to be open although every silhouette is blind to them.

    Args:
        images: of all views.
        hull: what silhouettes leave.

    Returns:
        The opened hull and the concavities.
    """
    known: list[Prism] = []
    scene = hull.scene()
    for _ in range(_LEVELS):
        found = told_once(find_prisms(images, scene, hull.spacing, known), known, 2 * hull.spacing)
        if not found:
            break
        # the far end of a hole may be the floor of what was found before
        before, known = known, joined([*known, *found], 2 * hull.spacing)
        fresh = [k for k, prism in enumerate(known) if k >= len(before) or prism.depth > before[k].depth]
        for k in sorted(fresh, key=lambda k: known[k].through):  # what is blind may be what a hole leads to
            margin = _MARGIN_CELLS * hull.spacing + known[k].above
            known[k] = shortened(images, hull, known[k], margin)
            hull = hull.without(known[k], margin)
        scene = hull.scene()
    for prism in find_curved(images, scene, hull.spacing, known):
        hull = hull.without(prism, _MARGIN_CELLS * hull.spacing)
        known.append(prism)
    return hull, known
