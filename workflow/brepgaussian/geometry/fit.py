"""Fitting of planes, cylinders, spheres, cones and tori to points with normals: the entrance.

* `fit`: least squares of one kind (closed-form start, Levenberg on signed distances).
* `fit_robust`: the same with outliers.
* `ransac`: the largest surface in points of several faces.
* `choose`: the kind by evidence.
* `refine`: least squares from a start, without normals.
"""

from brepgaussian.geometry.fit_choose import Choice, choose, data_length, description_length, misfit, plausible, price
from brepgaussian.geometry.fit_refine import PARAMETERS, abreast, distance_jacobian, moved, refine
from brepgaussian.geometry.fit_robust import fit, fit_robust, inliers, oriented, ransac, residuals
from brepgaussian.geometry.fit_start import MINIMUM, cone_about, cylinder_about, torus_about

__all__ = [
    "MINIMUM",
    "PARAMETERS",
    "Choice",
    "abreast",
    "choose",
    "cone_about",
    "cylinder_about",
    "data_length",
    "description_length",
    "distance_jacobian",
    "fit",
    "fit_robust",
    "inliers",
    "misfit",
    "moved",
    "oriented",
    "plausible",
    "price",
    "ransac",
    "refine",
    "residuals",
    "torus_about",
]
