"""Settings of the `primitives` stage. Fitting and regularising surfaces."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class PrimitivesSettings:
    """Fitting and regularising surfaces."""

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
