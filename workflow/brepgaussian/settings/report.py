"""Settings of the `report` stage. Pages, tables, pictures."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class ReportSettings:
    """Pages, tables, pictures."""

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
