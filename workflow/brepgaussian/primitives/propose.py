"""Which relations the fits suggest, kind by kind; each is a `Link` with how far off the fits are."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brepgaussian.geometry.fit import PARAMETERS
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.primitives.patches import Noise
from brepgaussian.primitives.relations import ANGLES_DEG, TANGENT_PAIRS, Link, axis_gap, direction_angle, ends_tube
from brepgaussian.primitives.solve import significance
from brepgaussian.settings.primitives import PrimitivesSettings

Array = NDArray[np.float64]

USUAL_NOISE = 0.003  # unit frame; the noise that the floors of the tolerances are meant for
TILTS = {"plane": slice(0, 2), "cylinder": slice(2, 4), "cone": slice(2, 4), "torus": slice(3, 5)}
RADIUS_SHARE = 0.15  # of a radius; radii further apart are not equal however badly they are known
GAP_CAP = 4.0  # noises: axes further apart are not one
LENGTH_FLOOR = 1.5  # noises: lengths that near are never told apart by smooth errors
LENGTH_CAP = 5.0
SAME_CAP = 2.0  # noises: a larger step between two planes is a real one
CERTAIN = 3.0  # standard deviations
_USUAL = {f"angle_{a}": a for a in ANGLES_DEG}
CHANCE = 3.0  # times as many pairs at an angle as random directions would give make it a design
ANGLE_SHARE = 0.5  # of the tolerance of right angles: 30, 45 and 60 degrees are rarer


@dataclass(frozen=True)
class State:
    """Surfaces with their covariances, the noise and which patches touch.

    Attributes:
        surfaces: one a patch; covariances: (P, P) of their local parameters; sizes: points of each patch;
        touching: (N, N) bool; noise; settings; spreads: rms distance of each patch's points from its surface;
        ending: (N, N) bool, where one ends at what would touch it if its points went on.
    """

    surfaces: list[Surface]
    covariances: list[Array]
    sizes: list[int]
    touching: NDArray[np.bool_]
    noise: Noise
    settings: PrimitivesSettings
    spreads: list[float]
    ending: NDArray[np.bool_]

    def tilt_error(self, i: int) -> float:
        """Standard deviation of a patch's direction, radians."""
        block = self.covariances[i][TILTS[self.surfaces[i].kind], TILTS[self.surfaces[i].kind]]
        return float(np.sqrt(np.linalg.eigvalsh(block)[-1]))

    def length_error(self, i: int, column: int) -> float:
        """Standard deviation of one length parameter."""
        return float(np.sqrt(self.covariances[i][column, column]))

    def by_error(self, members: Sequence[int], column: int) -> list[int]:
        """Patches, the one whose length parameter is known best first."""
        return sorted(members, key=lambda i: (self.length_error(i, column), i))

    def joint_error(self, i: int, j: int, column: int) -> float:
        """Standard deviation of the difference of one parameter of two patches of a kind."""
        return float(np.hypot(self.length_error(i, column), self.length_error(j, column)))

    def angle_tolerance(self, i: int, j: int) -> float:
        """Largest angle at which two directions count as parallel, radians."""
        own = CERTAIN * float(np.hypot(self.tilt_error(i), self.tilt_error(j)))
        floor = np.radians(self.settings.angle_floor_deg) * min(1.0, self.noise.distance / USUAL_NOISE)
        return float(np.clip(own, floor, np.radians(self.settings.angle_cap_deg)))

    def may_be_parallel(self, i: int, j: int, angle: float) -> bool:
        """Whether two directions at an angle (radians) differ by no more than is believable about the axis they turn.

        A narrow wall knows its direction along its length better than `tilt_error`, which is the worst of all.
        """
        if angle < np.radians(self.settings.angle_floor_deg):
            return True
        two = np.sqrt(2) * significance(Link("parallel", i, j), self.surfaces, self.covariances)  # both angles together
        return two < CERTAIN

    def length_tolerance(self, error: float, cap: float = LENGTH_CAP, between: tuple[int, ...] = ()) -> float:
        """Largest difference of two lengths that counts as none, for their joint standard deviation.

        Some faces are known better than others: `between` names patches whose own noise counts where it is larger.
        """
        sigma = max([self.noise.distance, *(self.spreads[i] for i in between)])
        return float(np.clip(CERTAIN * error, LENGTH_FLOOR * sigma, cap * sigma))


def clustered(
    order: Sequence[int], off: Callable[[int, int], float | None], leads: Callable[[int], bool] = lambda _: True
) -> tuple[list[tuple[int, int]], list[int]]:
    """Pairs of a cluster's first member and another, which is nearest to that one, and all first members.

    Args:
        order: of members, the most certain first.
        off: by how much a member is off a first one; None = too much.
        leads: whether a member may be the first of others.
    """
    pairs, heads = [], list[int]()
    for i in order:
        near = [(gap, h) for h in heads if (gap := off(h, i)) is not None]
        if near:
            pairs.append((min(near)[1], i))
        elif leads(i):
            heads.append(i)
    return pairs, heads


