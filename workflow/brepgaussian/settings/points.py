"""Settings of the `points` stage. Sampling the surfels and labelling the samples."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class PointsSettings:
    """Sampling the surfels and labelling the samples."""

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
