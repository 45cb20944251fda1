"""What every rule's script does around its one library call."""

import contextlib
import json
import logging
import traceback
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from brepgaussian import __version__, log, threads
from brepgaussian.errors import BrepGaussianError
from brepgaussian.project.failures import Failure, record


@contextlib.contextmanager
def job(
    stage: str,
    log_file: str | Path,
    thread_count: int = 1,
    failure_file: str | Path | None = None,
    settings: Mapping[str, Any] | None = None,
) -> Iterator[logging.Logger]:
    """Run a stage's work with its log, its threads, and a record of its failure.

    Args:
        stage: the stage's name.
        log_file: the rule's log; receives the package's log, tracebacks and progress bars.
        thread_count: the rule's threads; bound before numeric libraries load.
        failure_file: where to say why the stage failed; removed when the stage starts again.
        settings: what differs from the defaults; written to the log's first lines.

    Raises:
        SystemExit: with status 1 after a fault that a user can act on (logged without a traceback).
    """
    log.setup(log_file)
    threads.bind(thread_count)
    logger = log.get_logger(stage)
    logger.info("brepgaussian %s, %d thread(s)", __version__, thread_count)
    logger.info("settings that differ from the defaults: %s", json.dumps(dict(settings or {}), sort_keys=True))
    if failure_file is not None:
        Path(failure_file).unlink(missing_ok=True)
    try:
        yield logger
    except BrepGaussianError as error:
        logger.error("%s", error)
        _record(failure_file, stage, str(error))
        raise SystemExit(1) from error
    except Exception as error:
        logger.error("%s", traceback.format_exc())
        _record(failure_file, stage, f"{type(error).__name__}: {error}")
        raise
    logger.info("done")


def _record(path: str | Path | None, stage: str, reason: str) -> None:
    if path is not None:
        with contextlib.suppress(OSError):  # a full disk must not hide the first fault
            record(path, Failure(stage, f"{stage}: {reason}"))
