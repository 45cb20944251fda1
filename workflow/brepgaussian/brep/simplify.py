"""Simpler hypotheses about a solid: fewer surfaces, or simpler ones, that the points explain nearly as well.

Points alone over-segment: a fringe of rounded-off points becomes a face of its own, one face comes in two patches,
a plane that bulges becomes a shallow cone. Here such changes are proposed generously; `trials` lets the images decide.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brepgaussian.brep.blends import Blend
from brepgaussian.brep.job import Job
from brepgaussian.brep.patches import Patch, neighbours, touch
from brepgaussian.geometry.fit_robust import fit_robust
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.primitives.relations import RESIDUALS

Array = NDArray[np.float64]

SIMPLER = {
    "plane": (),
    "cylinder": ("plane",),
    "sphere": ("plane",),
    "cone": ("plane", "cylinder"),
    "torus": ("plane", "cylinder", "cone", "sphere"),
}
COMPLEXITY = {"plane": 0, "cylinder": 1, "sphere": 1, "cone": 2, "torus": 3}
_QUANTILE = 0.7  # of distances: the rest may be wrong labels and rounded-off borders
_SIGMAS = 3.0  # noises, or own distances, within which the simpler surface must explain a patch
_WITHIN = 1.5  # noises that a simpler surface may be off those that the images have refined
_TURN = np.cos(np.radians(20.0))  # and its normals agree with those of the points, in the median
_TOUCH = 2.0  # of reach: patches this near to each other are neighbours
_MOST_FITTED = 1500  # points of a patch that a proposal is fitted to
_SMALL = 0.015  # of all points: larger patches are not left out
_HALF = 0.5  # of a small patch's points that others must explain
_TINY = 0.006  # of all points: so few may be all of a rounded-off inner edge,
_ROUNDED = 0.012  # unit frame: which stands off the faces beside it by up to the width of its fringe
_EQUAL = 0.1  # of a radius: fillets that are alike, and how far one may miss the wall that it touches
_ACROSS = np.sin(np.radians(5.0))  # between a wall's plane and its fillet's axis
_STRIP = 0.03  # of all points: planes that meet another one so bluntly that modelled faces hardly do,
_CHORD = 0.1  # radii by which a chord of a fillet lies off it, at most: over 50 degrees
_BLUNT = np.cos(np.radians(15.0))  # may be the flat start of a fillet


@dataclass(frozen=True)
class Change:
    """One simplification.

    Attributes:
        name: for the report.
        gone: indices of patches that it replaces.
        new: what takes their place; empty if they are left out.
        excused: share of all points that may leave the solid with them.
        smooth: whether the patches that it replaces are taken to meet smoothly.
        faint: whether these are too small for the images to tell their edges from that of a sharp corner.
    """

    name: str
    gone: tuple[int, ...]
    new: tuple[Patch, ...]
    excused: float = 0.0
    smooth: bool = False
    faint: bool = False


def proposals(patches: Sequence[Patch], noise: float, seed: int, refined: Sequence[Surface] = ()) -> list[Change]:
    """All changes that the points allow: merges of neighbours, then simpler kinds, then small patches left out.

    Args:
        patches: of the present solid.
        noise: of the points.
        seed: of the fits.
        refined: the patches' surfaces as the images have them: a cone that tapers less than the noise is a cylinder,
            although points that are rounded off at one end are not; two pieces whose points bend are one face.
    """
    rng = np.random.default_rng(seed)
    kinds = list(_kinds(patches, noise, rng))
    known = {i for change in kinds for i in change.gone}
    moved = [_on(patch, surface) for patch, surface in zip(patches, refined, strict=False)]
    straight = [c for c in _kinds(moved, noise, rng, _WITHIN) if c.gone[0] not in known]
    merges = list(_merges(patches, noise, rng))
    paired = {change.gone for change in merges}
    same = [c for c in _merges(moved, noise, rng, refined=True) if c.gone not in paired]
    return [*merges, *same, *kinds, *straight, *_drops(patches, noise)]


def _on(patch: Patch, surface: Surface) -> Patch:
    """A patch with its points moved onto its refined surface."""
    return replace(patch, surface=surface, xyz=surface.project(patch.xyz), normals=surface.normals(patch.xyz))


def applied(job: Job, changes: Sequence[Change]) -> Job:
    """The job after changes that share no patch; what was left out stays as evidence."""
    gone = {i for c in changes for i in c.gone}
    kept = [i for i in range(len(job.patches)) if i not in gone]
    patches = [job.patches[i] for i in kept]
    opened = [i in job.open_patches for i in kept]
    left_out = list(job.left_out)
    for change in changes:
        if not change.new:
            left_out += [job.patches[i] for i in change.gone]
        patches += change.new
        opened += [any(i in job.open_patches for i in change.gone)] * len(change.new)
    order = sorted(range(len(patches)), key=lambda k: patches[k].primitive)
    place = {kept[k]: i for i, k in enumerate(order) if k < len(kept)}
    blends = [b for b in job.blends if place.keys() >= {b.patch, *b.faces}]
    return replace(
        job,
        patches=tuple(patches[k] for k in order),
        open_patches=tuple(i for i, k in enumerate(order) if opened[k]),
        left_out=tuple(left_out),
        blends=tuple(Blend(place[b.patch], tuple(place[i] for i in b.faces)) for b in blends),
    )


def compatible(changes: Sequence[Change]) -> list[Change]:
    """The first changes of a list that share no patch."""
    taken: set[int] = set()
    result = []
    for change in changes:
        if not taken & set(change.gone):
            taken |= set(change.gone)
            result.append(change)
    return result


def complexity(surfaces: Sequence[Surface], faces: Sequence[int]) -> tuple[int, int]:
    """Number of faces and the sum of their surfaces' complexities; `faces` names the surface of each (-1: none)."""
    return len(faces), sum(COMPLEXITY[surfaces[i].kind] for i in set(faces) if i >= 0)


