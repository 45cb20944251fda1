"""Settings of the `metrics` stage. Scores against the truth."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class MetricsSettings:
    """Scores against the truth."""

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
    samples: int = setting(
        20_000, "Points sampled on the solid, uniform by area (as many as the truth has).", unit="points", minimum=100
    )
    deflection: float = setting(
        5e-5,
        "Largest distance between the solid and its triangulation; the floor of the exact distances.",
        unit="unit frame",
        minimum=1e-6,
        maximum=1e-2,
    )
    volume_grid: int = setting(
        64, "Samples per axis for the volume's intersection over union.", unit="samples", minimum=8, maximum=512
    )
