"""The one family of errors that the library raises: what is wrong, in which file, and how to mend it."""

from pathlib import Path


class BrepGaussianError(Exception):
    """A fault that a user can act on.

    Args:
        fault: what is wrong, in one sentence.
        file: the file or folder at fault, if there is one.
        fix: what the user can do about it.
    """

    def __init__(self, fault: str, *, file: str | Path | None = None, fix: str = "") -> None:
        self.fault = fault
        self.file = str(file) if file is not None else None
        self.fix = fix
        super().__init__(str(self))

    def __str__(self) -> str:
        where = f"{self.file}: " if self.file else ""
        how = f" Fix: {self.fix}" if self.fix else ""
        return f"{where}{self.fault}{how}"


class InputError(BrepGaussianError):
    """Bad input from the user: images, cameras, models, object lists."""


class SettingsError(BrepGaussianError):
    """An unknown, mistyped or out-of-range setting."""


class ArtifactError(BrepGaussianError):
    """A file between two stages is missing, damaged, or of another schema version."""


class StageError(BrepGaussianError):
    """A stage cannot give a result for this object."""


class ToolError(BrepGaussianError):
    """The machine lacks something: a compiler, a system library, disk space."""
