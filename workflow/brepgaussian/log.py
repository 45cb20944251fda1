"""Logging set-up shared by all rules: one format, tracebacks and progress bars in the rule's log."""

import logging
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TypeVar

from tqdm import tqdm

T = TypeVar("T")

LOGGER_NAME = "brepgaussian"
_FORMAT = "%(levelname)s %(name)s: %(message)s"
_PROGRESS_INTERVAL_S = 5.0  # a log file needs a line now and then, not ten a second


def get_logger(room: str) -> logging.Logger:
    """Return the logger of a room, e.g. `get_logger("masks")`."""
    return logging.getLogger(f"{LOGGER_NAME}.{room}")


def setup(log_file: str | Path | None = None, level: int = logging.INFO) -> None:
    """Send the package's log, stdout, stderr and uncaught tracebacks to `log_file` (or to stderr)."""
    if log_file is not None:
        Path(log_file).parent.mkdir(parents=True, exist_ok=True)
        stream = open(log_file, "w", buffering=1, encoding="utf-8")  # noqa: SIM115, lives as long as the job
        sys.stdout = sys.stderr = stream
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter(_FORMAT))
    logger = logging.getLogger(LOGGER_NAME)
    logger.handlers[:] = [handler]
    logger.setLevel(level)
    logger.propagate = False


def progress(items: Iterable[T], description: str, total: int | None = None) -> Iterator[T]:
    """Iterate with a progress bar: live in a terminal, a line every few seconds in a log file."""
    live = sys.stderr.isatty()
    yield from tqdm(
        items,
        desc=description,
        total=total,
        file=sys.stderr,
        mininterval=0.1 if live else _PROGRESS_INTERVAL_S,
        ncols=None if live else 80,
        ascii=not live,
    )
