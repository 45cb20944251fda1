"""Settings of the `metrics` stage. Scores against the truth."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class MetricsSettings:
    """Scores against the truth."""

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
