"""What a changed job is built on: its rungs, its fillets rolled, the faces beside what was left out extended."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from brepgaussian.brep.explanations import rolled
from brepgaussian.brep.job import Attempt, Job, Rung
from brepgaussian.brep.patches import neighbours
from brepgaussian.brep.simplify import Change


@dataclass
class Built:
    """What came of the attempts so far.

    Attributes:
        fillets: primitives of new fillets.
        closed: whether one of them gave a solid; whole: one that has all of the fillets.
    """

    fillets: set[int] = field(default_factory=set)
    closed: bool = False
    whole: bool = False

    def add(self, attempt: Attempt) -> None:
        """Note one attempt."""
        if attempt.shape is not None:
            self.closed = True
            self.whole |= self.fillets <= _primitives_of(attempt)


def buildings(
    before: Job, after: Job, rung: Rung, changes: Sequence[Change], noise: float, built: Built
) -> Iterator[tuple[Job, Rung]]:
    """What a job is built on after changes.

    With fillets rolled where no attempt has them: sheets only touch. Where none closed, with the faces beside what was
    left out extended into its place.

    Args:
        before, after: the job.
        rung: on which the solid before was found.
        changes: that led from one to the other.
        noise: of the points.
        built: what came of the attempts so far; looked at as they are asked for.
    """
    rungs = _rungs(rung, after)
    yield from ((after, one) for one in rungs)
    if built.fillets and not built.whole:
        yield from ((other, rungs[0]) for other in rolled(after, noise))
    left_out = [i for change in changes if not change.new for i in change.gone]
    if left_out and not built.closed:
        beside = {before.patches[k].primitive for i in left_out for k in neighbours(i, before.patches)}
        around = {k for k, patch in enumerate(after.patches) if patch.primitive in beside}
        opened = tuple(sorted({*after.open_patches, *around}))
        yield replace(after, open_patches=opened), replace(rungs[0], name="open_extended", extend=opened)


def _rungs(rung: Rung, job: Job) -> list[Rung]:
    """The plain rung, and the one that the solid was found on, for the patches that are left."""
    plain = Rung("support", job.settings.margin)
    if rung.name == plain.name:
        return [plain]
    extend = tuple(range(len(job.patches))) if rung.name == "extended" else job.open_patches
    return [plain, replace(rung, extend=extend if rung.extend else ())]


def _primitives_of(attempt: Attempt) -> set[int]:
    """Of the patches that have faces in a solid."""
    structure = attempt.verdict.structure
    faces = () if structure is None else structure.faces
    return {attempt.primitives[face.surface] for face in faces if face.surface >= 0}
