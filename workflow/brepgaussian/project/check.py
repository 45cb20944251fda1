"""What the objects lack, told before anything runs; looks at names of files only."""

import json
from collections.abc import Iterable
from pathlib import Path

from brepgaussian.project.objects import ObjectRow

_NAMED = 3  # missing images that are named; of the others the number is told


def missing(row: ObjectRow) -> list[str]:
    """What is not there of an object's source, one fault an entry."""
    if row.source == "part":
        return []
    path = Path(row.path)
    if not path.exists():
        return [f"{path} does not exist"]
    faults = _missing_of_abc_nef(path, row.truth) if row.source == "abc_nef" else []
    if row.source != "abc_nef" and row.truth and not Path(row.truth).exists():
        faults.append(f"its truth {row.truth} does not exist")
    return faults


def tell(rows: Iterable[ObjectRow]) -> str:
    """A line an object that lacks something; empty if none does."""
    return "\n".join(f"{row.name}: {'; '.join(faults)}" for row in rows if (faults := missing(row)))


def _missing_of_abc_nef(folder: Path, truth: str) -> list[str]:
    from brepgaussian.views.abc_nef_layout import ABC_NEF, EMAP, find_truth

    faults = []
    cameras = next((folder / name for name in (ABC_NEF, EMAP) if (folder / name).is_file()), None)
    if cameras is None:
        faults.append(f"neither {ABC_NEF} nor {EMAP}")
    else:
        images = folder / ("train_img" if cameras.name == ABC_NEF else "color")
        key = "file_path" if cameras.name == ABC_NEF else "rgb_path"
        try:
            wanted = [Path(frame[key]).name.split(".")[0] for frame in json.loads(cameras.read_text())["frames"]]
        except (OSError, ValueError, KeyError, TypeError):
            faults.append(f"{cameras.name} cannot be read")
        else:
            there = {file.name.split(".")[0] for file in images.glob("*")}
            faults += _absent(images.name, [name for name in wanted if name not in there], len(wanted))
    if find_truth(folder, truth) is None:
        faults.append("no truth (*trimesh*.obj and *features*.yml): it will not be scored")
    return faults


def _absent(folder: str, names: list[str], wanted: int) -> list[str]:
    if not names:
        return []
    shown = ", ".join(names[:_NAMED]) + (", ..." if len(names) > _NAMED else "")
    return [f"{len(names)} of {wanted} images are missing in {folder}/: {shown}"]
