"""What every artifact shares: atomic writing, self-describing HDF5, clear errors when one is damaged."""

import contextlib
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from brepgaussian import __version__
from brepgaussian.errors import ArtifactError, ToolError

SCHEMA_VERSION = 1
FRAME = "unit"  # bounding box centred at (0.5, 0.5, 0.5), longest side 1
_TOOLS = ("numpy", "h5py", "torch", "opencv-python-headless", "open3d", "build123d")


@dataclass(frozen=True)
class Provenance:
    """Where an artifact comes from; written into its attributes, no time stamps."""

    object_name: str = ""
    settings_hash: str = ""


@contextlib.contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`, renamed to it on success and removed on failure.

    The suffix is kept, since some writers choose the format by it.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise ToolError(
            f"cannot be written ({error.strerror or error})",
            file=path,
            fix="free some disk space or check the folder's permissions, then run again",
        ) from error
    finally:
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def create_h5(path: str | Path, kind: str, provenance: Provenance) -> Iterator[h5py.File]:
    """Create an HDF5 artifact of one kind atomically, with its provenance as attributes."""
    with atomic(path) as temporary, h5py.File(temporary, "w") as file:
        file.attrs["artifact"] = kind
        file.attrs["schema_version"] = SCHEMA_VERSION
        file.attrs["frame"] = FRAME
        file.attrs["object"] = provenance.object_name
        file.attrs["settings_hash"] = provenance.settings_hash
        file.attrs["versions"] = json.dumps(tool_versions(), sort_keys=True)
        yield file


@contextlib.contextmanager
def open_h5(path: str | Path, kind: str) -> Iterator[h5py.File]:
    """Open an HDF5 artifact for reading and check that it is of the expected kind and version."""
    path = Path(path)
    remake = "rerun the rule that makes it (snakemake --forcerun)"
    if not path.exists():
        raise ArtifactError("does not exist", file=path, fix=remake)
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise ArtifactError(f"is not a readable HDF5 file ({error})", file=path, fix=remake) from error
    with file:
        if file.attrs.get("artifact") != kind:
            raise ArtifactError(f"is not a {kind} artifact", file=path, fix=remake)
        if file.attrs.get("schema_version") != SCHEMA_VERSION:
            raise ArtifactError(f"is not of schema version {SCHEMA_VERSION}", file=path, fix=remake)
        try:
            yield file
        except KeyError as error:
            raise ArtifactError(f"lacks a dataset ({error})", file=path, fix=remake) from error


def put(
    group: h5py.Group,
    name: str,
    data: Any,
    *,
    axes: str,
    unit: str = "",
    compress: bool = True,
) -> None:
    """Write one dataset with its axis meaning (e.g. `"view,row,column"`) and unit as attributes."""
    if isinstance(data, (list, tuple)) and all(isinstance(d, str) for d in data):
        dataset = group.create_dataset(name, data=list(data), dtype=h5py.string_dtype())
    else:
        array = np.asarray(data)
        options: dict[str, Any] = {}
        if compress and array.ndim > 0 and array.size > 0:
            options = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
        if array.ndim >= 3 and options:
            options["chunks"] = (1, *array.shape[1:])  # a view at a time
        dataset = group.create_dataset(name, data=array, **options)
    dataset.attrs["axes"] = axes
    dataset.attrs["unit"] = unit


def strings(dataset: h5py.Dataset) -> tuple[str, ...]:
    """Read a dataset of strings."""
    return tuple(dataset.asstr()[...].tolist())


def tool_versions() -> dict[str, str]:
    """Versions of this package and of the tools whose numbers end up in artifacts."""
    versions = {"brepgaussian": __version__}
    for tool in _TOOLS:
        with contextlib.suppress(metadata.PackageNotFoundError):
            versions[tool] = metadata.version(tool)
    return versions


def require_finite(array: NDArray[Any], name: str, path: str | Path) -> None:
    """Raise `ArtifactError` if an array holds a NaN or an infinity."""
    if not np.isfinite(array).all():
        raise ArtifactError(f"{name} holds values that are not finite", file=path)
