"""Settings of the `stage1` stage. Hull initialisation and 2D Gaussian Splatting with the edge scalar."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class Stage1Settings:
    """Hull initialisation and 2D Gaussian Splatting with the edge scalar."""

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
    recipe: str = setting(
        "fast",
        "fast: surfels start on the visual hull. paper: the paper's losses and schedule from random points.",
        choices=("fast", "paper"),
    )
    device: str = setting("auto", "Where to render; never silently replaced.", choices=("auto", "cpu", "cuda"))
    image_size: int = setting(400, "Longer side of the training images.", unit="px", minimum=50, maximum=1600)
    iterations: int = setting(600, "Training steps of the fast recipe, one view each.", minimum=0)
    paper_iterations: int = setting(30000, "Training steps of the paper recipe.", minimum=1)
    surfels: int = setting(8000, "Surfels that the hull is covered with.", minimum=100, maximum=200000)
    coverage: float = setting(
        0.7,
        "Standard deviation of a surfel at the start; too small lets the back shine through.",
        unit="spacings",
        minimum=0.1,
    )
    hull_resolution: int = setting(160, "Voxels along each side of the hull's grid.", minimum=16, maximum=400)
    concavities: bool = setting(
        True, "Open the pockets and holes that views show although no silhouette does, before the surfels start."
    )
    flat_faces: bool = setting(
        True, "Cut off what the hull has above planar faces on whose borders the masks of all views agree."
    )
    relief: bool = setting(
        True,
        "Move the hull's surface to the depth that parallax shows where radiance changes; needs masks (flat_faces).",
    )
    edge_cloud: bool = setting(
        True, "Triangulate the images' edges to a 3D edge cloud, and report the surface that no two views see."
    )
    edge_loss: bool = setting(True, "Train the edge value e of each surfel (paper, L_edge).")
    edge_weight: float = setting(0.1, "Weight of L_edge (paper: 0.1).", minimum=0.0)
    dssim_weight: float = setting(0.2, "Share of D-SSIM in L_geo, lambda (3DGS: 0.2).", minimum=0.0, maximum=1.0)
    alpha_weight: float = setting(0.5, "Weight of the silhouette loss.", minimum=0.0)
    normal_weight: float = setting(0.1, "Weight of normal consistency (2DGS: 0.05).", minimum=0.0)
    distortion_weight: float = setting(0.0, "Weight of depth distortion, unit-frame lengths squared.", minimum=0.0)
    densification: bool = setting(True, "Split and prune surfels during the first half of training.")
    densify_every: int = setting(100, "Training steps between two densifications.", minimum=1)
    densify_share: float = setting(
        0.02, "Share of the surfels that one densification splits.", minimum=0.0, maximum=1.0
    )
    max_surfels: int = setting(200000, "Densification stops here.", minimum=100, maximum=1000000)
    stop_gain: float = setting(
        0.01, "Stop when two passes over the views lower the loss by less than this share; 0 = never.", minimum=0.0
    )
    opacity_reset_every: int = setting(
        0, "Training steps between two lowerings of all opacities (3DGS: 3000); 0 = never.", minimum=0
    )
    single_stage: bool = setting(False, "Ablation: train the patch features together with the geometry.")
    joint_weight: float = setting(0.1, "Weight of L_tri when it is trained with the geometry.", minimum=0.0)
    low_pass_px: float = setting(
        0.0,
        "Standard deviation of the screen-space filter (2DGS: 0.71); 0 = none: it pushes surfels inwards.",
        unit="px",
        minimum=0.0,
    )
    position_rate: float = setting(0.00003, "Adam's rate for centres at the start.", unit="unit frame", minimum=0.0)
    rotation_rate: float = setting(0.0001, "Adam's rate for quaternions.", minimum=0.0)
    scale_rate: float = setting(0.005, "Adam's rate for log scales.", minimum=0.0)
    opacity_rate: float = setting(0.03, "Adam's rate for opacity logits.", minimum=0.0)
    color_rate: float = setting(0.005, "Adam's rate for colours and edge values.", minimum=0.0)
    final_rate: float = setting(0.1, "Rates at the end as a share of those at the start.", minimum=0.0, maximum=1.0)
    shared_moment: bool = setting(
        False, "One second moment for all surfels: they move in proportion to their gradients (Adam: one each)."
    )
    settle_sweeps: int = setting(10, "Sweeps of the smooth-surface prior before training.", minimum=0)
    settle_every: int = setting(0, "Training steps between two sweeps of the prior; 0 = none.", minimum=0)
    settle_below: float = setting(
        0.5,
        "Weight of neighbours below the fitted surface before training (0.5: symmetric); more if the hull is not cut.",
        minimum=0.5,
        maximum=1.0,
    )
    settle_color: float = setting(
        0.01, "Colour step (of 1) at which neighbours no longer belong together.", minimum=0.0
    )
    settle_angle_deg: float = setting(
        15.0, "Angle at which neighbours no longer belong together.", unit="deg", minimum=0.1
    )