def directions(state: State) -> list[Link]:
    """Parallel members of each cluster of directions, and right or usual angles between the clusters."""
    having = [i for i, s in enumerate(state.surfaces) if s.kind != "sphere"]
    having.sort(key=lambda i: (state.tilt_error(i), i))

    def turned(h: int, i: int) -> float | None:
        angle = direction_angle(state.surfaces[h], state.surfaces[i])
        return angle if angle < state.angle_tolerance(h, i) and state.may_be_parallel(h, i, angle) else None

    pairs, heads = clustered(having, turned)
    links = [Link("parallel", h, i) for h, i in pairs]
    return links + _angles(state, heads, {"perpendicular": 90}, 1.0) + _angles(state, heads, _USUAL, ANGLE_SHARE)


def _angles(state: State, heads: list[int], targets: dict[str, int], share: float) -> list[Link]:
    """Pairs of directions at given angles, if they are more than chance would give.

    The angle of two random directions is within t of a target a with probability 2 t sin(a) (t at 90 degrees).
    """
    links: list[Link] = []
    expected = 0.0
    for n, i in enumerate(heads):
        for j in heads[:n]:
            angle = direction_angle(state.surfaces[i], state.surfaces[j])
            limit = share * state.angle_tolerance(i, j)
            for name, degrees in targets.items():
                expected += limit * (1 if degrees == 90 else 2) * float(np.sin(np.radians(degrees)))
                if abs(np.radians(degrees) - angle) < limit:
                    links.append(Link(name, j, i))
    return links if len(links) > CHANCE * expected else []


def coaxial(state: State) -> list[Link]:
    """Axes that coincide, each tied to the most certain one; centres of spheres on axes."""
    round_ = [i for i, s in enumerate(state.surfaces) if s.kind in ("cylinder", "cone", "torus")]
    round_.sort(key=lambda i: (state.tilt_error(i), i))
    round_ += [i for i, s in enumerate(state.surfaces) if s.kind == "sphere"]

    def apart(h: int, i: int) -> float | None:
        sphere = state.surfaces[i].kind == "sphere"
        if not sphere and direction_angle(state.surfaces[h], state.surfaces[i]) > state.angle_tolerance(h, i):
            return None
        gap = axis_gap(state.surfaces[h], state.surfaces[i])
        error = max(state.joint_error(h, i, 0), state.joint_error(h, i, 1))
        return gap if gap < state.length_tolerance(error, GAP_CAP) else None

    pairs, _ = clustered(round_, apart, lambda i: state.surfaces[i].kind != "sphere")
    return [Link("coaxial", h, i) for h, i in pairs]


def equal_radii(state: State) -> list[Link]:
    """Cylinders, spheres and tubes of tori of one radius, each tied to the most certain of its cluster."""
    links = []
    for kind, column in (("cylinder", 4), ("sphere", 3), ("torus", 6)):

        def differs(h: int, i: int, column: int = column) -> float | None:
            radii = [_radius(state.surfaces[k]) for k in (h, i)]
            limit = min(state.length_tolerance(state.joint_error(h, i, column)), RADIUS_SHARE * min(radii))
            return gap if (gap := abs(radii[0] - radii[1])) < limit else None

        for flipped in (False, True):
            group = [i for i, s in enumerate(state.surfaces) if s.kind == kind and s.flipped == flipped]
            pairs, _ = clustered(state.by_error(group, column), differs)
            links += [Link("equal_radius", h, i) for h, i in pairs]
    return links


def same(state: State) -> list[Link]:
    """Patches on one analytic surface with the same outward side, lying apart or not."""
    order = sorted(range(len(state.surfaces)), key=lambda i: (-state.sizes[i], i))
    heads: list[int] = []
    links = []
    for i in order:
        match = next((h for h in heads if _one_surface(state, h, i)), None)
        if match is None:
            heads.append(i)
        else:
            links.append(Link("same", match, i))
    return links


def tangent(state: State) -> list[Link]:
    """Neighbours that meet without an edge, and what ends as if they did."""
    links = []
    for i, j in zip(*np.nonzero(np.triu(state.touching | state.ending)), strict=True):
        pair = state.surfaces[i], state.surfaces[j]
        if frozenset(s.kind for s in pair) not in TANGENT_PAIRS:
            continue
        link = Link("tangent", int(i), int(j))
        if _may_touch(state, link):
            links.append(link)
    return links


