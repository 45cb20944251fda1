"""Benchmark of assembly alone: truth-labelled points with known damage -> primitives -> brep.

`benchmark_object` gives the rows of one bundled part, `write_csv` and `join_csv` make the table of them.
`python -m brepgaussian.brep.benchmark OUT.csv [--objects ...] [--sigmas ...] ...` writes chosen cases.
"""

import argparse
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.base import atomic
from brepgaussian.artifacts.truth import Truth
from brepgaussian.artifacts.views import Views
from brepgaussian.brep.damage import DAMAGES, damaged
from brepgaussian.brep.ladder import climb, make_job, other_jobs
from brepgaussian.brep.silhouettes import Silhouettes
from brepgaussian.brep.worker import Worker
from brepgaussian.errors import BrepGaussianError
from brepgaussian.log import get_logger, setup
from brepgaussian.primitives.stage import primitives_of
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.settings.primitives import PrimitivesSettings
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.threads import bind
from brepgaussian.views.parts import PARTS, build_part

COLUMNS = (
    "object group primitives sigma wrong_labels damage seed valid closed fallback topology_match volume_iou seconds "
    "rung faces faces_truth reason"
).split()
SIGMAS = (0.0, 0.002, 0.005, 0.01)
MOST_WRONG = 0.05  # share of wrong labels
DAMAGE_SIGMA = 0.005  # noise of damaged clouds
_VIEWS = ViewsSettings(rendered_views=16, image_size=400, mesh_deflection=2e-4)
_IOU_GRID = 48
_DEFLECTION = 5e-4


@dataclass(frozen=True)
class Case:
    """One damaged cloud of one part."""

    name: str
    sigma: float
    wrong_labels: float
    damage: str
    seed: int


def make_truth(name: str, seed: int) -> tuple[Truth, Views]:
    """The truth of a bundled part and views that hold its silhouettes only."""
    return truth_of(build_part(name, seed).wrapped, name)


def truth_of(solid: Any, name: str) -> tuple[Truth, Views]:
    """The truth of a solid (TopoDS_Shape, any frame) and views that hold its silhouettes only."""
    from brepgaussian.views.rig import rig
    from brepgaussian.views.truth import transformed, truth_of_solid, unit_from_world

    truth, _ = truth_of_solid(transformed(solid, unit_from_world(solid)), _VIEWS)
    cameras = rig(_VIEWS)
    blank = np.zeros((len(cameras), cameras.height, cameras.width), np.uint8)
    canvas = Silhouettes(blank, blank.astype(np.float32), cameras)
    corners = truth.mesh_vertices[truth.mesh_triangles]
    alpha = np.stack([canvas.draw(v, corners) for v in range(len(cameras))]).astype(np.uint8) * 255
    names = tuple(str(v) for v in range(len(cameras)))
    rgb = np.zeros((*alpha.shape, 3), np.uint8)
    return truth, Views(name, names, rgb, alpha, cameras, np.eye(4))


def run_case(
    case: Case, truth: Truth, views: Views, worker: Worker, settings: BrepSettings, group: str = ""
) -> dict[str, Any]:
    """One row of the table; a failure is a row with its reason. The group is the bundled part's unless given."""
    row: dict[str, Any] = dict.fromkeys(COLUMNS, "")
    row |= {
        "object": case.name, "group": group or PARTS[case.name].group, "sigma": case.sigma,
        "wrong_labels": case.wrong_labels,
        "damage": case.damage, "seed": case.seed, "valid": False, "closed": False, "fallback": "",
        "topology_match": False, "volume_iou": 0.0, "faces_truth": len(truth.face_types),
    }  # fmt: skip
    start = time.monotonic()
    try:
        points = damaged(truth, case.sigma, case.wrong_labels, case.damage, case.seed)
        primitives = primitives_of(points, PrimitivesSettings())
        row["primitives"] = len(primitives.items)
        start = time.monotonic()
        job = make_job(views, points, primitives, settings)
        outcome = climb(worker, job, points, others=other_jobs(points, primitives, job))
        row["seconds"] = round(time.monotonic() - start, 2)
        row |= score(outcome.shape, truth)
        row |= {"fallback": outcome.report["fallback"], "rung": outcome.report["rung"]}
        row["reason"] = "; ".join(outcome.report["doubts"])
    except BrepGaussianError as error:
        row["seconds"] = round(time.monotonic() - start, 2)
        row["reason"] = str(error)
    return row


