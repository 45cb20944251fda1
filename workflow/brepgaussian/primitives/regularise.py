"""Snapping of the patches' surfaces to the relations that hold between them.

Order: directions, coaxial axes, equal radii, angles and cones, patches of one surface, tangency. After each kind
all surfaces are solved on their points with all relations so far as equations; a patch that its points then
leave takes the relations back that moved it.
"""

from collections.abc import Callable

import numpy as np

from brepgaussian.artifacts.primitives import Relation
from brepgaussian.geometry.fit import oriented
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.log import get_logger
from brepgaussian.primitives import cones, propose
from brepgaussian.primitives.corners import meet
from brepgaussian.primitives.ends import end_at
from brepgaussian.primitives.patches import Cloud, Noise, Patch, adjacent, spreads
from brepgaussian.primitives.propose import State
from brepgaussian.primitives.relations import Link
from brepgaussian.primitives.solve import EFFECTIVE, Evidence, covariance, gather, significance, solve
from brepgaussian.settings.primitives import PrimitivesSettings

log = get_logger("primitives")

STEPS: tuple[tuple[str, Callable[[State], list[Link]]], ...] = (
    ("directions", propose.directions),
    ("coaxial", propose.coaxial),
    ("equal radii", propose.equal_radii),
    ("equal angles", cones.equal_angles),
    ("usual angles", cones.usual_angles),
    ("equal cones", cones.equal_cones),
    ("tangent", propose.tangent),
    ("bends", propose.bends),
    ("one surface", propose.same),
)
MOST_SPREAD = 3.0  # noises: a patch with more is misfitted, not noisy
WORSE = 1.2  # times its own residual that a patch may have after snapping
BALANCED = 1.1  # product of both ratios below which a worse distance is made up for by better normals
ALLOWED = 1.45  # noises that any patch may have: three standard deviations of `solve.EFFECTIVE` observations
MOST_UNDONE = 40  # relations taken back in one step
HELD = 1e-6  # a relation with a larger residual after the solve contradicts the others


def state_of(
    patches: list[Patch],
    cloud: Cloud,
    noise: Noise,
    settings: PrimitivesSettings,
    evidence: list[Evidence] | None = None,
) -> State:
    """Surfaces with their covariances (cautious ones unless `evidence` says how much is known) and contacts."""
    evidence = [gather(p, cloud, noise, cautious=True) for p in patches] if evidence is None else evidence
    surfaces = [p.surface for p in patches]
    covariances = [covariance(s, e) for s, e in zip(surfaces, evidence, strict=True)]
    touching = adjacent(patches, cloud)
    sizes, spread = [len(p.members) for p in patches], [min(p.rms, MOST_SPREAD * noise.distance) for p in patches]
    return State(surfaces, covariances, sizes, touching, noise, settings, spread, end_at(patches, cloud))


