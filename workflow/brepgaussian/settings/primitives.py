"""Settings of the `primitives` stage. Fitting and regularising surfaces."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class PrimitivesSettings:
    """Fitting and regularising surfaces.

    Tolerances are multiples of the noise that the stage measures on the points themselves.
    """

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
    kinds: tuple[str, ...] = setting(
        ("plane", "cylinder", "sphere", "cone", "torus"), "Kinds of surfaces tried; the paper fits the first two."
    )
    neighbours: int = setting(10, "Nearest points that make two patches adjacent.", minimum=3, maximum=64)
    sample: int = setting(600, "Most points of a patch that a fit looks at.", unit="points", minimum=100)
    smallest: int = setting(6, "Labels with fewer points give no primitive.", unit="points", minimum=3)
    sigma_floor: float = setting(
        0.0005, "Noise of the points is never taken as smaller.", unit="unit frame", minimum=0.0
    )
    sigma_ceiling: float = setting(
        0.01, "Noise of the points is never taken as larger.", unit="unit frame", minimum=0.0
    )
    inlier_sigmas: float = setting(3.5, "Distance at which a point stops supporting its primitive.", unit="sigma")
    largest_radius: float = setting(
        1.5, "Surfaces with larger radii are not believed.", unit="longest side of the object", minimum=0.1
    )
    split: bool = setting(True, "Split labels that hold two faces.")
    absorb: bool = setting(True, "Drop small patches that their neighbours' surfaces explain: rounded-off edges.")
    guide: bool = setting(True, "Try surfaces along the directions and axes of well-known neighbours.")
    merge: bool = setting(True, "Merge labels that are one face.")
    regularise: bool = setting(True, "Snap to parallel, perpendicular, coaxial, tangent, equal and coplanar.")
    significance: float = setting(
        3.0, "A relation is dropped when the points speak against it by more.", unit="sigma", minimum=0.5
    )
    angle_cap_deg: float = setting(
        6.0, "Directions further apart are never made parallel or perpendicular.", unit="deg", maximum=20.0
    )
    angle_floor_deg: float = setting(1.5, "Directions closer than this may always be snapped.", unit="deg", minimum=0.0)
