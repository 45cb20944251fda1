"""Concavities that silhouettes cannot show: pockets, blind holes, counterbores, holes of any depth.

A visual hull closes a pocket with a lid. Radiance is fixed on the surface, so a flat lid has one grey in
every view; where views disagree with it, there is no lid. The rays through such an opening then tell its
depth: a ray that leaves the opening's outline sideways before it reaches the floor shows a wall, the others
show the floor. See `docs/splatting.md`.
"""

from brepgaussian.splatting.concave.agreement import preferred
from brepgaussian.splatting.concave.alike import open_alike
from brepgaussian.splatting.concave.bends import Bend
from brepgaussian.splatting.concave.carve import open_channels, open_concavities, open_curved, open_onward
from brepgaussian.splatting.concave.corners import open_corners
from brepgaussian.splatting.concave.feet import open_feet
from brepgaussian.splatting.concave.find import find_prisms
from brepgaussian.splatting.concave.fins import without_fins
from brepgaussian.splatting.concave.grooves import open_grooves
from brepgaussian.splatting.concave.levels import open_levels
from brepgaussian.splatting.concave.notches import open_notches
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.planes import Plane
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.recess import open_recesses
from brepgaussian.splatting.concave.refill import refilled
from brepgaussian.splatting.concave.skins import without_skins
from brepgaussian.splatting.concave.widening import widen

__all__ = [
    "Bend",
    "Images",
    "Plane",
    "Prism",
    "find_prisms",
    "open_alike",
    "open_channels",
    "open_concavities",
    "open_corners",
    "open_curved",
    "open_feet",
    "open_grooves",
    "open_levels",
    "open_notches",
    "open_onward",
    "open_recesses",
    "preferred",
    "refilled",
    "widen",
    "without_fins",
    "without_skins",
]