def bends(state: State) -> list[Link]:
    """Pipes that go on in a bend beside them."""
    links = []
    for i, j in zip(*np.nonzero(np.triu(state.touching)), strict=True):
        pair = state.surfaces[i], state.surfaces[j]
        if {s.kind for s in pair} != {"cylinder", "torus"} or pair[0].flipped != pair[1].flipped:
            continue
        link = Link("bend", int(i), int(j))
        tilt, *gaps = np.abs(link.residual(*pair))
        limit = state.length_tolerance(_length_error(state, link), between=(link.first, link.second))
        if tilt < np.sin(state.angle_tolerance(link.first, link.second)) and max(gaps) < limit:
            links.append(link)
    return links


def _length_error(state: State, link: Link) -> float:
    """Standard deviation of the lengths of two surfaces."""
    worst = (np.diag(state.covariances[k])[_lengths(k, state)].max() for k in (link.first, link.second))
    return float(np.hypot(*(np.sqrt(max(v, 0.0)) for v in worst)))


def _may_touch(state: State, link: Link) -> bool:
    """Angles within their tolerance and the gap within that of lengths; both on one side of the material."""
    first, second = state.surfaces[link.first], state.surfaces[link.second]
    if _back_to_back(first, second):
        return False
    value = link.residual(first, second)
    error = _length_error(state, link)
    gap, between = abs(float(value[-1])), (link.first, link.second)
    if gap > state.length_tolerance(error, between=between):
        return False
    if len(value) == 1:
        return True
    if first.kind == "sphere" or second.kind == "sphere":
        return float(np.linalg.norm(value[:-1])) < state.length_tolerance(error, between=between)
    tilt = float(np.linalg.norm(value[: 1 if len(value) == 2 else 3]))
    if tilt > state.angle_tolerance(link.first, link.second):
        return False
    return len(value) < 7 or float(np.linalg.norm(value[3:6])) < state.length_tolerance(error, GAP_CAP, between)


def _back_to_back(first: Surface, second: Surface) -> bool:
    """Whether surfaces would touch with opposite normals: a thin wall, not a smooth edge."""
    if {first.kind, second.kind} == {"torus", "sphere"}:
        ring, ball = (first, second) if first.kind == "torus" else (second, first)
        apart = float(np.hypot((ball.origin - ring.origin) @ ring.axis, ring.radius))
        beside = not ends_tube(ring, ball) and apart > max(ball.radius, ring.minor)
        return (ring.flipped == ball.flipped) == beside
    if {first.kind, second.kind} == {"cone", "sphere"}:
        return first.flipped != second.flipped
    flat, round_ = (first, second) if first.kind == "plane" else (second, first)
    if flat.kind != "plane" or round_.kind not in ("cylinder", "sphere"):
        return False
    contact = flat.project(round_.origin[None])
    return bool(flat.normals(contact)[0] @ round_.normals(contact)[0] < 0)


def _lengths(i: int, state: State) -> list[int]:
    kind = state.surfaces[i].kind
    tilts = range(*TILTS[kind].indices(PARAMETERS[kind])) if kind in TILTS else ()
    return [c for c in range(PARAMETERS[kind]) if c not in tilts and not (kind == "cone" and c == 5)]


def _one_surface(state: State, i: int, j: int) -> bool:
    first, second = state.surfaces[i], state.surfaces[j]
    if first.kind != second.kind or first.flipped != second.flipped:
        return False
    limit = state.length_tolerance(0.5 * state.noise.distance, SAME_CAP)
    if first.kind == "plane":
        if first.axis @ second.axis < 0 or direction_angle(first, second) > state.angle_tolerance(i, j):
            return False
        heights = (second.origin - first.origin) @ first.axis, (second.origin - first.origin) @ second.axis
        return bool(max(map(abs, heights)) < limit)
    if first.kind == "sphere":
        return float(np.linalg.norm(second.origin - first.origin)) < limit and abs(first.radius - second.radius) < limit
    if direction_angle(first, second) > state.angle_tolerance(i, j) or axis_gap(first, second) > limit:
        return False
    lift = float((second.origin - first.origin) @ first.axis)
    if first.kind == "cone":
        if first.axis @ second.axis < 0:
            return False
        there = first.radius + lift * np.tan(first.angle)
        turned = abs(first.angle - second.angle)
        return abs(there - second.radius) < limit and turned < state.angle_tolerance(i, j)
    if abs(first.radius - second.radius) > limit:
        return False
    return first.kind == "cylinder" or (abs(lift) < limit and abs(first.minor - second.minor) < limit)


def _radius(surface: Surface) -> float:
    return surface.minor if surface.kind == "torus" else surface.radius
