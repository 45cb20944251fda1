"""The order of the stages: who reads whose artifact, and where each stage's code begins."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Stage:
    """One room of the house.

    Attributes:
        reads: stages whose artifacts it reads directly.
        module: the library module with its entrance; what it imports is what the stage depends on.
    """

    reads: tuple[str, ...]
    module: str


STAGES: dict[str, Stage] = {
    "views": Stage((), "brepgaussian.views.stage"),
    "masks": Stage(("views",), "brepgaussian.masks.stage"),
    "stage1": Stage(("views", "masks"), "brepgaussian.splatting.stage1"),
    "stage2": Stage(("views", "masks", "stage1"), "brepgaussian.splatting.stage2"),
    "points": Stage(("views", "masks", "stage1", "stage2"), "brepgaussian.points.stage"),
    "primitives": Stage(("points",), "brepgaussian.primitives.stage"),
    "brep": Stage(("views", "points", "primitives"), "brepgaussian.brep.stage"),
    "metrics": Stage(("views", "points", "brep"), "brepgaussian.metrics.stage"),
    "report": Stage(
        ("views", "masks", "stage1", "stage2", "points", "primitives", "brep", "metrics"), "brepgaussian.report.stage"
    ),
}


def upstream(stage: str) -> tuple[str, ...]:
    """The stage itself and everything that it depends on, in the order of the stages."""
    found = {stage}
    for name in reversed(STAGES):
        if name in found:
            found.update(STAGES[name].reads)
    return tuple(name for name in STAGES if name in found)