def _merges(
    patches: Sequence[Patch], noise: float, rng: np.random.Generator, refined: bool = False
) -> Iterator[Change]:
    """Neighbours that one surface explains, best first; pieces of one plane may lie apart, on either side of a slot.

    Patches that the images have `refined` have to be of one kind, and nearly one surface.
    """
    sigmas = _WITHIN if refined else _SIGMAS
    found: list[tuple[float, Change]] = []
    trees = [cKDTree(p.xyz) for p in patches]
    for i, j in combinations(range(len(patches)), 2):
        large, small = (i, j) if len(patches[i].xyz) >= len(patches[j].xyz) else (j, i)
        pair = [patches[large], patches[small]]
        first, second = (p.surface.kind for p in pair)
        if (refined and first != second) or not _alike(patches[large], patches[small], noise):
            continue
        if not first == second == "plane" and not touch(patches[small], patches[large], _TOUCH, trees[large]):
            continue
        for kind in (first,) if refined else (*SIMPLER[first], first, second):
            surface = fitted_to(kind, pair, noise, rng)
            if surface is not None and all(explains(surface, p, noise, sigmas) for p in pair):
                names = tuple(sorted((i, j)))
                cost = max(_typical(surface, p) / max(noise, 1e-9) for p in pair)
                name = f"patches {patches[names[0]].primitive} and {patches[names[1]].primitive} as one {kind}"
                found.append((cost, Change(name, names, (joined(surface, pair),))))
                break
    found.sort(key=lambda f: f[0])
    yield from (change for _, change in found)


def _alike(large: Patch, small: Patch, noise: float) -> bool:
    """Whether two patches may be one at all: the larger one's surface is not far from the smaller one."""
    off = float(np.median(np.abs(large.surface.signed_distance(small.xyz))))
    turn = float(np.median(np.einsum("ij,ij->i", large.surface.normals(small.xyz), small.normals)))
    return off < 2 * _SIGMAS * max(noise, large.sigma, small.sigma) and turn > _TURN


def _kinds(
    patches: Sequence[Patch], noise: float, rng: np.random.Generator, sigmas: float = _SIGMAS
) -> Iterator[Change]:
    """Patches that a simpler kind explains to within some noises; the simplest that does.

    A narrow ring of a torus may be one of a cone, as chamfers are, or of a sphere: the points cannot tell.
    """
    for index, patch in enumerate(patches):
        for kind in () if patch.made else SIMPLER[patch.surface.kind]:
            surface = fitted_to(kind, [patch], noise, rng)
            if surface is not None and explains(surface, patch, noise, sigmas):
                yield Change(f"patch {patch.primitive} as a {kind}", (index,), (joined(surface, [patch]),))
                if kind != "cone":
                    break


def _drops(patches: Sequence[Patch], noise: float) -> Iterator[Change]:
    """Small patches about whose points others say nearly as much, smallest first."""
    total = sum(len(p.xyz) for p in patches)
    for index in sorted(range(len(patches)), key=lambda k: len(patches[k].xyz)):
        patch = patches[index]
        if len(patch.xyz) > _STRIP * total:
            break
        beside = _beside(index, patches) if patch.surface.kind == "plane" else []
        strip = _starts_fillet(patch.surface, beside) or _cuts_fillet(patch, beside, patches)
        if (len(patch.xyz) > _SMALL * total and not strip) or _joins_fillets(patch.surface, beside):
            continue
        off = np.full(len(patch.xyz), np.inf)
        for other in (p for k, p in enumerate(patches) if k != index):
            reach = _TOUCH * max(patch.reach, other.reach) * 2
            near = cKDTree(other.xyz).query(patch.xyz, distance_upper_bound=reach)[0] <= reach
            off[near] = np.minimum(off[near], np.abs(other.surface.signed_distance(patch.xyz[near])))
        limit = max(_SIGMAS * noise, _ROUNDED if strip or len(patch.xyz) <= _TINY * total else 1e-9)
        if np.mean(off <= limit) >= _HALF:
            excused = len(patch.xyz) / total if strip else 0.0
            yield Change(f"without patch {patch.primitive}", (index,), (), excused)


