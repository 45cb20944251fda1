"""Choice of the kind of surface by evidence, not by residual alone."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.fit_refine import PARAMETERS
from brepgaussian.geometry.fit_robust import fit_robust, residuals
from brepgaussian.geometry.fit_start import MINIMUM
from brepgaussian.geometry.independence import observations, own_among, shared_errors
from brepgaussian.geometry.surfaces import KINDS, Surface

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

NORMAL_NOISE = np.radians(4.0)  # of surfels before averaging
EFFECTIVE = 20  # independent observations in a patch: surfel error is smooth, so 1000 points are not 1000 facts
# Residuals of the best kind that count as noise of the patch: no kind gains by less. A reconstruction's errors are
# smooth, and one more parameter explains half of a bulge: of 427 patches the kind is wrong in 38 with 1.15, 27 with
# 1.6, 24 with 1.8, 21 with 2.3; but from 1.8 countersinks and their throats pass for one cone, which no longer comes
# apart (`brep.profiles`), where up to 1.6 they are a torus, which does.
UNEXPLAINED = 1.6
KEPT = 0.9  # share of the points that judges a fit: wrong labels must not choose the kind
JUDGED = 40  # points from which a patch may speak about the noise
CUT = 3.5  # noises beyond which a point is a stray
TRIMMED = 0.789  # root mean square of the smallest 90 % of Gaussian magnitudes, in sigma
# What a kind costs in parameters: its own number, more for the sphere, which mechanical parts seldom have
# and which imitates any narrow band of a cone, more for the torus, which imitates any bulging cylinder.
PRICE = {**{k: float(v) for k, v in PARAMETERS.items()}, "sphere": 6.5, "torus": 9.0}
SHALLOW = np.radians(6.0)  # a cone that near to a cylinder or a plane is a rare draft or dish
SHALLOW_PRICE = 2.0  # parameters that it costs on top
MIN_TORUS_RATIO = 0.25  # radii of a torus; below it is a sphere with a dent
MAX_TORUS_RATIO = 100.0  # radii of a torus; beyond it the data cannot tell it from a cylinder
# A reconstructed plane bulges: a surface whose normals turn less on both sides of their mean is one.
FLAT_TURN = np.radians(6.0)
# In inner corners it bulges more; then it is one if its points lie as near to a plane as bulges of its width do.
BULGE_TURN = np.radians(10.0)
BULGE_SHARE, BULGE_MOST = 0.03, 0.004  # rms height over the width, and unit frame
LEAST_ARC = 0.003  # unit frame; height of an arc over its chord that the bulge of a cone's points does not make
NARROW_RING = np.radians(30.0)  # of a torus' profile; fillets turn by more
SLENDER, DISC = np.radians(2.0), np.radians(88.0)  # half angles: a slimmer cone must show that it tapers
LEAST_TAPER = 0.01  # unit frame; change of radius that the errors of a bore's points (a voxel) do not make
_TURN_QUANTILE = 0.95
_SMALL = 1e-12


@dataclass(frozen=True)
class Choice:
    """A surface and why it was chosen.

    Attributes:
        surface: the fit.
        inliers: (N,) points that it explains.
        rms: root mean square distance of the inliers.
        cost: description length in nats (twice the negative log likelihood plus the price of parameters).
        costs: the cost of every kind that was fitted (kinds that could not win any more are not).
    """

    surface: Surface
    inliers: Mask
    rms: float
    cost: float
    costs: dict[str, float]


def choose(
    points: Array,
    normals: Array,
    sigma: float,
    kinds: Sequence[str] = KINDS,
    normal_sigma: float = NORMAL_NOISE,
    own: float = 0.0,
    initial: Sequence[Surface] = (),
    rng: np.random.Generator | None = None,
    reach: float = np.inf,
) -> Choice:
    """Fit every kind robustly and keep the one with the shortest description.

    A kind costs `description_length`. Residuals below the noise earn nothing, so that every kind that
    explains the points to within the noise ties on the data and the fewest parameters win: a tiny patch
    of a big cylinder stays a plane, a slightly bent plane never becomes a huge cylinder. Where no kind
    reaches the noise, what the best one leaves is taken for the noise of this patch: a badly reconstructed
    face does not become the kind with the most parameters.

    Args:
        points: (N, 3).
        normals: (N, 3) outward unit normals.
        sigma: noise of the points (distance that is not worth explaining).
        kinds: the kinds tried.
        normal_sigma: noise of the normals, radians.
        own: share of the errors that is every point's own (`independence.own_share`), where it is so for the best kind.
        initial: further starts of any kind (a neighbour's axis, the surface of an earlier round).
        rng: as in `fit_robust`.
        reach: largest believable radius (the size of the object).

    Raises:
        ValueError: no kind could be fitted.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    own = own if len(points) >= JUDGED else 0.0
    count = observations(len(points), own, EFFECTIVE)
    known = noise_floors(sigma, normal_sigma, np.zeros((1, 2)), own)
    found: dict[str, tuple[float, Surface, Mask]] = {}
    for kind in sorted(kinds, key=lambda k: PRICE[k]):
        if len(points) < max(MINIMUM[kind], PARAMETERS[kind]):
            continue
        least = PRICE[kind] * np.log(max(count, 2))  # a perfect fit of this kind
        if any(cost <= least for cost, _, _ in found.values()):
            break
        for start in (None, *(s for s in initial if s.kind == kind)):
            try:
                surface, mask = fit_robust(kind, points, normals, sigma, initial=start, rng=rng)
            except (ValueError, np.linalg.LinAlgError):
                continue
            if not plausible(surface, points, reach, own):
                continue
            cost = description_length(surface, points, normals, *known, effective=count)
            if kind not in found or cost < found[kind][0]:
                found[kind] = cost, surface, mask
    if not found:
        raise ValueError(f"{len(points)} points determine none of {', '.join(kinds)}")
    spreads = np.array([misfit(f[1], points, normals) for f in found.values()])
    if own > 0:
        surface = list(found.values())[int(np.argmin(spreads.prod(axis=1)))][1]
        own = own_among(own, *shared_errors(surface, points, CUT * max(surface.rms(points), sigma)))
        count = observations(len(points), own, EFFECTIVE)
    floors = noise_floors(sigma, normal_sigma, spreads, own)
    costs = {k: description_length(f[1], points, normals, *floors, effective=count) for k, f in found.items()}
    best = min(found, key=lambda k: (costs[k], PRICE[k]))
    _, surface, mask = found[best]
    near = mask if mask.any() else np.ones(len(points), bool)
    rms = surface.rms(points[near])
    return Choice(surface, mask, rms, costs[best], costs)


def description_length(
    surface: Surface,
    points: Array,
    normals: Array,
    sigma: float,
    normal_sigma: float = NORMAL_NOISE,
    effective: float = EFFECTIVE,
) -> float:
    """Bayesian information criterion with noise floors: n log(s^2 / sigma^2) + n log(a^2 / normal_sigma^2) + k log n.

    s and a are the root mean squares of the best `KEPT` distances and angles, not below their noise; n is
    the number of points, at most `effective`; k the `PRICE` of the kind.
    """
    count = min(len(points), effective)
    return data_length(surface, points, normals, sigma, normal_sigma, count) + price(surface) * float(
        np.log(max(count, 2))
    )


def noise_floors(sigma: float, normal_sigma: float, misfits: Array, own: float) -> tuple[float, float]:
    """Distance and angle (`misfit`) below which residuals earn nothing.

    Smooth errors may make of them anything up to the noise and `UNEXPLAINED` times what the best kind leaves; errors of
    the points' own the noise as a `misfit` shows it, and what the best kind leaves. Variances add up.

    Args:
        sigma, normal_sigma: noise of the points and of their normals.
        misfits: (K, 2) of the kinds.
        own: share of the errors' variance that is every point's own.
    """
    known, left = np.sqrt(own * np.array([TRIMMED, 1.0]) ** 2 + (1 - own) * np.array([1.0, UNEXPLAINED]) ** 2)
    floors = np.maximum(known * np.array([sigma, normal_sigma]), left * misfits.min(axis=0))
    return float(floors[0]), float(floors[1])


def price(surface: Surface) -> float:
    """What a surface costs in parameters: `PRICE`, more for a cone that is nearly a cylinder or a plane."""
    shallow = surface.kind == "cone" and not SHALLOW < surface.angle < np.pi / 2 - SHALLOW
    return PRICE[surface.kind] + (SHALLOW_PRICE if shallow else 0.0)


def data_length(
    surface: Surface, points: Array, normals: Array, sigma: float, normal_sigma: float, count: float
) -> float:
    """The part of `description_length` that the residuals of `count` independent observations make."""
    far, turned = misfit(surface, points, normals)
    excess = max(far / max(sigma, _SMALL), 1.0) * max(turned / max(normal_sigma, _SMALL), 1.0)
    return float(2 * count * np.log(excess))


def misfit(surface: Surface, points: Array, normals: Array) -> tuple[float, float]:
    """Root mean squares of the smallest `KEPT` share of distances and of angles (radians)."""
    distance, turn = residuals(surface, points, normals)
    return _spread(distance), _spread(turn)


def plausible(surface: Surface, points: Array, reach: float = np.inf, own: float = 0.0) -> bool:
    """False for surfaces that no part has: nearly flat, a radius beyond `reach`, a needle or disc of a cone.

    A share `own` of the errors is every point's own; smooth ones make a bore taper.
    """
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    if not np.isfinite([*surface.origin, *surface.axis, surface.radius, surface.minor]).all():
        return False
    if surface.kind == "plane":
        return True
    if surface.radius + surface.minor > reach or _flat(surface, points):
        return False
    if surface.kind == "torus":
        ring = MIN_TORUS_RATIO * surface.minor < surface.radius < MAX_TORUS_RATIO * surface.minor
        return ring and surface.minor < 10 * extent and not _is_flat_ring(surface, points)
    if surface.kind == "cone" and not _tapers(surface, points, LEAST_TAPER * (1 - own)):
        return False
    if surface.kind == "sphere" and _is_band(surface, points):
        return False
    return surface.radius < 20 * extent


def _is_band(sphere: Surface, points: Array) -> bool:
    """Whether points are a band around a sphere that is too narrow to be told from a cone.

    Its axis is the direction along which its normals differ least; a cap, which holds the axis, is no band.
    """
    normals = sphere.normals(points)
    axis = np.linalg.eigh(np.cov(normals.T))[1][:, 0]
    low, high = np.quantile(np.arccos(np.clip(normals @ axis, -1, 1)), [1 - _TURN_QUANTILE, _TURN_QUANTILE])
    arc = high - low
    cap = min(low, np.pi - high) < arc
    return bool(not cap and sphere.radius * arc**2 / 8 < LEAST_ARC)


def _is_flat_ring(torus: Surface, points: Array) -> bool:
    """Whether points are a ring of a torus that is too narrow to be told from a cone or a plane."""
    offset = points - torus.origin
    height = offset @ torus.axis
    across = np.linalg.norm(offset - height[:, None] * torus.axis, axis=1)
    angle = np.arctan2(height, across - torus.radius)
    middle = np.arctan2(np.sin(angle).mean(), np.cos(angle).mean())
    off = np.arctan2(np.sin(angle - middle), np.cos(angle - middle))
    arc = float(np.ptp(np.quantile(off, [1 - _TURN_QUANTILE, _TURN_QUANTILE])))
    return bool(arc < NARROW_RING and torus.minor * arc**2 / 8 < LEAST_ARC)


def _tapers(cone: Surface, points: Array, least: float) -> bool:
    """Whether a cone is no disc, and no cylinder whose points are off by a little (`least`) more at one end."""
    if cone.angle >= DISC:
        return False
    return bool(cone.angle > SLENDER or np.tan(cone.angle) * np.ptp(points @ cone.axis) > least)


def _flat(surface: Surface, points: Array) -> bool:
    """Whether the piece of a surface that points lie on may as well be a plane that bulges."""
    turn = turn_of(surface, points)
    if turn >= BULGE_TURN:
        return False
    if turn < FLAT_TURN:
        return True
    feet = surface.project(points)  # without the points' noise, which is no bulge
    centred = feet - feet.mean(axis=0)
    height, width, _ = np.sqrt(np.maximum(np.linalg.eigvalsh(centred.T @ centred / len(points)), 0))
    return bool(height < min(BULGE_SHARE * np.sqrt(12) * width, BULGE_MOST))


def turn_of(surface: Surface, points: Array) -> float:
    """Angle (radians) from their mean within which nearly all of a surface's normals at some points lie."""
    normals = surface.normals(points)
    mean = normals.mean(axis=0)
    length = float(np.linalg.norm(mean))
    if length < _SMALL:
        return float(np.pi)
    return float(np.quantile(np.arccos(np.clip(normals @ mean / length, -1, 1)), _TURN_QUANTILE))


def _spread(values: Array) -> float:
    """Root mean square of the smallest `KEPT` share."""
    count = max(1, int(np.ceil(KEPT * len(values))))
    return float(np.sqrt(np.mean(np.partition(values, count - 1)[:count] ** 2)))
