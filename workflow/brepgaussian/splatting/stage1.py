"""Stage 1: geometry and edges. Surfels on the visual hull, trained by 2D Gaussian Splatting."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.base import Provenance
from brepgaussian.artifacts.masks import Masks, read_masks
from brepgaussian.artifacts.stage1 import Evidence, Surfels
from brepgaussian.artifacts.views import Views, read_views
from brepgaussian.errors import StageError
from brepgaussian.log import get_logger, progress
from brepgaussian.settings.base import digest
from brepgaussian.settings.stage1 import Stage1Settings
from brepgaussian.splatting.camera import RenderOptions
from brepgaussian.splatting.contrastive import normalised
from brepgaussian.splatting.densify import Statistics, densify, reset_opacities
from brepgaussian.splatting.engine import LossWeights, Step, average_targets, training_step
from brepgaussian.splatting.faces import Face, assign, planes, tied
from brepgaussian.splatting.hull import Hull, carve
from brepgaussian.splatting.joint import JointFeatures
from brepgaussian.splatting.library import Cloud, Floats, Raster
from brepgaussian.splatting.parameters import Parameters, quaternions_of, turned
from brepgaussian.splatting.recipes import effective, random_start, towards_cameras
from brepgaussian.splatting.settle import settle
from brepgaussian.splatting.spreading import spread, spread_closer
from brepgaussian.splatting.targets import Target, is_grey, make_targets, training_scale
from brepgaussian.views.noise import noise_of

START_OPACITY = 0.9
RESET_OPACITY = 0.01  # 3DGS
SYMMETRIC = 0.5  # once the images pull, the prior smooths without taking sides
SMALLEST_PX = 0.5  # surfels of less than this standard deviation are not split: no pixel could tell the halves apart

logger = get_logger("stage1")


def train_stage1(
    views_path: str | Path,
    masks_path: str | Path,
    out_ply: str | Path,
    out_h5: str | Path,
    settings: Stage1Settings,
    threads: int = 1,
) -> None:
    """Train surfels with edge values (paper, section 3.2, stage 1) and write `stage1.ply` and `stage1.h5`.

    Args:
        views_path: `views.h5`.
        masks_path: `masks.h5`.
        out_ply: where the surfels go.
        out_h5: where the evidence goes.
        settings: see `Stage1Settings`.
        threads: CPU threads; the result does not depend on it.

    Raises:
        ArtifactError: an input file is missing or damaged.
        StageError: the silhouettes have no common inside, or the files do not fit together.
        ToolError: there is no C++ compiler, or not the device that was asked for.
    """
    choose_backend(settings.device)  # what is missing is said before the work
    views, masks = read_views(views_path), read_masks(masks_path)
    if masks.edges.shape != views.alpha.shape:
        raise StageError(
            f"has masks of shape {masks.edges.shape}, the views are {views.alpha.shape}",
            file=masks_path,
            fix="rerun the masks stage",
        )
    logger.info("settings: %s", settings)
    settings = effective(settings)
    trained = run(views, masks, settings, threads)
    surfels = trained.parameters.surfels()
    evidence = Evidence(
        hull_vertices=trained.hull.vertices.astype(np.float32),
        hull_triangles=trained.hull.triangles.astype(np.int32),
        face_id=face_ids(trained, surfels),
        face_planes=planes(trained.faces),
        losses=np.array(trained.losses, np.float32),
        features=trained.features,
    )
    if settings.edge_cloud:
        evidence = add_edges(evidence, surfels, views, trained.noise, trained.hull, settings)
    surfels.write(out_ply)
    evidence.write(out_h5, Provenance(views.object_name, digest(settings)))


def face_ids(trained: "Trained", surfels: Surfels) -> NDArray[np.int32]:
    """(N,) planar face or piece of a concavity's wall that each surfel was confirmed to lie on, -1 = none."""
    spacing = trained.hull.spacing
    faces = assign(trained.faces, surfels.centers, surfels.normals, spacing)
    walls = trained.hull.walls.under(surfels.centers, surfels.normals).piece
    return np.where((faces < 0) & (walls >= 0), len(trained.faces) + walls, faces).astype(np.int32)