def between_fillets(index: int, patches: Sequence[Patch]) -> bool:
    """Whether a plane goes over into fillets of one radius on two sides: without it they would cross."""
    own = patches[index].surface
    return own.kind == "plane" and _joins_fillets(own, _beside(index, patches))


def _beside(index: int, patches: Sequence[Patch]) -> list[Surface]:
    return [patches[k].surface for k in neighbours(index, patches)]


def _joins_fillets(flat: Surface, beside: Sequence[Surface]) -> bool:
    touching = [s for s in beside if s.kind == "cylinder" and _touches(flat, s)]
    return any(
        first.flipped == second.flipped
        and abs(first.radius - second.radius) < _EQUAL * first.radius
        and np.linalg.norm(np.cross(second.origin - first.origin, first.axis)) > first.radius
        for first, second in combinations(touching, 2)
    )


def _touches(flat: Surface, round_: Surface) -> bool:
    tilt, gap = np.abs(RESIDUALS["tangent"](flat, round_))
    return bool(tilt <= _ACROSS and gap < _EQUAL * round_.radius)


def _starts_fillet(flat: Surface, beside: Sequence[Surface]) -> bool:
    """Whether a plane lies between another one, hardly turned, and a curved face."""
    blunt = any(s.kind == "plane" and float(s.axis @ flat.axis) > _BLUNT for s in beside)
    return blunt and any(s.kind != "plane" for s in beside)


def _cuts_fillet(patch: Patch, beside: Sequence[Surface], patches: Sequence[Patch]) -> bool:
    """Whether a plane's points lie nearly on a hollow fillet beside it, which touches another plane past it.

    In the corner between two walls a hull is flat where no silhouette reaches: a chord of the fillet there.
    """
    planes = [p.surface for p in patches if p.surface.kind == "plane" and p is not patch]
    return any(
        s.kind == "cylinder"
        and s.flipped
        and float(np.median(np.abs(s.signed_distance(patch.xyz)))) < _CHORD * s.radius
        and sum(_touches(flat, s) for flat in planes) > 1
        for s in beside
    )


def fitted_to(kind: str, patches: Sequence[Patch], noise: float, rng: np.random.Generator) -> Surface | None:
    """A surface of one kind through patches; None if their points determine none."""
    xyz, normals = (np.concatenate([getattr(p, k) for p in patches]) for k in ("xyz", "normals"))
    return fitted(kind, xyz, normals, noise, rng, next((p.surface for p in patches if p.surface.kind == kind), None))


def fitted(
    kind: str, xyz: Array, normals: Array, noise: float, rng: np.random.Generator, start: Surface | None
) -> Surface | None:
    """A surface of one kind through some of (N, 3) points with normals; None if they determine none."""
    step = max(1, len(xyz) // _MOST_FITTED)
    try:
        return fit_robust(kind, xyz[::step], normals[::step], noise, initial=start, rng=rng)[0]
    except (ValueError, np.linalg.LinAlgError):
        return None


def _typical(surface: Surface, patch: Patch) -> float:
    return float(np.quantile(np.abs(surface.signed_distance(patch.xyz)), _QUANTILE))


def explains(surface: Surface, patch: Patch, noise: float, sigmas: float = _SIGMAS) -> bool:
    """Whether a surface is nearly as good for a patch as its own."""
    limit = sigmas * max(noise, _typical(patch.surface, patch))
    turn = np.einsum("ij,ij->i", surface.normals(patch.xyz), patch.normals)
    return _typical(surface, patch) <= limit and float(np.median(turn)) > _TURN


def joined(surface: Surface, patches: Sequence[Patch]) -> Patch:
    """Patches as one, on a surface."""
    xyz, normals = (np.concatenate([getattr(p, k) for p in patches]) for k in ("xyz", "normals"))
    sigma = surface.rms(xyz)
    reach, primitive = max(p.reach for p in patches), min(p.primitive for p in patches)
    return Patch(surface, primitive, xyz, normals, reach, sigma, whole=any(p.whole for p in patches))
