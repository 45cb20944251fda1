"""Simpler solids tried against the images: what they explain as well with fewer or simpler faces is taken."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import zip_longest
from typing import Any

import numpy as np

from brepgaussian.artifacts.views import Views
from brepgaussian.brep.budget import Budget
from brepgaussian.brep.buildings import Built, buildings
from brepgaussian.brep.facets import facets_as_fillets, lone_facets
from brepgaussian.brep.features import apart, chamfers
from brepgaussian.brep.job import Attempt, Job, Rung
from brepgaussian.brep.judgement import (
    Shape,
    against,
    as_good,
    bears,
    beyond_hope,
    calms,
    completes,
    forlorn,
    in_doubt,
    mends,
    shape_of,
    short_of,
    size,
)
from brepgaussian.brep.mistaken import mistaken
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.polish import Polished, badness, polish, with_patches_on
from brepgaussian.brep.profiles import flattened, grooved, straightened, unbent
from brepgaussian.brep.regroup import regrouped
from brepgaussian.brep.rounds import completed, fillets, inner_fillets, roundings
from brepgaussian.brep.sections import angular
from brepgaussian.brep.simplify import Change, applied, compatible, proposals
from brepgaussian.brep.slants import refused_slants, slants
from brepgaussian.brep.structure import Structure
from brepgaussian.brep.symmetry import carried
from brepgaussian.brep.unshown import shrunk, unshown
from brepgaussian.brep.verdict import Verdict
from brepgaussian.brep.worker import Worker, WorkerError
from brepgaussian.errors import BrepGaussianError
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.log import get_logger
from brepgaussian.settings.brep import BrepSettings

Enough = Callable[[Mapping[str, Any], Mapping[str, Any], BrepSettings], bool]
Changes = Callable[[Structure, Sequence[Surface], Sequence[Patch], Sequence[Mapping[str, Any]]], list[Change]]
Fillets = Callable[[Structure, Sequence[Surface], Sequence[Patch]], list[Change]]

_MOST_RADII = 3  # of the corners of pockets
_MOST_ROLLED = 4  # faces that may turn out to be fillets
_RUNGS = 2  # that a change is built on, at most
_MOST_EDGED = 6  # changed edges that are refined until one is taken: as many widths and kinds
_MOST_ALONE = 4  # of these, of one pair of faces alone
_MOST_MENDS = 8  # that are refined where the images refuse a solid
_POINTS_SLACK = 0.01  # share of the points that may leave the solid: wrong labels and rounded borders


@dataclass
class Trials:
    """The best solid so far, what it was built from, and what was tried.

    Attributes:
        worker, views: as everywhere in this stage.
        job, rung: what the best solid was built from.
        best: the solid with its acceptance test.
        left: what may still be built and refined.
        notes: for the report.
        refused: names of changes that were refused alone.
    """

    worker: Worker
    views: Views
    job: Job
    rung: Rung
    best: Polished
    left: Budget
    notes: list[dict[str, Any]] = field(default_factory=list)
    refused: set[str] = field(default_factory=set)

    def run(self) -> Polished:
        """Try roundings and chamfers where an edge is refused, other borders, simpler solids, other walls, fillets."""
        if self.best.report.get("accepted") is False:
            self._edged()
        self.bordered()
        self._rolled()
        self._simplified()
        for step in (self._mended, self.rounded_inside, self.rounded):
            before = self.best
            step()
            if self.best is not before:  # what is right now may show that other faces are one
                settings = self.job.settings
                self.left = self.left.other(settings.simplify_solids, settings.simplify_trials)
                self.refused.clear()
                self._simplified()
        self._completed()
        return self._noted()

    def _simplified(self) -> None:
        """Try simpler solids until none is taken."""
        while not self.left.spent:
            changes = [c for c in self._proposals() if c.name not in self.refused]
            if not changes or not any(self._tried(group) for group in self._groups(changes)):
                break

    def bordered(self) -> Polished:
        """Try other borders between fillets and the faces beside them."""
        for change in self._borders():
            if change.name not in self.refused:
                self._tried([change], slack=0.0)  # the points are why: they have to like it
        return self._noted()

    def rounded_inside(self) -> Polished:
        """Try fillets on concave edges whose steps images show elsewhere."""
        known = self._refused()
        if known is not None:
            self._filleted(partial(inner_fillets, edges=known[1]))
        return self._noted()

    def rounded(self) -> Polished:
        """Try fillets where parallax places faces elsewhere beside edges that agree with the images."""
        if in_doubt(self.best.report, self.job.settings):
            known = self._judged()
            edges = () if known is None else known[1]
            self._filleted(partial(fillets, off=self.best.off, edges=edges), calms)
        return self._noted()

    def _edged(self) -> None:
        """Try other edges where the images refuse those that there are; simpler solids have a budget of their own."""
        left, self.left = self.left, self.left.other(_RUNGS * _MOST_EDGED, _MOST_EDGED)
        for change in slants(self.job.patches):  # before chamfers, which could stand for a rounding
            self._tried([change], simpler=False, enough=bears)
        for change in self._at_edges(refused_slants):
            self._tried([change], simpler=False, enough=mends)
        for alone, most in ((False, _MOST_EDGED), (True, _MOST_ALONE)):
            self.left = left.other(_RUNGS * most, most)
            while any(self._either(changes) for changes in self._widths(alone)):
                self.left = left.other(_RUNGS * most, most)  # where one edge was far off, others show now
        self.left = left

    def _widths(self, alone: bool) -> Iterator[tuple[Change | None, ...]]:
        """Chamfers and roundings of one width on all refused edges, or on those of one pair of faces alone."""
        known = self._refused()
        for table in () if known is None else apart(*known) if alone else [known[1]]:
            yield from zip_longest(self._at_edges(chamfers, table), self._at_edges(roundings, table))

    def _mended(self) -> None:
        """Try other walls where the images still refuse the solid, one place after the other.

        From its refined surfaces: from the patches as they were the solid around a place may not come out again.
        """
        if self.best.report.get("accepted") is not False:
            return
        self.job = self._refined()
        self.left = self.left.other(_RUNGS * _MOST_MENDS, _MOST_MENDS)
        while not self.left.spent and not self.best.report["accepted"]:
            changes = [c for c in self._mends() if c.name not in self.refused]
            if not any(self._tried([change], simpler=False, enough=mends) for change in changes):
                break

    def _completed(self) -> None:
        """Try all corners of a pocket rounded where some are: images hardly tell, so they only have to bear it."""
        for _ in range(_MOST_RADII):
            if not self.best.report.get("accepted") or not self._filleted(completed, completes):
                break

    def _rolled(self) -> None:
        """Try fillets for faces that lean against all beside them, one after the other."""

        def propose(_: Structure, __: Sequence[Surface], patches: Sequence[Patch]) -> list[Change]:
            return mistaken(patches, {b.patch for b in self.job.blends})

        for _ in range(_MOST_ROLLED):
            if not self._filleted(propose, as_good):
                break

    def _filleted(self, propose: Fillets, enough: Enough | None = None) -> bool:
        """Whether one of some fillets, which touch the best solid's surfaces exactly, was taken.

        They are few, and what simpler solids cost is no reason to leave them.
        """
        structure = self.best.attempt.verdict.structure
        if structure is None:
            return False
        job = self._refined()
        changes = [c for c in propose(structure, self.best.attempt.surfaces, job.patches) if c.name not in self.refused]
        if not changes:
            return False
        left = self.left
        self.job, self.left = job, left.other(_RUNGS * len(changes), len(changes))
        taken = any(self._tried([change], simpler=False, enough=enough) for change in changes)
        self.left = left
        return taken

    def _noted(self) -> Polished:
        """The best solid, with what was tried in its report."""
        if self.notes:
            self.best.report["trials"] = self.notes
        return self.best

    def _mends(self) -> list[Change]:
        """Chamfers, fillets for facets, straight faces, what symmetries carry, planes for curved walls."""
        patches = self.job.patches
        turned = [*unbent(patches), *lone_facets(patches), *straightened(patches), *grooved(patches)]
        return [*self._at_edges(chamfers), *turned, *carried(patches), *angular(patches, square=True)]

    def _at_edges(self, propose: Changes, table: Sequence[Mapping[str, Any]] | None = None) -> list[Change]:
        """Chamfers, roundings, or slants as these, at edges that the images refuse; at those of a table only."""
        known = self._refused()
        if known is None:
            return []
        return propose(known[0], self.best.attempt.surfaces, self.job.patches, known[1] if table is None else table)

    def _refused(self) -> tuple[Structure, Sequence[Mapping[str, Any]]] | None:
        """The structure and the table of edges of a solid that the images refuse."""
        return self._judged() if self.best.report.get("accepted") is False else None

    def _judged(self) -> tuple[Structure, Sequence[Mapping[str, Any]]] | None:
        """The structure and the table of edges of a solid that the images have judged."""
        details, structure = self.best.report.get("refinement"), self.best.attempt.verdict.structure
        return None if not details or structure is None else (structure, details["edges"])

    def _refined(self) -> Job:
        """The job with its best solid's surfaces: fillets touch these exactly."""
        return with_patches_on(self.job, self.best.attempt.surfaces)

    def _proposals(self) -> list[Change]:
        """Simpler solids; but what touches its neighbours has one free parameter, less than a plane."""
        patches, noise, seed = self.job.patches, self._noise(), self.job.settings.seed
        known, surfaces = self._judged(), self.best.attempt.surfaces
        found = [] if known is None else shrunk(known[0], surfaces, patches, self.views.cameras.footprint())
        found += proposals(patches, noise, seed, surfaces)
        found += [*facets_as_fillets(patches, noise, np.random.default_rng(seed)), *flattened(patches)]
        found += [] if known is None else unshown(known[0], patches, known[1])
        blends = {b.patch for b in self.job.blends}
        return [c for c in found if not (c.new and blends & set(c.gone))]

    def _borders(self) -> list[Change]:
        """Faces that share a label with a piece of the fillet beside them."""
        return list(regrouped(self.job.patches, self._noise(), np.random.default_rng(self.job.settings.seed)))

    def _noise(self) -> float:
        return float(np.median([p.sigma for p in self.job.patches]))

    @staticmethod
    def _groups(changes: list[Change]) -> list[list[Change]]:
        """All together first, then the simpler kinds, then one by one.

        Walls and floor of a narrow groove that points bend are right as planes only together.
        """
        together = compatible(changes)
        kinds = [c for c in together if len(c.gone) == len(c.new) == 1]
        groups = [together, kinds] if len(kinds) < len(together) else [together]
        return [group for group in groups if len(group) > 1] + [[c] for c in changes]

    def _tried(
        self,
        changes: list[Change],
        simpler: bool = True,
        slack: float = _POINTS_SLACK,
        enough: Enough | None = None,
    ) -> bool:
        """Whether changes were taken.

        A share `slack` of the points may leave the solid for a simpler one. What would be refused is taken all the same
        if it is `enough`: it `mends` one of several wrong places, or the points like it better and the images bear it.
        """
        outcome = self._asked(changes, simpler, slack, enough)
        if outcome is None:
            return False
        self.job, self.rung, self.best = outcome
        return True

    def _either(self, alternatives: Iterable[Change | None]) -> bool:
        """Whether one of several changes was taken, the one that leaves the images least to object to."""
        found: list[tuple[Job, Rung, Polished]] = []
        for change in alternatives:
            outcome = None if change is None else self._asked([change], simpler=False, slack=_POINTS_SLACK)
            found += [] if outcome is None else [outcome]
            if outcome is not None and outcome[2].report.get("accepted"):
                break
        if not found:
            return False
        self.job, self.rung, self.best = min(found, key=lambda o: badness(o[2].report, o[0].settings))
        return True

    def _asked(
        self, changes: list[Change], simpler: bool, slack: float, enough: Enough | None = None
    ) -> tuple[Job, Rung, Polished] | None:
        """What changes lead to, if nothing speaks against it; what is refused alone is not tried again."""
        if self.left.spent:
            return None
        fault, outcome = self._outcome(changes, simpler, slack, enough)
        names = [c.name for c in changes]
        self.notes.append({"changes": names, "fault": fault})
        get_logger("brep").info("trial %s: %s", ", ".join(names), fault or "taken")
        if outcome is None:
            self.refused |= set(names) if len(names) == 1 else set()
        return outcome

    def _outcome(
        self, changes: list[Change], simpler: bool, slack: float, enough: Enough | None
    ) -> tuple[str, tuple[Job, Rung, Polished] | None]:
        """Why changes are refused, or what they lead to."""
        plain, before = applied(self.job, changes), self.best.attempt.verdict
        fault, known = "", set[Shape]()
        smooth = {i for change in changes if change.smooth for i in change.gone}
        old = _without_edges(self.best, {i for change in changes if change.faint for i in change.gone})
        built = Built({patch.primitive for change in changes if change.smooth for patch in change.new})
        for job, rung in buildings(self.job, plain, self.rung, changes, self._noise(), built):
            self.left.built(len(job.patches))
            try:
                attempt: Attempt = self.worker.call("assemble:attempt", (job, rung), job.settings.time_limit_s)
            except (WorkerError, BrepGaussianError) as error:
                fault = str(error)
                continue
            verdict, shape = attempt.verdict, shape_of(attempt)
            if attempt.shape is not None and shape in known:
                continue  # one and the same solid again
            fault = "; ".join(verdict.faults)
            built.add(attempt)
            if attempt.shape is None:
                continue
            if simpler and size(attempt) >= size(self.best.attempt):
                fault = "no simpler"
            elif simpler and verdict.caps > before.caps:
                fault = "a face is guessed instead"
            elif simpler and _explains_less(verdict, before, slack + sum(c.excused for c in changes)):
                fault = "the points are explained less"
            elif _off(verdict, before, job.settings):
                fault = "silhouettes are off by far"
            elif simpler and (lost := forlorn(attempt, old, smooth)):
                fault = lost
            else:
                self.left.refined(len(job.patches))
                worst = beyond_hope(self.best, job.settings)
                polished = polish(self.worker, job, rung, attempt, self.views, worst)
                known |= {shape} if polished.report.get("refined") else set()
                fault = (
                    against(polished, old, job.settings, smooth)
                    if simpler
                    else short_of(polished, self.best, job.settings)
                )
                if fault and enough is not None and enough(polished.report, self.best.report, job.settings):
                    fault = ""
                if not fault:
                    return "", (job, rung, polished)
        return fault, None


def _without_edges(known: Polished, surfaces: Collection[int]) -> Polished:
    """A solid of which the images show no edges of some surfaces."""
    return replace(known, shown=tuple(e for e in known.shown if not set(e.surfaces) & set(surfaces)))


def _off(verdict: Verdict, before: Verdict, settings: BrepSettings) -> bool:
    """Whether coarse silhouettes refuse a solid more than the present one: no refinement moves faces that far."""
    if verdict.iou is None or before.iou is None:
        return False
    return verdict.iou < min(before.iou, settings.gate_iou)


def _explains_less(verdict: Verdict, before: Verdict, slack: float) -> bool:
    return verdict.on_solid < before.on_solid - slack or len(verdict.doubts) > len(before.doubts)
