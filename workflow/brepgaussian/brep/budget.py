"""Work that is left to a search, counted instead of timed: a busy machine publishes the same bytes as an idle one."""

from dataclasses import dataclass, field

from brepgaussian.settings.brep import BrepSettings

_USUAL = 25  # patches; a solid of twice as many takes twice as long to build and to refine, and counts twice


@dataclass
class Work:
    """What one object may still cost: all its searches and trials share it.

    Attributes:
        refinements: of solids against the images, by far the dearest; of larger ones fewer.
    """

    refinements: float


@dataclass
class Budget:
    """What one object's search, or one kind of trials, may still do.

    Attributes:
        solids: of usual size that may still be built.
        refinements: of such solids against the images.
        work: of the whole object.
    """

    solids: float
    refinements: float
    work: Work = field(default_factory=lambda: Work(BrepSettings().most_work))

    @property
    def spent(self) -> bool:
        """Whether nothing more is to be begun."""
        return self.solids <= 0 or self.refinements <= 0 or self.work.refinements <= 0

    def built(self, patches: int, times: int = 1) -> None:
        """Count one solid of so many patches, or more."""
        self.solids -= times * _weight(patches)

    def refined(self, patches: int) -> None:
        """Count one refinement of a solid of so many patches."""
        self.refinements -= _weight(patches)
        self.work.refinements -= _weight(patches)

    def other(self, solids: float, refinements: float) -> "Budget":
        """For other work on the same object."""
        return Budget(solids, refinements, self.work)


def _weight(patches: int) -> float:
    return max(1.0, patches / _USUAL)


def budget_of(settings: BrepSettings) -> Budget:
    """The whole budget of one object."""
    return Budget(settings.most_solids, settings.most_refinements, Work(settings.most_work))
