"""Badly reconstructed regions explained afresh: few surfaces along the design's directions instead of many poor ones.

Where no image shows the ground of a groove or a bore, the points bulge by several noises. Labels then cut one face
into pieces, and each piece gets a surface of a kind of its own. All points of such patches together know better:
surfaces that a neighbour's direction or axis guides are sought among them, simple ones first, until no surface
explains enough points any more. What is left belongs to no face. These are proposals: the images decide.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.points import Points
from brepgaussian.artifacts.primitives import Primitive, Primitives
from brepgaussian.geometry.fit import fit_robust, inliers, oriented, plausible, residuals
from brepgaussian.geometry.fit_choose import turn_of
from brepgaussian.geometry.surfaces import KINDS, Surface
from brepgaussian.primitives.candidates import FEW, FILLET, TURN, Candidate, candidates, upright
from brepgaussian.primitives.fitting import TURN_FLOOR
from brepgaussian.primitives.guided import SURE, Known, known
from brepgaussian.primitives.patches import Cloud, Indices, Noise, Patch, make_cloud, spreads
from brepgaussian.primitives.regularise import regularise, state_of
from brepgaussian.settings.primitives import PrimitivesSettings

Array = NDArray[np.float64]

SIMPLE = ("plane", "cylinder")


@dataclass(frozen=True)
class Choice:
    """A way to explain a region.

    Attributes:
        kinds: that compete.
        share: of the region's points that makes a face.
        rounds: whether patches that go far round an axis are explained afresh too, or keep their surface.
    """

    kinds: tuple[str, ...]
    share: float = 0.05
    rounds: bool = True


CHOICES = (  # likeliest first; at last the walls of slots and keyways, which are small and bulge like cylinders
    Choice((*SIMPLE, FILLET)),
    Choice((*SIMPLE, FILLET, "torus")),
    Choice(KINDS),
    Choice(SIMPLE),
    Choice(SIMPLE, 0.02, rounds=False),
    Choice(("plane",), 0.02, rounds=False),
)
SURE_SHARE = 0.01  # of all points: smaller patches are dubious however well they fit
BENT = np.radians(15.0)  # curved patches whose normals turn less from their mean may be planes,
ROUND = np.radians(60.0)  # and those that turn more are round, however noisy
REACH = 2.5  # typical residuals of the dubious patches within which a surface explains a point
LOOKED_AT = 3000  # points of the region that rank the candidates
TRIED = 4  # best candidates of each kind that are fitted to their inliers in a round
ENOUGH = 40  # points that make a face at least
MOST_FACES = 10
SIMPLE_ENOUGH = 0.5  # of the most points explained: a simpler kind that reaches it is preferred (a bulging plane)
OWN_PRICE = 0.1  # share of its points that a surface along no known direction must be ahead
APART = 4.0  # limits within which points beside a surface, with normals like its own, are its bulge
REACHING = 0.1  # of a fillet's points whose normals are nearer to the cylinder's
HALF_TURN = np.radians(45.0)  # than this
ROUNDS = 2  # of giving the points to the nearest surface and fitting it again


def alternatives(points: Points, primitives: Primitives, settings: PrimitivesSettings) -> Iterator[Primitives]:
    """Other explanations of the dubious patches' points, each with relations; none where all patches are sure.

    Args:
        points: that the primitives' supports index.
        primitives: of the stage.
        settings: of the stage.
    """
    cloud, patches, noise = taken_up(points, primitives, settings)
    seen: set[tuple[tuple[str, int], ...]] = set()
    for choice in CHOICES:
        dubious = dubious_of(patches, cloud, noise, choice.rounds)
        sure = [p for i, p in enumerate(patches) if i not in dubious]
        if not dubious or not sure:
            continue
        guides = known(sure, state_of(sure, cloud, noise, settings))
        found = _afresh([patches[i] for i in dubious], sure, guides, choice, cloud, noise, settings)
        key = tuple((p.surface.kind, len(p.members)) for p in found)
        if key in seen:
            continue
        seen.add(key)
        snapped, relations = regularise(found, cloud, noise, settings)
        yield Primitives(tuple(primitive_of(p, cloud) for p in snapped), relations, primitives.sigma)


def taken_up(points: Points, primitives: Primitives, settings: PrimitivesSettings) -> tuple[Cloud, list[Patch], Noise]:
    """The points, the patches of a stage's primitives, and the noise of these."""
    cloud = make_cloud(points, settings.neighbours)
    patches = [
        Patch((p.label,), np.sort(p.support), p.surface, *spreads(p.surface, cloud, p.support))
        for p in primitives.items
        if len(p.support)
    ]
    return cloud, patches, _noise(patches, primitives.sigma, settings)


