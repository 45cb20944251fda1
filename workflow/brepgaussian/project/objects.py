"""`objects.tsv`: one row an object."""

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
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


def known_objects(config: Mapping[str, Any]) -> dict[str, ObjectRow]:
    """All objects that a config knows: a table's rows and those of an ABC-NEF folder.

    Raises:
        InputError: neither is given, the table is malformed, or a name stands in both.
    """
    if not config.get("objects") and not config.get("abc_nef"):
        raise InputError("config names no objects", fix="set `objects` to a table, or `abc_nef`")
    found = read_objects(config["objects"]) if config.get("objects") else {}
    for row in _abc_nef_objects(config.get("abc_nef") or {}):
        if row.name in found:
            raise InputError(
                f"{row.name} stands in {config['objects']} and in {config['abc_nef']['root']}",
                fix="give one of them another name",
            )
        found[row.name] = row
    return found


def _abc_nef_objects(folder: Mapping[str, Any]) -> list[ObjectRow]:
    if not folder:
        return []
    from brepgaussian.views.abc_nef_layout import find_abc_nef

    tuned = folder.get("tuned") or ()
    rows = find_abc_nef(folder["root"], folder.get("truth", ""))
    return [replace(row, group=GROUPS[0] if row.name in tuned else GROUPS[1]) for row in rows]


def selected(known: Mapping[str, ObjectRow], names: Sequence[str], key: str = "select") -> dict[str, ObjectRow]:
    """The objects of these names; all if there are none.

    Args:
        known: all objects.
        names: some of their names.
        key: the key of config that holds them, for the message.

    Raises:
        InputError: a name is unknown.
    """
    for name in names:
        if name not in known:
            raise InputError(f"{key} names {name!r}, which is not among the objects", fix=f"mend `{key}` in config")
    return {name: known[name] for name in names or known}


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