def add_edges(
    evidence: Evidence, surfels: Surfels, views: Views, noise: float, hull: Hull, settings: Stage1Settings
) -> Evidence:
    """The evidence with 3D edges and with the places of the hull that fewer than two views see."""
    from brepgaussian.splatting.concave.scene import Scene
    from brepgaussian.splatting.evidence import concavity_edges, edge_cloud, unobserved, with_creases

    scene = Scene(hull.vertices, hull.triangles)
    cloud = concavity_edges(views, scene, hull.prisms, edge_cloud(views, scene, noise, settings.seed))
    cloud = with_creases(views, scene, surfels.centers, surfels.normals, cloud)
    points, normals, _ = spread(hull, settings.surfels, settings.seed)
    unseen = unobserved(views, scene, points, normals, hull.spacing)
    logger.info("%d 3D edge points; %.1f %% of the surface unobserved", len(cloud.points), 100 * unseen.mean())
    return replace(
        evidence,
        edge_points=cloud.points,
        edge_directions=cloud.directions,
        edge_views=cloud.views,
        unobserved=points[unseen].astype(np.float32),
    )


@dataclass(frozen=True)
class Trained:
    """Stage 1 without its files; `features` (N, D) is empty unless they were trained along; `noise` in grey levels."""

    parameters: Parameters
    hull: Hull
    faces: list[Face]
    losses: list[float]
    features: Floats
    noise: float


def run(views: Views, masks: Masks, settings: Stage1Settings, threads: int) -> Trained:
    """Hull, start, training."""
    noise = noise_of(views)
    regions = masks.patches if settings.flat_faces else None
    resolution, relief = settings.hull_resolution, settings.relief
    hull, faces = carve(views, resolution, threads, settings.concavities, noise, regions, relief)
    parameters = start(views, hull, settings) if settings.recipe == "fast" else random_start(views, settings)
    targets = make_targets(views, masks, settings.image_size)
    joint = None
    if settings.single_stage:
        scale = training_scale(views, settings.image_size)
        joint = JointFeatures(masks, scale, parameters.cloud.centers, settings.seed, settings.joint_weight)
    parameters, losses = optimise(parameters, targets, settings, threads, joint, hull)
    if settings.recipe == "paper":
        options = RenderOptions(low_pass_px=settings.low_pass_px, cull=False, threads=threads)
        parameters.replace("quaternions", towards_cameras(parameters, targets, options))
    features = normalised(joint.features)[0] if joint else np.zeros((0, 0), np.float32)
    return Trained(parameters, hull, faces, losses, features, noise)


def start(views: Views, hull: Hull, settings: Stage1Settings) -> Parameters:
    """Surfels spread over the hull, evenly on each face."""
    points, normals, distances = spread_closer(hull, settings.surfels, settings.seed)
    count, channels = len(points), (1 if is_grey(views) else 3) + 1
    cloud = Cloud(
        centers=points.astype(np.float32),
        quaternions=quaternions_of(normals),
        scales=np.repeat((settings.coverage * distances).astype(np.float32)[:, None], 2, axis=1),
        opacities=np.full(count, START_OPACITY, np.float32),
        channels=np.full((count, channels), 0.5, np.float32),
    )
    logger.info(
        "hull: %d vertices; %d surfels, %.4f apart, %d closer",
        len(hull.vertices),
        count,
        distances.max(),
        (distances < distances.max()).sum(),
    )
    return Parameters(cloud)


def optimise(
    parameters: Parameters,
    targets: list[Target],
    settings: Stage1Settings,
    threads: int,
    joint: JointFeatures | None = None,
    hull: Hull | None = None,
) -> tuple[Parameters, list[float]]:
    """Train, one view a step, with the surfels of the hull's fillets on these; the surfels and each step's loss."""
    rng = np.random.default_rng(settings.seed)
    raster, losses = Raster(), []
    fast, backend = settings.recipe == "fast", choose_backend(settings.device)
    options = RenderOptions(low_pass_px=settings.low_pass_px, cull=fast, threads=threads)
    weights = loss_weights(settings)
    if fast:
        parameters.replace("channels", average_targets(parameters.cloud, targets, options)[0])
    settle_all(parameters, settings, settings.settle_sweeps, settings.settle_below)
    hull = hull if fast else None
    tie(parameters, hull)
    statistics, smallest = Statistics(len(parameters)), SMALLEST_PX * footprint(targets)
    order: list[int] = []
    for iteration in progress(range(settings.iterations), "stage1"):
        if not order:
            order = rng.permutation(len(targets)).tolist()
        view = order.pop()
        if backend == "cpu":
            step = training_step(raster, parameters.cloud, targets[view], weights, options)
        else:
            step = torch_step(backend, parameters.cloud, targets[view], weights, options)
        if joint:
            add(step.gradients, joint.step(parameters.cloud, view, targets[view], targets[view].origin, options))
        statistics.add(step.screen, step.weights)
        parameters.update(step.gradients, rates(settings, iteration), threads, shared=settings.shared_moment)
        losses.append(step.loss)
        done = iteration + 1
        if settings.densification and done % settings.densify_every == 0 and done <= settings.iterations // 2:
            limit = settings.max_surfels
            parameters = densify(parameters, statistics, settings.densify_share, smallest, limit)
            statistics = Statistics(len(parameters))
            if joint:
                joint.follow(parameters.cloud.centers)
        if (
            settings.opacity_reset_every
            and done % settings.opacity_reset_every == 0
            and done <= settings.iterations // 2
        ):
            reset_opacities(parameters, RESET_OPACITY)
        if settings.settle_every and done % settings.settle_every == 0:
            early = done <= settings.iterations // 2
            settle_all(parameters, settings, 1, settings.settle_below if early else SYMMETRIC)
        if done % len(targets) == 0 and converged(losses, len(targets), settings.stop_gain):
            logger.info("the loss has stopped falling after %d steps", done)
            break
        if done % len(targets) == 0:
            tie(parameters, hull)
    tie(parameters, hull)
    return parameters, losses


