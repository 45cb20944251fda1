"""Settings of the `masks` stage. Edge maps and patch masks per view."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class MasksSettings:
    """Edge maps and patch masks per view."""

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
