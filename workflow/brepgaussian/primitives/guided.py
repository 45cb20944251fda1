"""Surfaces along known directions and axes: what a patch may be, given what its neighbours surely are.

A cylinder along the normal of a well-known plane has three free parameters instead of five, a cone about a
known axis two instead of six. So the description length, which charges free parameters and one number per
choice among the known directions, prefers the regular surface unless the points speak against it: on badly
reconstructed patches free fits wander off into tori, guided ones stay with the design.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.fit import (
    cone_about,
    cylinder_about,
    data_length,
    fit_robust,
    misfit,
    oriented,
    plausible,
    torus_about,
)
from brepgaussian.geometry.fit_choose import EFFECTIVE, noise_floors, price
from brepgaussian.geometry.fit_refine import PARAMETERS
from brepgaussian.geometry.independence import observations
from brepgaussian.geometry.surfaces import Surface, plane, sphere
from brepgaussian.log import get_logger
from brepgaussian.primitives.patches import Cloud, Noise, Patch, clear_of_edges, own_errors, thinned
from brepgaussian.primitives.propose import State
from brepgaussian.primitives.relations import axis_gap
from brepgaussian.settings.primitives import PrimitivesSettings

Array = NDArray[np.float64]
log = get_logger("primitives")

SURE = 1.5  # noises: a patch that fits worse gives no direction
SURE_TILT = np.radians(1.5)  # nor one that knows its direction worse
MOST = 12  # directions and axes tried
SAME_RADIUS = 2.0  # noises between radii that are one
SAME_AXIS = 3.0  # noises between axes that are one
FACING = np.radians(20.0)  # largest angle of a patch's mean normal from a direction that its plane may have
ACROSS = np.radians(30.0)  # largest median angle of normals from the plane across a cylinder's direction
# Free parameters of what may be tried, and the columns of the local parameters that they are.
ALONG = {"cylinder": (0, 1, 4), "cone": (0, 1, 4, 5)}
WALL = 2.0  # free parameters of a plane along a known direction: its turn about it and its height
SIBLING = (0, 1)  # a cylinder of known radius and direction, as the holes of a bolt circle
ABOUT = {"cylinder": (4,), "cone": (4, 5), "torus": (2, 5, 6), "sphere": (3,)}


@dataclass(frozen=True)
class Known:
    """Directions (unit vectors), axes (surfaces of revolution) and cylinders that are well known, best first."""

    directions: list[Array]
    axes: list[Surface]
    cylinders: list[Surface]


def known(patches: list[Patch], state: State) -> Known:
    """Distinct directions of patches that fit well, and distinct axes among them."""
    noise = state.noise
    sure = [
        i
        for i, p in enumerate(patches)
        if p.surface.kind != "sphere"
        and max(p.rms / noise.distance, p.turn / noise.turn) < SURE
        and state.tilt_error(i) < SURE_TILT
    ]
    sure.sort(key=lambda i: (state.tilt_error(i), i))
    directions: list[Array] = []
    axes: list[Surface] = []
    for i in sure:
        surface = patches[i].surface
        limit = np.cos(max(state.angle_tolerance(i, i), SURE_TILT))
        if all(abs(float(d @ surface.axis)) < limit for d in directions):
            directions.append(surface.axis)
        if surface.kind != "plane" and all(
            abs(float(a.axis @ surface.axis)) < limit or axis_gap(a, surface) > SAME_AXIS * noise.distance for a in axes
        ):
            axes.append(surface)
    cylinders: list[Surface] = []
    for surface in (patches[i].surface for i in sure if patches[i].surface.kind == "cylinder"):
        if all(_unlike(surface, other, noise) for other in cylinders):
            cylinders.append(surface)
    return Known(directions[:MOST], axes[:MOST], cylinders[:MOST])


def _unlike(first: Surface, second: Surface, noise: Noise) -> bool:
    """Whether two cylinders differ in radius, side or direction."""
    parallel = abs(float(first.axis @ second.axis)) > np.cos(SURE_TILT)
    near = abs(first.radius - second.radius) < SAME_RADIUS * noise.distance
    return not (parallel and near and first.flipped == second.flipped)


def guide(
    patches: list[Patch], sources: Known, cloud: Cloud, noise: Noise, settings: PrimitivesSettings
) -> list[Patch]:
    """Replace the surface of a patch where one along a known direction describes it in fewer words."""
    if not sources.directions:
        return patches
    result = []
    for patch in patches:
        surface = _shortest(patch, sources, cloud, noise, settings)
        if surface is not patch.surface:
            changed = patch.on(surface, cloud)
            if surface.kind != patch.surface.kind:
                log.info("labels %s: %s instead of %s", list(patch.labels), surface.kind, patch.surface.kind)
            patch = changed
        result.append(patch)
    return result


def _shortest(patch: Patch, sources: Known, cloud: Cloud, noise: Noise, settings: PrimitivesSettings) -> Surface:
    some = thinned(clear_of_edges(cloud, patch.members), settings.sample)
    points, normals = cloud.xyz[some], cloud.normals[some]
    whole = cloud.xyz[patch.members]  # its rounded borders tell, too, how far a face turns
    candidates = [(patch.surface, price(patch.surface), 1), *_along(patch.surface, sources)]
    for start, free, choices in _starts(points, normals, sources):
        if start.kind not in settings.kinds:
            continue
        try:
            start = fit_robust(start.kind, points, normals, noise.distance, initial=start, free=free)[0]
        except (ValueError, np.linalg.LinAlgError):
            continue
        start = oriented(start, points, normals)
        if any(plausible(start, some_of_it, settings.largest_radius) for some_of_it in (points, whole)):
            rarity = price(start) - PARAMETERS[start.kind]  # as in a free choice
            candidates.append((start, len(free) + rarity, choices))
    misfits = np.array([misfit(s, points, normals) for s, _, _ in candidates])
    if noise.own > 0:  # the errors of the best candidate may be smooth where others' are not
        best = candidates[int(np.argmin(misfits.prod(axis=1)))][0]
        patch = patch.on(best, cloud)
        # where points tell kinds apart, none is likelier because few of its sort are known
        candidates = [(s, price, len(candidates)) for s, price, _ in candidates]
    own = own_errors(patch, cloud, noise)
    count = min(observations(len(patch.members), own, EFFECTIVE), len(points))
    floors = noise_floors(noise.distance, noise.turn, misfits, own)
    costs = [
        data_length(s, points, normals, *floors, count=count) + price * np.log(max(count, 2)) + 2 * np.log(choices)
        for s, price, choices in candidates
    ]
    return candidates[int(np.argmin(costs))][0]


def _along(surface: Surface, sources: Known) -> Iterator[tuple[Surface, float, int]]:
    """A plane turned until a known direction runs along it, with its free parameters, and among how many it is chosen.

    Its turn about the direction and its height are those of the free fit.
    """
    for direction in sources.directions if surface.kind == "plane" else ():
        lean = float(surface.axis @ direction)
        if abs(lean) < np.sin(FACING):
            yield plane(surface.origin, surface.axis - lean * direction), WALL, len(sources.directions)


def _starts(points: Array, normals: Array, sources: Known) -> Iterator[tuple[Surface, tuple[int, ...], int]]:
    """Guided surfaces: start, free columns, and among how many it is chosen."""
    share = np.full(len(points), 1 / len(points))
    mean, median = np.mean(normals, axis=0), np.median(normals, axis=0)
    number = len(sources.directions)
    for direction in sources.directions:
        facing = float(median @ direction)
        if abs(facing) > np.cos(FACING) * max(float(np.linalg.norm(median)), 1e-12):
            axis = np.copysign(1.0, facing) * direction
            height = float(np.median(points @ axis))
            middle = points.mean(0)
            yield plane(middle + (height - middle @ axis) * axis, axis), (2,), number
        slope = float(np.median(np.abs(normals @ direction)))
        if slope < np.sin(ACROSS):
            start = cylinder_about(direction, points, normals, share)
            if start is not None:
                yield start, ALONG["cylinder"], number
        if abs(float(mean @ direction)) < 0.95:
            start = cone_about(direction, points, normals, share)
            if start is not None:
                yield start, ALONG["cone"], number
    for sibling in sources.cylinders:
        start = cylinder_about(sibling.axis, points, normals, share)
        if start is not None and start.flipped == sibling.flipped and 0.5 < start.radius / sibling.radius < 2:
            yield replace(start, radius=sibling.radius), SIBLING, len(sources.cylinders)
    for axis in sources.axes:
        yield from _about(axis, points, normals, share, len(sources.axes))


def _about(
    line: Surface, points: Array, normals: Array, share: Array, choices: int
) -> Iterator[tuple[Surface, tuple[int, ...], int]]:
    """Surfaces of revolution about a known axis, if the normals meet it."""
    offset = points - line.origin
    sideways = np.cross(line.axis, offset)
    sideways /= np.maximum(np.linalg.norm(sideways, axis=1, keepdims=True), 1e-12)
    if float(np.median(np.abs((sideways * normals).sum(1)))) > np.sin(ACROSS / 2):
        return
    makers = {"cylinder": cylinder_about, "cone": cone_about, "torus": torus_about}
    for kind, make in makers.items():
        start = make(line.axis, points, normals, share, line.origin)
        if start is not None:
            yield start, ABOUT[kind], choices
    centre = float(_crossing(offset, normals, line.axis))
    middle = line.origin + centre * line.axis
    radius = float(np.median(np.linalg.norm(points - middle, axis=1)))
    if radius > 0:
        yield sphere(middle, radius), ABOUT["sphere"], choices


def _crossing(offset: Array, normals: Array, axis: Array) -> float:
    """Median height on the axis at which the normal lines pass it."""
    across = offset - (offset @ axis)[:, None] * axis
    side = normals - (normals @ axis)[:, None] * axis
    length = (side**2).sum(1)
    reach = (across * side).sum(1) / np.maximum(length, 1e-12)
    return float(np.median(offset @ axis - reach * (normals @ axis)))
