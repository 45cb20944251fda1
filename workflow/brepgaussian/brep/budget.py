"""Work that is left to a search, counted instead of timed: a busy machine publishes the same bytes as an idle one."""

from dataclasses import dataclass, field

from brepgaussian.settings.brep import BrepSettings


@dataclass
class Work:
    """What one object may still cost: all its searches and trials share it.

    Attributes:
        refinements: of solids against the images, by far the dearest.
    """

    refinements: int


@dataclass
class Budget:
    """What one object's search, or one kind of trials, may still do.

    Attributes:
        solids: that may still be built.
        refinements: of solids against the images.
        work: of the whole object.
    """

    solids: int
    refinements: int
    work: Work = field(default_factory=lambda: Work(BrepSettings().most_work))

    @property
    def spent(self) -> bool:
        """Whether nothing more is to be begun."""
        return self.solids <= 0 or self.refinements <= 0 or self.work.refinements <= 0

    def refined(self) -> None:
        """Count one refinement."""
        self.refinements -= 1
        self.work.refinements -= 1

    def other(self, solids: int, refinements: int) -> "Budget":
        """For other work on the same object."""
        return Budget(solids, refinements, self.work)


def budget_of(settings: BrepSettings) -> Budget:
    """The whole budget of one object."""
    return Budget(settings.most_solids, settings.most_refinements, Work(settings.most_work))