def add(gradients: Cloud, others: Cloud | None) -> None:
    """Add the geometry's gradients of another loss, in place."""
    if others is not None:
        for name in ("centers", "quaternions", "scales", "opacities"):
            getattr(gradients, name)[...] += getattr(others, name)


def torch_step(backend: str, cloud: Cloud, target: Target, weights: LossWeights, options: RenderOptions) -> Step:
    """A step through autograd; torch is imported only where it is used."""
    from brepgaussian.splatting.torch_engine import training_step_torch

    return training_step_torch(backend, cloud, target, weights, options)


def choose_backend(device: str) -> str:
    """The backend for a device, without loading torch for the CPU."""
    import importlib.util

    if device == "cpu" or (device == "auto" and importlib.util.find_spec("gsplat") is None):
        return "cpu"
    from brepgaussian.splatting import render

    return render.choose_backend(device)


def converged(losses: list[float], epoch: int, gain: float) -> bool:
    """Whether the last two passes over the views lowered the mean loss by less than a share `gain`."""
    if gain <= 0 or len(losses) < 4 * epoch:
        return False
    before, after = (
        float(np.mean(losses[k : k + 2 * epoch])) for k in (len(losses) - 4 * epoch, len(losses) - 2 * epoch)
    )
    return after > (1 - gain) * before


def loss_weights(settings: Stage1Settings) -> LossWeights:
    """The weights of the loss' terms."""
    return LossWeights(
        dssim=settings.dssim_weight,
        alpha=settings.alpha_weight,
        edge=settings.edge_weight if settings.edge_loss else 0.0,
        normal=settings.normal_weight,
        distortion=settings.distortion_weight,
    )


def rates(settings: Stage1Settings, iteration: int) -> dict[str, float]:
    """Adam's rates at one step: they fall exponentially to `final_rate`."""
    share = settings.final_rate ** (iteration / max(settings.iterations, 1))
    return {
        "centers": share * settings.position_rate,
        "quaternions": share * settings.rotation_rate,
        "scales": share * settings.scale_rate,
        "opacities": share * settings.opacity_rate,
        "channels": share * settings.color_rate,
    }


def footprint(targets: list[Target]) -> float:
    """Size of a training pixel at the object's centre, unit frame."""
    return float(np.median([t.camera.z_reference / t.camera.fx for t in targets]))


def tie(parameters: Parameters, hull: Hull | None) -> None:
    """Put surfels of a hull's fillets and of its concavities' walls on these, in place."""
    if hull is None or not (hull.fillets or hull.prisms):
        return
    before = parameters.surfels().normals
    centers, normals = tied(parameters.cloud.centers, before, hull.fillets, hull.spacing)
    walls = hull.walls.under(centers, normals)
    centers, normals = walls.foot.astype(np.float32), walls.normal.astype(np.float32)
    parameters.replace("centers", centers)
    parameters.replace("quaternions", turned(parameters.cloud.quaternions, before, normals))


def settle_all(parameters: Parameters, settings: Stage1Settings, sweeps: int, below: float) -> None:
    """Apply the prior for machined parts to all surfels, in place."""
    if sweeps == 0:
        return
    cloud, before = parameters.cloud, parameters.surfels().normals
    centers, normals = settle(
        cloud.centers,
        before,
        cloud.channels[:, :-1],
        sweeps=sweeps,
        below=below,
        color_scale=settings.settle_color,
        angle_scale_deg=settings.settle_angle_deg,
    )
    parameters.replace("centers", centers)
    parameters.replace("quaternions", turned(cloud.quaternions, before, normals))
