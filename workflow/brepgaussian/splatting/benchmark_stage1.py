"""Accuracy of stage 1 on objects with a truth: the rows of `results/benchmark/stage1.csv`.

`python -m brepgaussian.splatting.benchmark_stage1 OUT.csv FOLDER...`: each folder holds `views.h5`, `masks.h5` and
`truth.h5`; `stage1.ply` and `stage1.h5` are made in it, each run in a process of its own, so that time and memory
are the stage's alone.
"""

import csv
import json
import subprocess
import sys
import time
from dataclasses import asdict
from pathlib import Path

from brepgaussian.artifacts.base import atomic
from brepgaussian.settings.stage1 import Stage1Settings
from brepgaussian.splatting.evaluate import COLUMNS, evaluate_stage1

METHODS = {
    "hull": {"iterations": 0, "settle_sweeps": 0, "concavities": False, "flat_faces": False, "relief": False},
    "opened hull": {"iterations": 0, "settle_sweeps": 0},
    "full": {},
}
"""Settings of each method; the last is the default."""


def _train(folder: Path, settings: Stage1Settings) -> None:
    """Child process: train, then print CPU seconds and peak memory as JSON."""
    from brepgaussian import threads
    from brepgaussian.splatting.stage1 import train_stage1

    threads.bind(1)
    start = time.process_time()  # one thread: the seconds of an idle core, whatever else runs
    train_stage1(
        folder / "views.h5", folder / "masks.h5", folder / "stage1.ply", folder / "stage1.h5", settings, threads=1
    )
    print(json.dumps({"seconds": time.process_time() - start, "peak_mb": _peak_mb()}))


def _peak_mb() -> float:
    """This process' peak memory; unlike getrusage's, it starts anew with the program and not with its parent."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024


def run(out_csv: str | Path, folders: list[Path], methods: list[str]) -> list[dict[str, object]]:
    """Train every object with every method, score it, and write the table."""
    rows = []
    for folder in folders:
        for method in methods:
            settings = Stage1Settings(**METHODS[method])  # type: ignore[arg-type]
            command = [
                sys.executable,
                "-m",
                "brepgaussian.splatting.benchmark_stage1",
                "--child",
                str(folder),
                json.dumps(asdict(settings)),
            ]
            cost = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)
            ply, h5, truth = (folder / name for name in ("stage1.ply", "stage1.h5", "truth.h5"))
            rows.append(evaluate_stage1(ply, h5, truth, method, **cost))
            print(rows[-1], flush=True)
    with atomic(out_csv) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    return rows


if __name__ == "__main__":
    if sys.argv[1] == "--child":
        _train(Path(sys.argv[2]), Stage1Settings(**json.loads(sys.argv[3])))
    else:
        run(sys.argv[1], [Path(p) for p in sys.argv[2:]], list(METHODS))
