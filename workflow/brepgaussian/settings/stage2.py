"""Settings of the `stage2` stage. Patch features on frozen geometry, and mask repair."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class Stage2Settings:
    """Patch features on frozen geometry, and mask repair."""

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
