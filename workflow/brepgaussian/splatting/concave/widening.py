"""Holes that silhouettes leave too narrow where no view sees into them, made straight.

In a bore that is long, or crossed by a slot, hardly a ray tells of the walls half-way down. What the hull has there is
what no camera could look through: not a shape that anybody made.
"""

from collections.abc import Sequence

import numpy as np

from brepgaussian import log
from brepgaussian.splatting.concave.agreement import better, disagreements
from brepgaussian.splatting.concave.columns import LEAST_PART_VOXELS, holes
from brepgaussian.splatting.concave.contours import chords_in, lost_share
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.planes import Plane, planar_regions
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.sweep import LEAST_AREA, MOST_LOST, directions
from brepgaussian.splatting.concave.volume import Volume

_GAIN = 0.7  # of the views' disagreement is left at most (.2-.68 measured, .76 where a taper went),
_FEW_RAYS = 20  # if as many tell anything
_REACH_VOXELS = 2.0  # rays on which a hole changes less than this don't judge it
_FLAT = np.radians(3.5)  # rms turn of its triangles: .5-2.8 degrees measured on faces, from 3.9 on strips of a cone

logger = log.get_logger("stage1")


def widen(images: Images, hull: Volume, faces: Sequence[Plane], known: Sequence[Prism]) -> tuple[Volume, list[Prism]]:
    """Make holes as wide all along as they are somewhere between two faces, unless rays tell otherwise.

    Args:
        images: of all views.
        hull: with all that views show to be open.
        faces: that are confirmed; holes may end in them, and in flats of the hull. Not in a strip of a cone's side:
            beside it all is empty, holes or not.
        known: concavities; holes end in the floors of blind ones, too.

    Returns:
        The hull and what was cut.
    """
    floors = [
        Plane(prism.lattice.normal, prism.lattice.offset - prism.depth)
        for prism in known
        if not (prism.through or prism.endless or prism.domed)
    ]
    mesh = hull.mesh()
    regions = planar_regions(*mesh, 2 * hull.spacing)
    flats = [r for r in regions if r.area(*mesh) >= LEAST_AREA and r.turn(*mesh) < _FLAT]
    planes = [*faces, *floors, *flats]
    scene = Scene(*mesh)
    chords = chords_in(scene, *images.contour_rays)
    done: list[Prism] = []
    opened = hull
    for normal in directions(planes):
        for cut in holes(hull, normal, planes):
            prism = cut.prisms[0]
            less = opened.without(prism, 0.0)
            new = opened.lost_in(less)
            if new < LEAST_PART_VOXELS or lost_share(chords, chords.within(prism, 0.0)) > MOST_LOST:
                continue
            said = disagreements(images, scene, hull.without(prism, 0.0).scene(), _REACH_VOXELS * hull.spacing)
            good = better(said, _GAIN, _FEW_RAYS, untold=True)
            logger.info(
                "hole along %s, %.0f voxels: views disagree by %.2f for %.2f of the hull, %d rays%s",
                np.round(normal, 2).tolist(), cut.volume, said[1], said[0], said[2], "" if good else ": not believed",
            )  # fmt: skip
            if good:
                opened = less
                done.append(prism)
    return opened, done
