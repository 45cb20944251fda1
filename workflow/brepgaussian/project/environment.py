"""What child processes inherit."""

import os
from pathlib import Path

_LIBRARY = str(Path(__file__).resolve().parents[2])


def export_library() -> None:
    """Let child processes import this package wherever it lies, in other environments too."""
    others = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    os.environ["PYTHONPATH"] = os.pathsep.join([_LIBRARY, *(p for p in others if p and p != _LIBRARY)])
