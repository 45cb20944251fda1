"""How assembly grows with the number of primitives: plates with more and more holes, heat sinks with more fins.

`growth_rows()` gives rows with the columns of the benchmark; `python -m brepgaussian.brep.growth OUT.csv` writes them.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from brepgaussian.brep.benchmark import COLUMNS, Case, run_case, truth_of, write_csv
from brepgaussian.brep.worker import Worker
from brepgaussian.log import get_logger, setup
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.threads import bind

GROUP = "growth"
HOLES = (2, 4, 6, 8, 10, 12)  # a side: 10 to 150 primitives
FINS = (2, 5, 9, 13)  # 13 to 35 faces, most of them narrow
SIGMA = 0.001  # unit frame: the smallest feature is .03 wide
_THICKNESS = 0.12  # of the plate, of its side
_HOLE_SHARE = 0.25  # radius over pitch
_FIN_SHARE = 0.5  # thickness of a fin over pitch


def plate(side: int) -> Any:
    """A square plate with side x side through holes (build123d solid)."""
    from build123d import Box, Cylinder, Pos

    body, pitch = Box(1, 1, _THICKNESS), 1 / side
    for i in range(side):
        for j in range(side):
            place = Pos((i + 0.5) * pitch - 0.5, (j + 0.5) * pitch - 0.5, 0)
            body -= place * Cylinder(_HOLE_SHARE * pitch, 2 * _THICKNESS)
    return body.solid()


def heat_sink(fins: int) -> Any:
    """A base with upright fins (build123d solid)."""
    from build123d import Box, Pos

    pitch = 1 / (fins + _FIN_SHARE - 1)
    body = Box(1, 0.7, 0.15)
    for k in range(fins):
        x = -0.5 + _FIN_SHARE * pitch / 2 + k * pitch
        body += Pos(x, 0, 0.325) * Box(_FIN_SHARE * pitch, 0.7, 0.5)
    return body.solid()


def growth_rows(
    holes: Sequence[int] = HOLES, fins: Sequence[int] = FINS, seed: int = 0, settings: BrepSettings | None = None
) -> list[dict[str, Any]]:
    """A row for every plate and heat sink; `group` is growth."""
    rows = []
    with Worker() as worker:
        for name, make, counts in (("plate", plate, holes), ("heat_sink", heat_sink, fins)):
            for count in counts:
                truth, views = truth_of(make(count).wrapped, f"{name}_{count}")
                case = Case(f"{name}_{count}", SIGMA, 0.01, "none", seed)
                rows.append(run_case(case, truth, views, worker, settings or BrepSettings(), GROUP))
                get_logger("brep").warning("%s", " ".join(str(rows[-1][c]) for c in COLUMNS))
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--holes", nargs="*", type=int, default=list(HOLES))
    parser.add_argument("--fins", nargs="*", type=int, default=list(FINS))
    options = parser.parse_args(arguments)
    bind(1)
    setup(level=30)
    write_csv(growth_rows(options.holes, options.fins), options.out)


if __name__ == "__main__":
    main()