class Snapping:
    """Patches, their free fits and the relations kept so far."""

    def __init__(self, patches: list[Patch], cloud: Cloud, noise: Noise, settings: PrimitivesSettings) -> None:
        self.cloud, self.noise, self.settings = cloud, noise, settings
        self.patches = list(patches)
        self.free = [p.surface for p in patches]
        self.evidence: list[Evidence] = [gather(p, cloud, noise) for p in patches]
        self.before = [(p.rms, p.turn) for p in patches]
        self.links: list[Link] = []
        self.residuals: dict[Link, float] = {}

    def state(self) -> State:
        """The present surfaces as the proposals need them."""
        return state_of(self.patches, self.cloud, self.noise, self.settings, self.evidence)

    def add(self, name: str, proposed: list[Link]) -> list[Link]:
        """Solve with more relations, take back those that the points or the other relations refuse."""
        surfaces = [p.surface for p in self.patches]
        covariances = [covariance(s, e) for s, e in zip(surfaces, self.evidence, strict=True)]
        strength = {link: significance(link, surfaces, covariances) for link in proposed if link not in self.links}
        fresh = sorted(strength, key=lambda k: (strength[k], k.first, k.second, k.kind))
        undone = 0
        while fresh:
            solved, left = solve(self.free, self.evidence, self.links + fresh)
            refused = self._refused(solved, left, fresh)
            if not refused:
                break
            worst = max(refused, key=lambda k: (strength[k], k.first, k.second, k.kind))
            fresh.remove(worst)
            undone += 1
            if undone > MOST_UNDONE:
                fresh = []
        if fresh:
            self._accept(solved, fresh, surfaces)
        log.info("%s: %d of %d relations kept", name, len(fresh), len(strength))
        return fresh

    def _accept(self, solved: list[Surface], fresh: list[Link], surfaces: list[Surface]) -> None:
        for link in fresh:
            self.residuals[link] = float(np.abs(link.residual(surfaces[link.first], surfaces[link.second])).max())
        self.links += fresh
        self.patches = [self._on(p, s) for p, s in zip(self.patches, solved, strict=True)]

    def _on(self, patch: Patch, surface: Surface) -> Patch:
        some = self.cloud.xyz[patch.members], self.cloud.normals[patch.members]
        return patch.on(oriented(surface, *some), self.cloud)

    def _refused(self, solved: list[Surface], left: np.ndarray, fresh: list[Link]) -> list[Link]:
        """Fresh relations of patches that left their points, or that do not hold."""
        broken = [link for link, value in zip(self.links + fresh, left, strict=True) if value > HELD]
        if broken:
            touched = {i for link in broken for i in (link.first, link.second)}
        else:
            touched = {i for link in fresh for i in (link.first, link.second)}
            touched = {i for i in touched if self._left_its_points(i, solved[i])}
        return [link for link in fresh if link.first in touched or link.second in touched]

    def _left_its_points(self, i: int, surface: Surface) -> bool:
        patch = self._on(self.patches[i], surface)
        rms, turn = spreads(patch.surface, self.cloud, patch.members)
        old_rms, old_turn = self.before[i]
        # the limits are meant for errors that span the whole patch; independent ones tell more
        share = float(np.sqrt(min(EFFECTIVE / self.evidence[i].count, 1.0)))
        worse, allowed = (1 + share * (v - 1) for v in (WORSE, ALLOWED))
        further = rms / max(old_rms, allowed / worse * self.noise.distance)
        turned = turn / max(old_turn, ALLOWED / WORSE * self.noise.turn)
        # what fits the normals better may fit the positions a little worse, and the other way round
        balanced = further * turned < 1 + share * (BALANCED - 1)
        return further > (worse**2 if balanced else worse) or turned > (WORSE**2 if balanced else WORSE)


def regularise(
    patches: list[Patch], cloud: Cloud, noise: Noise, settings: PrimitivesSettings
) -> tuple[list[Patch], tuple[Relation, ...]]:
    """Find the relations between the patches' surfaces and make them hold.

    Args:
        patches: fitted patches.
        cloud: the points.
        noise: of the points.
        settings: of the stage.

    Returns:
        The patches with snapped surfaces, those of one surface joined, and the relations kept; a relation's
        residual is the largest of its equations before it was enforced (unit frame or radians).
    """
    snapping = Snapping(patches, cloud, noise, settings)
    joined: list[Link] = []
    for name, proposals in STEPS:
        fresh = snapping.add(name, proposals(snapping.state()))
        if proposals is propose.same:
            joined = fresh
    patches, relations = _joined(snapping, joined)
    return meet(patches, relations, cloud, noise)[0], relations


def _joined(snapping: Snapping, links: list[Link]) -> tuple[list[Patch], tuple[Relation, ...]]:
    """Patches of one surface become one patch; the relations are renumbered."""
    head = {link.second: link.first for link in links}
    kept = [i for i in range(len(snapping.patches)) if i not in head]
    place = {i: n for n, i in enumerate(kept)}
    patches = []
    for i in kept:
        group = [snapping.patches[i], *(snapping.patches[j] for j, h in head.items() if h == i)]
        labels = tuple(sorted({v for p in group for v in p.labels}))
        members = np.unique(np.concatenate([p.members for p in group]))
        rms, turn = spreads(group[0].surface, snapping.cloud, members)
        patches.append(Patch(labels, members, group[0].surface, rms, turn))
    relations: dict[tuple[str, int, int], float] = {}
    for link in snapping.links:
        ends = place[head.get(link.first, link.first)], place[head.get(link.second, link.second)]
        if ends[0] != ends[1] or link.first == link.second:
            relations.setdefault((link.kind, min(ends), max(ends)), snapping.residuals[link])
    return patches, tuple(Relation(k, i, j, r) for (k, i, j), r in sorted(relations.items()))