def score(data: bytes, truth: Truth) -> dict[str, Any]:
    """Validity, topology and volume of a solid (OCC bytes, unit frame) against the truth."""
    from brepgaussian.brep import occ, solid
    from brepgaussian.geometry.topology import count_topology
    from brepgaussian.metrics.distances import SampledSurface
    from brepgaussian.metrics.topology import topology_match
    from brepgaussian.metrics.volume import volume_iou

    shape = occ.from_bytes(data)
    counts = count_topology(shape)
    valid = solid.is_valid(shape)  # of the solid itself: BRepCheck judges a triangulation, too
    occ.tessellate(shape, _DEFLECTION, 0.2)
    nodes, triangles, _ = occ.mesh_of(shape)
    none: NDArray[np.float64] = np.zeros((0, 3))
    ours = SampledSurface(nodes, triangles.astype(np.int32), none, none, 1)
    theirs = SampledSurface(truth.mesh_vertices, truth.mesh_triangles, none, none, 1)
    return {
        "valid": valid,
        "closed": solid.free_edges(shape) == 0,
        "topology_match": topology_match(counts.face_types, counts.face_pairs, truth.face_types, truth.face_pairs),
        "volume_iou": round(volume_iou(ours, theirs, _IOU_GRID, 0), 5),
        "faces": len(counts.face_types),
    }


def cases_of(
    name: str,
    sigmas: Sequence[float] = SIGMAS,
    damages: Sequence[str] = DAMAGES,
    seeds: Sequence[int] = range(5),
    most_wrong: float = MOST_WRONG,
    damage_sigma: float = DAMAGE_SIGMA,
) -> list[Case]:
    """The cases of one part: every noise without damage, every damage at one noise, each with every seed.

    The share of wrong labels rises with the seed from 0 to `most_wrong`.
    """
    last = max(len(seeds) - 1, 1)
    wrong = [round(most_wrong * k / last, 4) for k in range(len(seeds))]
    cells = [(s, "none") for s in sigmas] + [(damage_sigma, d) for d in damages if d != "none"]
    return [Case(name, s, w, d, seed) for seed, w in zip(seeds, wrong, strict=True) for s, d in cells]


def benchmark_object(
    name: str, cases: Sequence[Case] | None = None, settings: BrepSettings | None = None, threads: int = 1
) -> list[dict[str, Any]]:
    """All rows of one bundled part (columns `COLUMNS`); a case that fails is a row with its reason.

    Args:
        name: of the part.
        cases: what is done to it; `cases_of(name)` if None.
        settings: of the stage.
        threads: numeric libraries are bound to this number.
    """
    bind(threads)
    return run(cases_of(name) if cases is None else cases, settings or BrepSettings())


def run(cases: Iterable[Case], settings: BrepSettings) -> list[dict[str, Any]]:
    """All rows, in order."""
    rows: list[dict[str, Any]] = []
    known: dict[tuple[str, int], tuple[Truth, Views]] = {}
    with Worker() as worker:
        for case in cases:
            key = (case.name, case.seed)
            if key not in known:
                known = {key: make_truth(*key)}  # cases come sorted by object: one is enough
            rows.append(run_case(case, *known[key], worker, settings))
            get_logger("brep").warning("%s", " ".join(str(rows[-1][c]) for c in COLUMNS))
    return rows


def write_csv(rows: Sequence[dict[str, Any]], path: str | Path) -> None:
    """Write the table."""
    import csv

    with atomic(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def join_csv(paths: Sequence[str | Path], out: str | Path) -> None:
    """One table of the tables of several parts."""
    import csv

    rows: list[dict[str, Any]] = []
    for path in paths:
        with Path(path).open(newline="", encoding="utf-8") as stream:
            rows += csv.DictReader(stream)
    write_csv(rows, out)


def summary(rows: Sequence[dict[str, Any]]) -> str:
    """Shares by noise and damage, over all cases of each (failures count as misses)."""
    lines = []
    for sigma, damage in sorted({(r["sigma"], r["damage"]) for r in rows}):
        some = [r for r in rows if (r["sigma"], r["damage"]) == (sigma, damage)]
        shares = {k: np.mean([bool(r[k]) for r in some]) for k in ("valid", "closed", "topology_match", "fallback")}
        iou = np.array([r["volume_iou"] for r in some])
        lines.append(
            f"sigma {sigma} {damage}: n {len(some)} valid {shares['valid']:.3f} closed {shares['closed']:.3f} "
            f"topology {shares['topology_match']:.3f} fallback {shares['fallback']:.3f} "
            f"volume IoU mean {iou.mean():.4f} least {iou.min():.4f} at least .99: {np.mean(iou >= 0.99):.3f} "
            f"seconds median {np.median([r['seconds'] for r in some]):.1f} most {max(r['seconds'] for r in some):.1f}"
        )
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--objects", nargs="*", default=sorted(PARTS))
    parser.add_argument("--sigmas", nargs="*", type=float, default=[0.0, 0.002, 0.005, 0.01])
    parser.add_argument("--damages", nargs="*", default=["none"], choices=DAMAGES)
    parser.add_argument("--wrong-labels", nargs="*", type=float, default=[0.01])
    parser.add_argument("--seeds", nargs="*", type=int, default=[0])
    options = parser.parse_args(arguments)
    bind(1)
    setup(level=30)
    cases = [
        Case(name, sigma, wrong, damage, seed)
        for name, seed, sigma, wrong, damage in product(
            options.objects, options.seeds, options.sigmas, options.wrong_labels, options.damages
        )
    ]
    rows = run(cases, BrepSettings())
    write_csv(rows, options.out)
    print(summary(rows))


if __name__ == "__main__":
    main()
