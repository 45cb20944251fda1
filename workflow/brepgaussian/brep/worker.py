"""OCC in a process of its own: a crash or a hang costs one rung, not the run.

The parent (`Worker`) and the child (`python -m brepgaussian.brep.worker`) exchange length-prefixed pickles
over the child's stdin and stdout. Not multiprocessing: its spawn would run the caller's main script again.
"""

import os
import pickle
import select
import struct
import subprocess
import sys
import time
from importlib import import_module
from typing import IO, Any

from brepgaussian.errors import BrepGaussianError

_HEADER = struct.Struct(">Q")
_CHUNK = 1 << 20


class WorkerError(Exception):
    """The child crashed, hung, or its function failed."""


class WorkerTimeout(WorkerError):
    """The child hung."""


class Worker:
    """Calls functions of this package in a child process, with a time limit for each call."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> "Worker":
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def call(self, function: str, arguments: tuple[Any, ...], limit_s: float) -> Any:
        """Run `module:function` of this package with pickled arguments.

        Raises:
            WorkerError: it crashed, exceeded the limit (`WorkerTimeout`), or raised something unexpected.
            BrepGaussianError: raised by the function itself.
        """
        if self._process is None or self._process.poll() is not None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "brepgaussian.brep.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env={**os.environ, "PYTHONHASHSEED": "0"},
            )
        try:
            assert self._process.stdin is not None
            _send(self._process.stdin, (function, arguments))
            good, value = self._receive(time.monotonic() + limit_s)
        except (BrokenPipeError, EOFError) as error:
            self.stop()
            raise WorkerError("the geometry kernel crashed") from error
        except TimeoutError as error:
            self.stop()
            raise WorkerTimeout(f"took more than {limit_s:.0f} s") from error
        if good:
            return value
        if isinstance(value, BrepGaussianError):
            raise value
        raise WorkerError(str(value))

    def stop(self) -> None:
        """End the child."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None

    def _receive(self, deadline: float) -> tuple[bool, Any]:
        header = self._read(_HEADER.size, deadline)
        return pickle.loads(self._read(_HEADER.unpack(header)[0], deadline))  # type: ignore[no-any-return]

    def _read(self, count: int, deadline: float) -> bytes:
        assert self._process is not None
        assert self._process.stdout is not None
        stream, parts = self._process.stdout.fileno(), bytearray()
        while len(parts) < count:
            ready, _, _ = select.select([stream], [], [], max(deadline - time.monotonic(), 0))
            if not ready:
                raise TimeoutError
            block = os.read(stream, min(_CHUNK, count - len(parts)))
            if not block:
                raise EOFError
            parts += block
        return bytes(parts)


def _send(stream: IO[bytes], value: Any) -> None:
    data = pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL)
    stream.write(_HEADER.pack(len(data)))
    stream.write(data)
    stream.flush()


def _serve() -> None:
    """The child: answer calls until stdin closes. OCC's own prints go to stderr."""
    from OCP.Message import Message

    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    requests = os.fdopen(os.dup(0), "rb")
    Message.DefaultMessenger_s().ChangePrinters().Clear()  # no chatter in the rule's log
    while header := requests.read(_HEADER.size):
        name, arguments = pickle.loads(requests.read(_HEADER.unpack(header)[0]))
        module, function = name.split(":")
        try:
            answer = (True, getattr(import_module(f"brepgaussian.brep.{module}"), function)(*arguments))
        except BrepGaussianError as error:
            answer = (False, error)
        except Exception as error:  # the parent decides what a failure means
            answer = (False, f"{type(error).__name__}: {error}")
        _send(answers, answer)


if __name__ == "__main__":
    _serve()