def _noise(patches: Sequence[Patch], distance: float, settings: PrimitivesSettings) -> Noise:
    """The noise of the points; that of the normals is the patch's that holds the middle point, never nought."""
    if not patches:
        return Noise(max(distance, settings.sigma_floor), TURN_FLOOR)
    order = sorted(patches, key=lambda p: p.turn)
    total = np.cumsum([len(p.members) for p in order])
    turn = order[int(np.searchsorted(total, total[-1] / 2))].turn
    return Noise(max(distance, settings.sigma_floor), max(turn, TURN_FLOOR))


def primitive_of(patch: Patch, cloud: Cloud) -> Primitive:
    """A patch as the stage writes it."""
    rms = patch.surface.rms(cloud.xyz[patch.members])
    return Primitive(patch.surface, patch.labels[0], patch.members, rms)


def dubious_of(patches: Sequence[Patch], cloud: Cloud, noise: Noise, rounds: bool) -> list[int]:
    """Indices of patches that are small or fit badly; if not `rounds`, of small and little bent ones."""
    few = SURE_SHARE * sum(len(p.members) for p in patches)
    turns = [np.pi if p.surface.kind == "plane" else turn_of(p.surface, cloud.xyz[p.members]) for p in patches]
    if rounds:
        return [i for i, p in enumerate(patches) if p.rms > SURE * noise.distance or len(p.members) < few]
    return [
        i
        for i, p in enumerate(patches)
        if turns[i] < BENT
        or len(p.members) < few
        or (p.rms > SURE * noise.distance and (p.surface.kind == "plane" or turns[i] < ROUND))
    ]


def _afresh(
    dubious: Sequence[Patch],
    sure: Sequence[Patch],
    guides: Known,
    choice: Choice,
    cloud: Cloud,
    noise: Noise,
    settings: PrimitivesSettings,
) -> list[Patch]:
    """The sure patches with the points of dubious ones that they explain, and new patches of the others."""
    members = np.unique(np.concatenate([p.members for p in dubious]))
    xyz, normals = cloud.xyz[members], cloud.normals[members]
    typical = np.repeat([p.rms for p in dubious], [len(p.members) for p in dubious])
    limit = REACH * max(float(np.median(typical)), noise.distance)
    own = [Candidate(p.surface.kind, p.surface, None) for p in dubious]
    left = nearest([p.surface for p in sure], xyz, normals, limit) < 0
    found = surfaces_of(own, guides, choice, xyz[left], normals[left], limit, settings)
    owner = _settled(found, sure, xyz, normals, limit, settings)
    result = []
    for k, patch in enumerate(sure):
        more = np.union1d(patch.members, members[owner == k])
        result.append(replace(patch, members=more) if len(more) > len(patch.members) else patch)
    labels = sorted({v for p in dubious for v in p.labels})
    for k, candidate in enumerate(found, start=len(sure)):
        mine = members[owner == k]
        if len(mine) >= FEW:
            label = labels[min(k - len(sure), len(labels) - 1)]
            result.append(Patch((label,), mine, candidate.surface, *spreads(candidate.surface, cloud, mine)))
    return result


def nearest(surfaces: Sequence[Surface], xyz: Array, normals: Array, limit: float) -> Indices:
    """(N,) index of the surface that explains each point best by distance and angle, -1 for none."""
    best, owner = np.full(len(xyz), np.inf), np.full(len(xyz), -1, np.int64)
    for i, surface in enumerate(surfaces):
        distance, turn = residuals(surface, xyz, normals)
        cost = np.where((distance <= limit) & (turn <= TURN), (distance / limit) ** 2 + (turn / TURN) ** 2, np.inf)
        owner[cost < best] = i
        best = np.minimum(best, cost)
    return owner


def _settled(
    found: list[Candidate],
    sure: Sequence[Patch],
    xyz: Array,
    normals: Array,
    limit: float,
    settings: PrimitivesSettings,
) -> Indices:
    """(N,) owner of each point, sure patches first; `found` is fitted to what it owns, in place."""
    fixed = [p.surface for p in sure]
    for _ in range(ROUNDS):
        owner = nearest([*fixed, *(c.surface for c in found)], xyz, normals, limit)
        for k, candidate in enumerate(found):
            mine = owner == k + len(fixed)
            fitted = _fitted(candidate, xyz[mine], normals[mine], limit, settings)
            if fitted is not None:
                found[k] = replace(candidate, surface=fitted)
    return nearest([*fixed, *(c.surface for c in found)], xyz, normals, limit)


