"""Work that is left to a search, counted instead of timed: a busy machine publishes the same bytes as an idle one."""

from dataclasses import dataclass

from brepgaussian.settings.brep import BrepSettings


@dataclass
class Budget:
    """What one object's search may still do; its searches among other explanations share it.

    Attributes:
        solids: that may still be built on rungs of the ladder.
        refinements: of solids against the images.
    """

    solids: int
    refinements: int

    @property
    def spent(self) -> bool:
        """Whether nothing more is to be begun."""
        return self.solids <= 0 or self.refinements <= 0


def budget_of(settings: BrepSettings) -> Budget:
    """The whole budget of one object."""
    return Budget(settings.most_solids, settings.most_refinements)
