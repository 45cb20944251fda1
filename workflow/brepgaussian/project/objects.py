"""`objects.tsv`: one row an object."""

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from brepgaussian.errors import InputError

SOURCES = ("part", "step", "abc_nef", "nerf", "colmap")
GROUPS = ("tuned", "holdout")
COLUMNS = ("object", "source", "path", "truth", "group")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")  # it becomes a folder and a wildcard


@dataclass(frozen=True)
class ObjectRow:
    """One object.

    Attributes:
        name: its folder under `results/<variant>/`.
        source: one of `SOURCES`.
        path: a bundled part's name, a STEP file, or a folder.
        truth: a STEP file or a folder with the truth, or empty.
        group: `tuned` if thresholds were chosen on it, `holdout` if none was.
    """

    name: str
    source: str
    path: str
    truth: str = ""
    group: str = "holdout"


def read_objects(path: str | Path) -> dict[str, ObjectRow]:
    """Read and check an object table.

    Raises:
        InputError: the table is missing, or a row is malformed; says which and how to mend it.
    """
    path = Path(path)
    try:
        with path.open(newline="", encoding="utf-8") as file:
            lines = [line for line in file if line.strip() and not line.startswith("#")]
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=path, fix="set `objects` in config") from error
    reader = csv.DictReader(lines, delimiter="\t")
    if tuple(reader.fieldnames or ()) != COLUMNS:
        raise InputError(
            f"has the columns {reader.fieldnames}", file=path, fix=f"use the tab-separated columns {', '.join(COLUMNS)}"
        )
    rows: dict[str, ObjectRow] = {}
    for record in reader:
        row = _row(record, path)
        if row.name in rows:
            raise InputError(f"lists {row.name} twice", file=path, fix="give every object a name of its own")
        rows[row.name] = row
    return rows


def _row(record: dict[str, str | None], path: Path) -> ObjectRow:
    values = {key: (value or "").strip() for key, value in record.items() if key is not None}
    row = ObjectRow(values["object"], values["source"], values["path"], values["truth"], values["group"] or "holdout")
    if not _NAME.fullmatch(row.name):
        raise InputError(f"has the object name {row.name!r}", file=path, fix="use letters, digits, '_', '-' and '.'")
    if row.group not in GROUPS:
        raise InputError(f"{row.name}: group is {row.group!r}", file=path, fix=f"use one of: {', '.join(GROUPS)}")
    if not row.path:
        raise InputError(f"{row.name}: path is empty", file=path, fix="name a part, a file or a folder")
    return row


def configured_objects(config: Mapping[str, Any]) -> dict[str, ObjectRow]:
    """The objects that a config asks for: a table's rows, or all of an ABC-NEF folder, narrowed by `select`.

    Raises:
        InputError: neither is given, the table is malformed, or `select` names an unknown object.
    """
    if config.get("abc_nef"):
        from brepgaussian.views.abc_nef_layout import find_abc_nef

        found = {row.name: row for row in find_abc_nef(config["abc_nef"]["root"], config["abc_nef"].get("truth", ""))}
    elif config.get("objects"):
        found = read_objects(config["objects"])
    else:
        raise InputError("config names no objects", fix="set `objects` to a table, or `abc_nef`")
    names = config.get("select") or list(found)
    for name in names:
        if name not in found:
            raise InputError(f"select names {name!r}, which is not among the objects", fix="mend `select` in config")
    return {name: found[name] for name in names}


def has_truth(row: ObjectRow) -> bool:
    """Whether a truth is known for an object; looks at names of files only."""
    from brepgaussian.views.abc_nef_layout import has_truth as known

    return known(row.source, row.path, row.truth)


def source_files(row: ObjectRow) -> list[str]:
    """Files of an object's source that a workflow should watch; a missing one is the stage's to report."""
    watched = ("transforms.json", "transforms_train.json", "meta_data.json")
    path = Path(row.path)
    if row.source == "part" or not path.exists():
        return []
    found = [path] if path.is_file() else [path / name for name in watched if (path / name).is_file()]
    if row.truth and Path(row.truth).is_file():
        found.append(Path(row.truth))
    return [str(file) for file in found]
