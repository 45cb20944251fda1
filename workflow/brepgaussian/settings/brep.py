"""Settings of the `brep` stage. Assembly of a closed solid and its refinement."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class BrepSettings:
    """Assembly of a closed solid and its refinement."""

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
    tidy: bool = setting(True, "Join primitives that are one surface twice, leave out poor small ones.")
    margin: float = setting(
        0.04, "How far a face is extended past its points before faces cut each other.", unit="unit frame", minimum=0.0
    )
    wide_margin: float = setting(
        0.12, "The same for the rung that bridges gaps between patches.", unit="unit frame", minimum=0.0
    )
    fuzzy: float = setting(
        1e-5, "Distance within which OCC takes edges and corners as equal.", unit="unit frame", minimum=0.0
    )
    max_reach: float = setting(
        0.05, "Largest radius within which a patch is expected to hold a point.", unit="unit frame", minimum=0.0
    )
    max_extended: int = setting(
        24, "Most primitives that are extended through the whole box at once (cells explode).", minimum=0
    )
    unsupported_weight: float = setting(1.0, "Cost of a face's area without points, per area with points.", minimum=0.0)
    smooth_weight: float = setting(0.02, "Cost of any face's area, per area with points.", minimum=0.0)
    free_length: float = setting(
        0.02,
        "Depth of material outside a silhouette that weighs as much as an unsupported face of its area.",
        unit="unit frame",
        minimum=1e-4,
    )
    filled_weight: float = setting(
        1.0, "Weak evidence for material where no camera sees through, area per volume.", minimum=0.0
    )
    gate_explained: float = setting(
        0.9, "Share of each patch's points that the solid's faces must explain.", minimum=0.0, maximum=1.0
    )
    gate_iou: float = setting(
        0.97, "Least mean IoU of the solid's silhouettes with the views'.", minimum=0.0, maximum=1.0
    )
    gate_bare: float = setting(
        0.02, "Share of the area without points above which guessed faces are tried.", minimum=0.0, maximum=1.0
    )
    weak_explained: float = setting(
        0.7,
        "Share of all points that a solid must explain to be preferred to the polyhedral fallback.",
        minimum=0.0,
        maximum=1.0,
    )
    weak_iou: float = setting(0.85, "The same for the silhouettes' IoU.", minimum=0.0, maximum=1.0)
    gate_views: int = setting(16, "Most silhouettes that are compared in the gate.", minimum=1)
    gate_side: int = setting(400, "Longest side of the silhouettes used as evidence.", unit="px", minimum=50)
    time_limit_s: float = setting(
        120.0,
        "Guard against a kernel that hangs: time limit of one call, far beyond any that ends.",
        unit="s",
        minimum=1.0,
    )
    most_solids: int = setting(
        48,
        "Solids of up to 25 patches built on rungs of the ladder after which no other rung or explanation is tried; "
        "one of twice as many counts twice, here and in what follows.",
        minimum=1,
    )
    most_refinements: int = setting(16, "The same for solids refined in the search.", minimum=1)
    most_work: int = setting(
        30, "Solids refined for one object, trials of simpler and other solids included.", minimum=1
    )
    polyhedron_faces: int = setting(400, "Triangles of the polyhedral fallback.", minimum=20)
    refine: bool = setting(True, "Refine all surfaces together against the images' sub-pixel edges.")
    simplify: bool = setting(True, "Try solids with fewer or simpler faces, take those that the images like as well.")
    simplify_trials: int = setting(5, "Most simpler solids that are refined and judged.", minimum=0)
    simplify_solids: int = setting(16, "Most simpler solids that are built.", minimum=0)
    refine_angle_deg: float = setting(
        0.5, "Trust in the directions that the points gave (prior).", unit="degrees", minimum=1e-3
    )
    refine_length: float = setting(
        0.003, "Trust in the positions and radii that the points gave (prior).", unit="unit frame", minimum=1e-6
    )
    refine_poses: bool = setting(True, "Also correct each view's pose where silhouettes do not fit otherwise.")
    refine_observations: int = setting(
        100_000, "Most pairs of an edge sample and a view in one iteration.", minimum=1000
    )
    accept_silhouette_px: float = setting(
        0.1, "A solid is accepted if every edge's median silhouette residual is below this.", unit="px", minimum=0.0
    )
    accept_iou: float = setting(
        0.998,
        "A solid is accepted if the IoU of its silhouettes over all views is above this.",
        minimum=0.0,
        maximum=1.0,
    )
    accept_astray: float = setting(
        1e-5,
        "A solid is accepted if a smaller share of its silhouettes' pixels is wrong by more than two pixels.",
        minimum=0.0,
        maximum=1.0,
    )
    accept_disputed: float = setting(
        40.5,
        "A solid is accepted if views disagree about no connected part of a face that is larger than this.",
        unit="px^2",
        minimum=0.0,
    )
    accept_displaced: float = setting(
        37.5,
        "A solid is accepted if no connected part of a face that is larger than this surely lies elsewhere.",
        unit="px^2",
        minimum=0.0,
    )
    accept_stepped: float = setting(
        20.0,
        "A solid is accepted if views show steps in grey, clear of its edges, on no larger connected part of a face.",
        unit="px^2",
        minimum=0.0,
    )