def surfaces_of(
    own: list[Candidate],
    guides: Known,
    choice: Choice,
    xyz: Array,
    normals: Array,
    limit: float,
    settings: PrimitivesSettings,
) -> list[Candidate]:
    """Surfaces that explain the points one after another."""
    step = max(1, len(xyz) // LOOKED_AT)
    points, turned = xyz[::step], normals[::step]
    enough = max(choice.share * len(points), ENOUGH / step)
    found: list[Candidate] = []
    pool, fresh = [c for c in (*own, *candidates(points, turned, guides)) if c.kind in choice.kinds], True
    while len(points) >= enough and len(found) < MOST_FACES:
        best = _next(pool, points, turned, limit, settings)
        near = np.zeros(len(points), bool) if best is None else inliers(best.surface, points, turned, limit, TURN)
        if best is None or near.sum() < enough:
            if fresh:
                break  # else neighbourhoods of what is left: among all points small walls had none
            pool, fresh = [c for c in candidates(points, turned, guides) if c.kind in choice.kinds], True
            pool = [c for c in pool if not any(_same_again(f, c, points, turned, limit) for f in found)]
            continue
        fresh = False
        found.append(best)
        points, turned = points[~near], turned[~near]
        pool = [c for c in pool if not _same_again(best, c, points, turned, limit)]
    return found


def _same_again(first: Candidate, second: Candidate, points: Array, normals: Array, limit: float) -> bool:
    """Whether all that a surface explains are points where another one bulges."""
    near = inliers(second.surface, points, normals, limit, TURN)
    if near.sum() < FEW:
        return True
    distance, turn = residuals(first.surface, points[near], normals[near])
    return bool(np.median(distance) < APART * limit and np.median(turn) < TURN)


def _next(
    pool: Sequence[Candidate], points: Array, normals: Array, limit: float, settings: PrimitivesSettings
) -> Candidate | None:
    """The simplest candidate that explains nearly as many points as any."""
    masks = [inliers(c.surface, points, normals, limit, TURN) for c in pool]
    score = np.array([m.sum() * (1 - OWN_PRICE * (c.free is None)) for m, c in zip(masks, pool, strict=True)])
    groups: dict[tuple[int, str], list[int]] = {}
    for k in np.argsort(-score, kind="stable").tolist():
        groups.setdefault((pool[k].freedom, pool[k].kind), []).append(k)
    best: dict[tuple[int, str], tuple[float, Candidate]] = {}
    for name, group in groups.items():
        for k in group[:TRIED]:
            surface = _fitted(pool[k], points[masks[k]], normals[masks[k]], limit, settings)
            if surface is None:
                continue
            near = inliers(surface, points, normals, limit, TURN)
            if not _reaches(pool[k].beside, points[near], normals[near]):
                continue
            count = float(near.sum())
            count *= 1 - OWN_PRICE * (pool[k].free is None)
            if count > best.get(name, (0.0,))[0]:
                best[name] = count, replace(pool[k], surface=surface)
    if not best:
        return None
    most = max(count for count, _ in best.values())
    return best[min(name for name in best if best[name][0] >= SIMPLE_ENOUGH * most)][1]


def _reaches(beside: Surface | None, points: Array, normals: Array) -> bool:
    """Whether points of a fillet go on to the cylinder that it touches."""
    if beside is None or len(points) < FEW:
        return beside is None
    return float(np.quantile(residuals(beside, points, normals)[1], REACHING)) < HALF_TURN


def _fitted(
    candidate: Candidate, points: Array, normals: Array, limit: float, settings: PrimitivesSettings
) -> Surface | None:
    """A candidate fitted to points in its free parameters."""
    if len(points) < FEW:
        return None
    start = candidate.surface
    if candidate.free == ():
        return start
    try:
        fitted = fit_robust(start.kind, points, normals, limit / REACH, initial=start, free=candidate.free)[0]
    except (ValueError, np.linalg.LinAlgError):
        return None
    if candidate.along is not None:
        fitted = upright(fitted, candidate.along, points)
    fitted = oriented(fitted, points, normals)
    return fitted if plausible(fitted, points, settings.largest_radius) else None
