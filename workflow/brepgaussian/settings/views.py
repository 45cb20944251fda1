"""Settings of the `views` stage. Sources of objects, rendering, truth."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class ViewsSettings:
    """Sources of objects, rendering, truth."""

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
