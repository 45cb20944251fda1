"""Exact parameters from the images: with the topology known, all surfaces are refined together.

Sub-pixel silhouettes and luminance steps in all views are a hundred times more precise than points. The
same measurements give the truth-free acceptance test (`acceptance`), which judges a solid by the images.
"""

from brepgaussian.brep.refine.accept import Acceptance, acceptance
from brepgaussian.brep.refine.mesh import FaceMesh, from_solid
from brepgaussian.brep.refine.refinement import RefineResult, refine

__all__ = ["Acceptance", "FaceMesh", "RefineResult", "acceptance", "from_solid", "refine"]
