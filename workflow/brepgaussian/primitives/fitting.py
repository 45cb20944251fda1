"""One surface per label, the noise of the points, and labels that hold more than one face."""

import dataclasses

import numpy as np

from brepgaussian.errors import StageError
from brepgaussian.geometry.fit import Choice, choose, inliers, ransac
from brepgaussian.geometry.fit_choose import CUT, EFFECTIVE, JUDGED, PRICE
from brepgaussian.geometry.independence import own_share, shared_errors
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.log import get_logger
from brepgaussian.primitives.patches import (
    Cloud,
    Indices,
    Noise,
    Patch,
    clear_of_edges,
    islands,
    spreads,
    thinned,
    trimmed_rms,
    without_strays,
)
from brepgaussian.settings.primitives import PrimitivesSettings

log = get_logger("primitives")

SIMPLE = ("plane", "cylinder")
TURN_FLOOR, TURN_CEILING = np.radians(0.5), np.radians(12.0)  # believable noise of normals
POOR = 1.5  # noises: a fit beyond it may hold two faces
SMOOTHEST = 0.8  # quantile of the errors' correlation: where a fifth errs smoothly, the points are reconstructed
SMOOTH = 0.001  # unit frame; curved faces err smoothly by that, even where planes that are known make the noise less
KEPT_SUPPORT = 0.88  # of the members: below it a second face may hide in the label
SPLIT_SHARE = 0.08  # of a label: a smaller second face is not split off
SPLIT_COUNT = 40  # points
MOST_SPLITS = 6  # faces that one label may hold
EXPLAINED = 2.0  # noises: parts that fit worse than that are no faces either
SAMPLES = 40  # of RANSAC for each kind
FACE_PRICE = 4.0  # parameters that a further face costs beyond those of its surface: its border
ALIGNED = np.radians(30.0)  # a point's normal may differ that much, at least, from its surface


def fit_labels(cloud: Cloud, settings: PrimitivesSettings) -> tuple[list[Patch], Noise]:
    """Fit every label twice: with the two commonest kinds to learn the noise, then with the noise known.

    Flexible kinds would explain part of the noise, which is smooth, and so hide it.

    Raises:
        StageError: no label has enough points.
    """
    labels = [int(v) for v in np.unique(cloud.label) if v >= 0]
    pieces: dict[int, list[Indices]] = {}
    for label in labels:
        members = np.flatnonzero(cloud.label == label)
        if len(members) >= settings.smallest:
            pieces[label] = without_strays(cloud, members)
        else:
            log.info("label %d: %d points are too few for a primitive", label, len(members))
    if not pieces:
        raise StageError("no label has enough points for a primitive", fix="lower primitives.smallest or check points")
    guess = Noise(settings.sigma_floor, TURN_FLOOR)
    simple = dataclasses.replace(settings, kinds=SIMPLE)
    first = [fit_members((label,), np.concatenate(part), cloud, guess, simple) for label, part in pieces.items()]
    before = measure_noise([p for p in first if p is not None], cloud, settings)
    patches, noise = _fit_pieces(pieces, cloud, before, settings)
    if noise.own > before.own:  # what simple kinds do not explain looked like smooth errors
        patches, noise = _fit_pieces(pieces, cloud, noise, settings)
    return patches, noise


def _fit_pieces(
    pieces: dict[int, list[Indices]], cloud: Cloud, noise: Noise, settings: PrimitivesSettings
) -> tuple[list[Patch], Noise]:
    """Patches of the labels' pieces, fitted with some noise, and the noise that they show."""
    patches = [p for label, part in pieces.items() for p in _fit_label(label, part, cloud, noise, settings)]
    return patches, measure_noise(patches, cloud, settings)


def fit_members(
    labels: tuple[int, ...],
    members: Indices,
    cloud: Cloud,
    noise: Noise,
    settings: PrimitivesSettings,
    initial: tuple[Surface, ...] = (),
) -> Patch | None:
    """The best kind of surface through some points, or None where there is none."""
    choice = _choice(members, cloud, noise, settings, initial)
    if choice is None:
        return None
    members = np.sort(members)
    rms, turn = spreads(choice.surface, cloud, members)
    return Patch(labels, members, choice.surface, rms, turn)


def measure_noise(patches: list[Patch], cloud: Cloud, settings: PrimitivesSettings) -> Noise:
    """Medians over the patches, each counted by its points, of distance and angle residuals; share of own errors."""
    judged = [p for p in patches if len(p.members) >= JUDGED] or patches
    weight = np.array([len(p.members) for p in judged], float)
    distance = _weighted_quantile(np.array([p.rms for p in judged]), weight)
    turn = _weighted_quantile(np.array([p.turn for p in judged]), weight)
    shared = [shared_errors(p.surface, cloud.xyz[p.members], CUT * p.rms)[0] for p in judged]
    return Noise(
        float(np.clip(distance, settings.sigma_floor, settings.sigma_ceiling)),
        float(np.clip(turn, TURN_FLOOR, TURN_CEILING)),
        own_share(_weighted_quantile(np.array(shared), weight, SMOOTHEST), int(weight.sum())),
    )


def tolerance(patch: Patch, noise: Noise, settings: PrimitivesSettings) -> float:
    """Distance within which a point supports the patch's surface."""
    return settings.inlier_sigmas * max(noise.distance, min(patch.rms, 2 * noise.distance))


def support(patch: Patch, cloud: Cloud, noise: Noise, settings: PrimitivesSettings) -> Indices:
    """Members that lie on the surface, ascending."""
    near = inliers(
        patch.surface,
        cloud.xyz[patch.members],
        cloud.normals[patch.members],
        tolerance(patch, noise, settings),
        max(ALIGNED, 4 * noise.turn),
    )
    return patch.members[near]


