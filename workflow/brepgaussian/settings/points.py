"""Settings of the `points` stage. Sampling the surfels and labelling the samples."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class PointsSettings:
    """Sampling the surfels and labelling the samples."""

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
    densify: bool = setting(
        True, "Sample the centre and four points on the ellipse of each surfel; false = centres only (ablation)."
    )
    sliver_ratio: float = setting(
        5.0, "Surfels whose major axis exceeds the minor by more give their centre only.", minimum=1.0
    )
    ellipse_radius: float = setting(
        1.0, "Where on the ellipse the samples lie.", unit="standard deviations", minimum=0.1, maximum=3.0
    )
    minimum_points: int = setting(20000, "Sample the surfels further until there are as many points.", minimum=0)
    labels: str = setting(
        "fused",
        "How points get labels: all evidence fused, or clusters of the stage-2 features alone, as in the paper.",
        choices=("fused", "features"),
    )
    nodes: int = setting(9000, "Points on which labels are computed; the others follow their neighbours.", minimum=200)
    neighbours: int = setting(16, "Neighbours of each node in the graph.", minimum=4, maximum=40)
    regions: str = setting(
        "stage2",
        "Patch ids that vote: the masks as detected, or as repaired by stage 2.",
        choices=("masks", "stage2"),
    )
    border_px: float = setting(
        1.5, "A point's region counts when the region's border is farther away.", unit="px", minimum=0.5, maximum=8.0
    )
    votes_weight: float = setting(1.0, "Weight of the patch masks' votes.", minimum=0.0)
    features_weight: float = setting(0.5, "Weight of the stage-2 features' similarity.", minimum=0.0)
    features_distance: float = setting(
        0.5, "Cosine distance at which clusters of features stay apart (labels: features).", minimum=0.01, maximum=2.0
    )
    faces_weight: float = setting(1.0, "Weight of the planar faces that stage 1 confirmed.", minimum=0.0)
    smallest_patch: int = setting(
        5, "Patches of fewer nodes are absorbed by their neighbours.", unit="nodes", minimum=1
    )
    label_cost: float = setting(
        60.0, "What a label must save to stay, in costs of its nodes: more than a bulge of a face does.", minimum=0.0
    )
    other_label_costs: tuple[float, ...] = setting(
        (25.0, 120.0), "The same for other labellings: proposals for `brep` where the images refuse a solid; none = []."
    )
    curve_spacing: float = setting(
        0.005, "Spacing of the points appended along the curves between patches; 0 = none.", unit="unit frame",
        minimum=0.0,
    )  # fmt: skip
    shared_models: bool = setting(True, "Walk the curves on surfaces that are fitted to all labels together.")
    snap_curves: bool = setting(True, "Move the curves onto the edges of the edge maps, where views agree.")
