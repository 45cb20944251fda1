"""Settings of the `brep` stage. Assembly of a closed solid and its refinement."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class BrepSettings:
    """Assembly of a closed solid and its refinement."""

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