def _fit_label(
    label: int, pieces: list[Indices], cloud: Cloud, noise: Noise, settings: PrimitivesSettings
) -> list[Patch]:
    members = np.concatenate(pieces)
    whole = fit_members((label,), members, cloud, noise, settings)
    if whole is None:
        log.warning("label %d: no surface fits its %d points", label, len(members))
        return []
    smooth = dataclasses.replace(noise, distance=max(noise.distance, SMOOTH))
    if not settings.split or not _poor(whole, cloud, smooth, settings):
        return [whole]
    parts = split(whole, cloud, noise, settings)
    if len(parts) > 1 and _pays_not(whole, parts, cloud, smooth):
        parts = [whole]
    if len(parts) > 1:
        log.info("label %d holds %d faces: %s", label, len(parts), ", ".join(p.surface.kind for p in parts))
    for part in parts:
        if part.rms > 3 * noise.distance:
            log.warning(
                "label %d: best %s leaves rms %.4f (noise %.4f)", label, part.surface.kind, part.rms, noise.distance
            )
    return parts


def _poor(patch: Patch, cloud: Cloud, noise: Noise, settings: PrimitivesSettings) -> bool:
    explained = len(support(patch, cloud, noise, settings)) / len(patch.members)
    return patch.rms > POOR * noise.distance or patch.turn > POOR * noise.turn or explained < KEPT_SUPPORT


def split(whole: Patch, cloud: Cloud, noise: Noise, settings: PrimitivesSettings) -> list[Patch]:
    """The faces in a label, found one after another; the whole where they explain it no better."""
    rng = np.random.default_rng(settings.seed)
    rest = whole.members
    parts: list[Patch] = []
    enough = max(SPLIT_COUNT, SPLIT_SHARE * len(whole.members))
    while len(rest) >= enough and len(parts) < MOST_SPLITS:
        some = thinned(rest, settings.sample // 2)
        reach, turn = 3 * noise.distance, max(ALIGNED / 2, 2.5 * noise.turn)
        surface, _ = ransac(cloud.xyz[some], cloud.normals[some], settings.kinds, reach, turn, rng, SAMPLES)
        if surface is None:
            break
        near = rest[inliers(surface, cloud.xyz[rest], cloud.normals[rest], reach, turn)]
        if len(near) < enough:
            break
        piece = islands(cloud, near)[0] if not parts else near
        if len(piece) < enough:
            break
        parts.append(Patch(whole.labels, piece, surface, *spreads(surface, cloud, piece)))
        rest = np.setdiff1d(rest, piece)
    if len(parts) < 2:
        return [whole]
    parts = _shared_out(parts, whole.members, cloud, noise, settings)
    if any(p.rms > EXPLAINED * noise.distance or p.turn > EXPLAINED * noise.turn for p in parts):
        return [whole]
    return [whole] if _pays_not(whole, parts, cloud, noise) else parts


def _pays_not(whole: Patch, parts: list[Patch], cloud: Cloud, noise: Noise) -> bool:
    """Whether several faces explain a patch no better than one."""
    return description([whole], whole.members, cloud, noise) <= description(parts, whole.members, cloud, noise)


def _shared_out(
    parts: list[Patch], members: Indices, cloud: Cloud, noise: Noise, settings: PrimitivesSettings
) -> list[Patch]:
    """Give every point to the face that explains it best, and fit again."""
    best = errors(parts, members, cloud, noise)[2]
    result = []
    for i, part in enumerate(parts):
        mine = members[best == i]
        if len(mine) < SPLIT_COUNT:
            continue
        fitted = fit_members(
            part.labels, np.concatenate(without_strays(cloud, mine)), cloud, noise, settings, (part.surface,)
        )
        if fitted is not None:
            result.append(fitted)
    return result


def description(parts: list[Patch], members: Indices, cloud: Cloud, noise: Noise) -> float:
    """Description length of points by several faces (compare `geometry.fit.description_length`)."""
    distance, turn, _ = errors(parts, members, cloud, noise)
    data = 2 * np.log(max(trimmed_rms(distance), 1)) + 2 * np.log(max(trimmed_rms(turn), 1))
    price = sum(PRICE[p.surface.kind] + FACE_PRICE for p in parts)
    return float(min(len(members), EFFECTIVE) * data + price * np.log(EFFECTIVE))


def errors(
    parts: list[Patch], members: Indices, cloud: Cloud, noise: Noise
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(M,) distance and angle in noises to the best face of each point, and (M,) that face."""
    xyz, normals = cloud.xyz[members], cloud.normals[members]
    distance = np.array([np.abs(p.surface.signed_distance(xyz)) for p in parts]) / noise.distance
    cosine = np.array([np.einsum("ij,ij->i", p.surface.normals(xyz), normals) for p in parts])
    turn = np.arccos(np.clip(cosine, -1, 1)) / noise.turn
    best = np.argmin(distance**2 + turn**2, axis=0)
    rows = np.arange(len(members))
    return distance[best, rows], turn[best, rows], best


def _choice(
    members: Indices, cloud: Cloud, noise: Noise, settings: PrimitivesSettings, initial: tuple[Surface, ...]
) -> Choice | None:
    some = thinned(clear_of_edges(cloud, members), settings.sample)
    try:
        return choose(
            cloud.xyz[some],
            cloud.normals[some],
            noise.distance,
            settings.kinds,
            noise.turn,
            own=noise.own,
            initial=initial,
            rng=np.random.default_rng(settings.seed),
            reach=settings.largest_radius,
        )
    except ValueError:
        return None


def _weighted_quantile(values: np.ndarray, weights: np.ndarray, level: float = 0.5) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, level * total[-1])])
