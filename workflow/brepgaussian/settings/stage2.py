"""Settings of the `stage2` stage. Patch features on frozen geometry, and mask repair."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class Stage2Settings:
    """Patch features on frozen geometry, and mask repair."""

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
    repair: bool = setting(
        True,
        "Repair the patch masks over all views before features learn from them (in place of the paper's correction by "
        "hand); false = masks as detected.",
    )
    loss: str = setting(
        "triplet",
        "triplet: hardest negatives with a margin (paper, L_tri). pairwise: the ablation without triplets.",
        choices=("triplet", "pairwise"),
    )
    dimensions: int = setting(16, "Length of a surfel's patch feature (paper: 16).", minimum=2, maximum=64)
    margin: float = setting(0.5, "Margin m between cosine distances.", minimum=0.0, maximum=2.0)
    epochs: int = setting(30, "Passes over the views.", minimum=1)
    samples_per_view: int = setting(384, "Pixels that are sampled in each view, once.", minimum=16)
    min_patch_px: int = setting(40, "Smaller mask regions give no samples.", unit="px", minimum=1)
    border_px: float = setting(2.0, "No samples nearer to a region's border.", unit="px", minimum=0.0)
    rate: float = setting(0.05, "Adam's rate for features.", minimum=0.0)
    device: str = setting(
        "auto", "Where weights are computed, once; there is no GPU code for it.", choices=("auto", "cpu")
    )
