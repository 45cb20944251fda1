"""Settings of the `stage1` stage. Hull initialisation and 2D Gaussian Splatting with the edge scalar."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class Stage1Settings:
    """Hull initialisation and 2D Gaussian Splatting with the edge scalar."""

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
