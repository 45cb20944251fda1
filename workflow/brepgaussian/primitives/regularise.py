"""Snapping of the patches' surfaces to the relations that hold between them."""

from brepgaussian.artifacts.primitives import Relation
from brepgaussian.primitives.patches import Cloud, Noise, Patch
from brepgaussian.settings.primitives import PrimitivesSettings


def regularise(
    patches: list[Patch], cloud: Cloud, noise: Noise, settings: PrimitivesSettings
) -> tuple[list[Patch], tuple[Relation, ...]]:
    """No relation is sought yet: the patches as they are."""
    return patches, ()
