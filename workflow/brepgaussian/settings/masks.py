"""Settings of the `masks` stage. Edge maps and patch masks per view."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class MasksSettings:
    """Edge maps and patch masks per view."""

    edges: str = setting(
        "classical",
        "Edge detector: step strength with non-maximum suppression (classical), borders of the patch masks (regions), "
        "the maps that came with the dataset (dataset), or the user's own TorchScript network (torchscript).",
        choices=("classical", "regions", "dataset", "torchscript"),
    )
    patches: str = setting(
        "classical",
        "Patch detector: watershed and region merging (classical), visible faces of the known model (truth), or "
        "Segment Anything from a local checkpoint (sam).",
        choices=("classical", "truth", "sam"),
    )
    weights: str = setting("", "TorchScript file of the edge network; needed for edges: torchscript.")
    sam_checkpoint: str = setting(
        "", "Folder of a Segment Anything checkpoint as `transformers` saves it; needed for patches: sam."
    )
    sam_model: str = setting("sam", "Generation of the Segment Anything checkpoint.", choices=("sam", "sam2"))
    radius: int = setting(
        3, "Radius of the half-disks that measure a luminance step.", unit="px", minimum=2, maximum=15
    )
    minima_depth: float = setting(
        0.4,
        "Depth of a step-strength basin that starts a region of its own; low values over-segment on purpose.",
        unit="grey level",
        minimum=0.05,
    )
    minima_noise: float = setting(
        0.25, "The image noise raises that depth to so many of its standard deviations.", minimum=0.0
    )
    merge_step: float = setting(
        2.0, "Neighbouring regions merge up to this luminance step along their border.", unit="grey level", minimum=0.0
    )
    merge_significance: float = setting(
        2.0,
        "The image noise raises the merging step by so many standard errors of the two regions' luminance there.",
        unit="standard error",
        minimum=0.0,
    )
    minimum_area: int = setting(60, "Smaller regions are absorbed by a neighbour.", unit="px", minimum=1)
    edge_step: float = setting(
        2.0,
        "Weakest luminance step that starts an interior edge in a noise-free image.",
        unit="grey level",
        minimum=0.1,
    )
    edge_width: int = setting(3, "Width of the lines in the edge map.", unit="px", minimum=1, maximum=9)
    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
