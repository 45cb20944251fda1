"""The search for the solid that the points and the images like best: rungs of the ladder, then simpler solids."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from brepgaussian.artifacts.views import Views
from brepgaussian.brep.budget import Budget
from brepgaussian.brep.job import Attempt, Job, Rung
from brepgaussian.brep.judgement import Shape, beyond_hope, forlorn, shape_of, size
from brepgaussian.brep.polish import Polished, badness, outlined, polish
from brepgaussian.brep.rivals import beyond_doubt, hopeless, same, worse
from brepgaussian.brep.rungs import MENDING, rungs
from brepgaussian.brep.trials import Trials
from brepgaussian.brep.verdict import Verdict
from brepgaussian.brep.worker import Worker, WorkerError, WorkerTimeout
from brepgaussian.errors import BrepGaussianError
from brepgaussian.log import get_logger

_CLEARLY = 0.02  # of the score: two percent of the points, or .4 percent of the silhouettes
_SAME_ENOUGH = 3  # rungs after the first that gave its solid again
_SMALL = 0.03  # of all points: the images decide whether patches of so few are faces
_MOST_RIVALS = 2  # solids of another shape that are refined where the images refuse the first
_MOST_BESIDE = 6  # explanations that are looked at in vain beside a solid that the images accept
_HANGS = 12  # solids that a hanging kernel costs: a few of them end the search
_OTHERS_RUNGS = ("support", "open_extended", "wide")  # on which other explanations are tried


@dataclass
class Search:
    """One object's search.

    Attributes:
        worker: runs the geometry kernel.
        job: what the rungs need.
        budget: what may still be done.
        views: images that judge; None to do without.
        others: jobs of other explanations of the same points, tried where the images or the points want another solid.
        tried: the attempts of this explanation, in order; beside: those of the others, for the report.
        polished: refined solids by the shape that they came from.
        rival: the best solid of other explanations, which this one has to beat.
    """

    worker: Worker
    job: Job
    budget: Budget
    views: Views | None
    others: Iterable[Job] = ()
    tried: list[Attempt] = field(default_factory=list)
    beside: list[Attempt] = field(default_factory=list)
    polished: dict[Shape, Polished] = field(default_factory=dict)
    rival: Polished | None = None

    def run(self) -> Polished | None:
        """The best solid, judged by the images where there are some; None if no rung gives one fit to publish."""
        first = self._first()
        if first is not None and first.report.get("accepted") is False:
            first = self._rounded(self._bordered(first))
        winner, best = self._against_others(first)
        if best is None or self.views is None:
            return best
        return winner._finished(best)

    def _first(self, names: Sequence[str] = ()) -> Polished | None:
        """The first solid fit to publish (from some rungs only), judged by the images where there are some."""
        self._ladder = [r for r in rungs(self.job) if not names or r.name in names] if self.job.patches else []
        self._climb(to_the_end=False)
        chosen = self.choose()
        if chosen is None or self.views is None:
            return None if chosen is None else Polished(chosen, {})
        return self._best_judged() or self._judged(chosen)

    def _against_others(self, best: Polished | None) -> tuple["Search", Polished | None]:
        """The best solid after other explanations of the points were tried, and the search that found it.

        They are tried where no solid is without doubts, or the images refuse it: one that they accept although the
        points had objected to it may be right by accident, until another explanation comes to the same one.
        """
        winner, in_vain = self, 0
        for job in self.others:
            in_vain += best is not None and bool(best.report.get("accepted"))
            if self.budget.spent or in_vain > _MOST_BESIDE:
                break
            if best is not None and beyond_doubt(best, winner.job) and not winner._doubted(best):
                break
            if best is not None and hopeless(job, best):
                continue
            search = Search(self.worker, job, self.budget, self.views, rival=best)
            found = search._first(_OTHERS_RUNGS)
            self.beside += [replace(t, rung=f"afresh {t.rung}") for t in search.tried]
            fault = "there is no solid" if found is None else worse(found, best, self.job.settings)
            kinds = " ".join(p.surface.kind for p in job.patches)
            get_logger("brep").info("afresh as %s: %s", kinds, fault or "taken")
            if found is not None and best is not None and same(found, best) and winner._hardly_doubted(best):
                get_logger("brep").info("two explanations come to the same solid")
                if beyond_doubt(found, job) and self._badness(found) < self._badness(best):
                    winner, best = search, found
                break
            if not fault:
                winner, best, in_vain = search, search._rounded(found), 0
        return winner, best

    def _finished(self, best: Polished) -> Polished:
        """The solid after simpler ones were tried, and other rungs where the images refuse it."""
        chosen = self.choose()
        assert chosen is not None
        best = self._simplified(best)
        unsure = bool(chosen.verdict.doubts or chosen.verdict.hints)  # else other rungs hardly find another shape
        if unsure and best.report.get("accepted") is False:
            self._climb(to_the_end=True)
            rivals = self._rivals(chosen)
            better = min((self._judged(r) for r in rivals), key=self._badness, default=best)
            if self._badness(better) < self._badness(best):
                best = self._simplified(better)
        return best

    def choose(self) -> Attempt | None:
        """The best attempt by points and coarse silhouettes: without doubts if there is one."""
        clean = [t for t in self.tried if t.shape is not None and not t.verdict.doubts]
        some = clean or self.publishable()
        return _best(some) if some else None

    def _climb(self, to_the_end: bool) -> None:
        """Try the rungs that were not tried yet; stop at a good solid unless `to_the_end`."""
        done = {t.rung for t in self.tried}
        for rung in self._ladder:
            if rung.name in done:
                continue
            if self.budget.spent or self._repeating() or (not to_the_end and self._settled()):
                break
            self.budget.built(len(self.job.patches))
            try:
                result = self.worker.call("assemble:attempt", (self.job, rung), self.job.settings.time_limit_s)
            except (WorkerError, BrepGaussianError) as error:
                self.budget.built(len(self.job.patches), _HANGS * isinstance(error, WorkerTimeout))
                result = Attempt(rung.name, None, Verdict((str(error),)))
            self.tried.append(result)
            get_logger("brep").info("rung %s: %s", rung.name, _remarks(result) or "accepted")
            if self._promising(result) and self._judged(result).report.get("accepted"):
                break

    def _settled(self) -> bool:
        """Whether a solid is good enough to stop: no doubts, and no rung left that could mend a bare area."""
        good = [t for t in self.tried if t.shape is not None and not t.verdict.doubts]
        if not good:
            return False
        done = {t.rung for t in self.tried}
        mended = all(r.name in done for r in self._ladder if r.name in MENDING)
        return mended or any(not t.verdict.hints for t in good)

    def _repeating(self) -> bool:
        """Whether rungs keep giving one and the same solid: the doubts lie in the primitives, not in the rung."""
        shapes = [shape_of(t) for t in self.tried if t.shape is not None]
        return len(shapes) > _SAME_ENOUGH and len(set(shapes[-_SAME_ENOUGH - 1 :])) == 1

    def _promising(self, attempt: Attempt) -> bool:
        """Whether the images may settle what doubts there are: all of them are about patches of few points.

        Where they have refused a solid that leaves out no more than these patches, they refuse others that do, too.
        """
        verdict = attempt.verdict
        if self.views is None or not self.job.settings.refine or attempt.shape is None or verdict.hints:
            return False
        few = bool(verdict.doubts) and self._about_few(verdict)
        return few and not any(self._low(refused) <= self._low(verdict) for refused in self._refused())

    def _refused(self) -> list[Verdict]:
        """Of the solids that the images have refused."""
        known = [(t.verdict, self.polished.get(shape_of(t))) for t in self.tried if t.shape is not None]
        return [verdict for verdict, polished in known if polished and not polished.report.get("accepted")]

    def _low(self, verdict: Verdict) -> frozenset[int]:
        """Patches of which a solid explains too little."""
        low = np.array(verdict.explained[: len(self.job.patches)]) < self.job.settings.gate_explained
        return frozenset(np.flatnonzero(low).tolist())

    def _about_few(self, verdict: Verdict) -> bool:
        """Whether all doubts are about patches of few points."""
        settings = self.job.settings
        if verdict.iou is not None and verdict.iou < settings.gate_iou:
            return False
        sizes = [len(p.xyz) for p in self.job.patches]
        return sum(sizes[k] for k in self._low(verdict)) <= _SMALL * sum(sizes)

    def _hardly_doubted(self, best: Polished) -> bool:
        """Whether nothing speaks against a solid, or a few points do and the images don't.

        Labels of few points may be of no face at all: where two explanations come to one solid without them, others
        will, too.
        """
        accepted = bool(best.report.get("accepted"))
        return beyond_doubt(best, self.job) or (accepted and self._about_few(best.attempt.verdict))

    def publishable(self) -> list[Attempt]:
        """Solids that beat the polyhedral fallback, doubts or not."""
        settings = self.job.settings
        return [
            t
            for t in self.tried
            if t.shape is not None
            and t.verdict.explained_all >= settings.weak_explained
            and (t.verdict.iou is None or t.verdict.iou >= settings.weak_iou)
        ]

    def _rivals(self, chosen: Attempt) -> list[Attempt]:
        """The best solids of other shapes."""
        left = [t for t in self.publishable() if shape_of(t) != shape_of(chosen)]
        result: list[Attempt] = []
        while left and len(result) < _MOST_RIVALS:
            result.append(_best(left))
            left = [t for t in left if shape_of(t) != shape_of(result[-1])]
        return result

    def _rung(self, name: str) -> Rung:
        return next(r for r in self._ladder if r.name == name)

    def _judged(self, attempt: Attempt) -> Polished:
        """An attempt refined and judged by the images (once for every shape)."""
        assert self.views is not None
        shape = shape_of(attempt)
        if shape not in self.polished:
            self.polished[shape] = self._polished(attempt, self._rung(attempt.rung), self.views)
        return self.polished[shape]

    def _polished(self, attempt: Attempt, rung: Rung, views: Views) -> Polished:
        """An attempt refined, unless the images will prefer the rival whatever comes of it."""
        lost = ""
        if self.rival is not None and self.rival.report.get("accepted") and size(attempt) < size(self.rival.attempt):
            lost = forlorn(attempt, self.rival)
        if lost:
            return Polished(attempt, {"refined": False, "refinement_fault": lost})
        self.budget.refined(len(self.job.patches))
        known = [*([] if self.rival is None else [self.rival]), *self.polished.values()]
        worst = min((beyond_hope(p, self.job.settings) for p in known), default=math.inf)
        return polish(self.worker, self.job, rung, attempt, views, worst)

    def _best_judged(self) -> Polished | None:
        """A solid that the images accepted while rungs were tried."""
        return next((p for p in self.polished.values() if p.report.get("accepted")), None)

    def _doubted(self, polished: Polished) -> bool:
        """Whether the points objected to the solid that a refined one came from, though they may not any more."""
        sources = {shape for shape, known in self.polished.items() if known is polished}
        return any(t.verdict.doubts for t in self.tried if t.shape is not None and shape_of(t) in sources)

    def _badness(self, polished: Polished) -> float:
        return badness(polished.report, self.job.settings)

    def _bordered(self, best: Polished) -> Polished:
        """A refused solid with other borders beside its fillets: a smaller change than to start afresh."""
        return self._changed(best, Trials.bordered)

    def _rounded(self, best: Polished | None) -> Polished | None:
        """A refused solid with the fillets that it lacks: inner ones, and all where edges and silhouettes are right."""
        if best is not None and best.report.get("accepted") is False:
            best = self._changed(best, Trials.rounded_inside)
            if best.report.get("accepted") is False and outlined(best.report, self.job.settings):
                best = self._changed(best, Trials.rounded)
        return best

    def _changed(self, best: Polished, change: Callable[[Trials], Polished]) -> Polished:
        """A solid after one kind of trials, whose changes the search goes on with."""
        trials = self._trials(best)
        if trials is None:
            return best
        better = change(trials)
        self.job = trials.job
        return better

    def _simplified(self, best: Polished) -> Polished:
        """The solid after simpler ones were tried."""
        trials = self._trials(best)
        return best if trials is None else trials.run()

    def _trials(self, best: Polished) -> Trials | None:
        """Changes of a solid, judged by the images; None without them."""
        settings = self.job.settings
        if self.views is None or not (settings.simplify and settings.refine):
            return None
        left = self.budget.other(settings.simplify_solids, settings.simplify_trials)
        notes = list(best.report.get("trials", []))
        refused = {note["changes"][0] for note in notes if note["fault"] and len(note["changes"]) == 1}
        rung = self._rung(best.attempt.rung)
        return Trials(self.worker, self.views, self.job, rung, best, left, notes, refused)


def _remarks(result: Attempt) -> str:
    return "; ".join(result.verdict.faults + result.verdict.doubts + result.verdict.hints)


def _best(solids: list[Attempt]) -> Attempt:
    """The highest score; an earlier rung stands unless a later one is clearly better."""
    best = solids[0]
    for other in solids[1:]:
        if other.verdict.score > best.verdict.score + _CLEARLY:
            best = other
    return best
