"""Compile the C++ kernels into a plain shared library, once per source, flags and processor.

`python -m brepgaussian.splatting.build` compiles ahead of the first use.
"""

import functools
import hashlib
import os
import platform
import shutil
import subprocess
from pathlib import Path

from brepgaussian.artifacts.base import atomic
from brepgaussian.errors import ToolError
from brepgaussian.log import get_logger

SOURCES = Path(__file__).parent / "kernels"
FLAGS = ("-O3", "-march=native", "-std=c++17", "-fopenmp", "-fno-math-errno", "-shared", "-fPIC", "-Wno-psabi")
FOLDER_VARIABLE = "BREPGAUSSIAN_BUILD"
_TIMEOUT_S = 300

logger = get_logger("splatting")


def build_folder() -> Path:
    """Where compiled kernels go: `$BREPGAUSSIAN_BUILD`, or `build/` beside `workflow/`."""
    chosen = os.environ.get(FOLDER_VARIABLE)
    return Path(chosen) if chosen else Path(__file__).resolve().parents[3] / "build"


@functools.cache
def _cpu() -> str:
    """The processor's model and abilities: a library made with -march=native runs on its own kind only."""
    info = Path("/proc/cpuinfo")
    if not info.exists():
        return f"{platform.machine()} {platform.processor()}"
    wanted = ("model name", "flags", "Features", "CPU part")
    lines = {line for line in info.read_text(errors="replace").splitlines() if line.startswith(wanted)}
    return "\n".join(sorted(lines))


def library_path() -> Path:
    """The shared library's name: a hash of sources, flags, compiler name and processor."""
    key = hashlib.sha256(" ".join((_compiler_name(), *FLAGS)).encode())
    key.update(_cpu().encode())
    for source in sorted(SOURCES.iterdir()):
        if source.suffix in (".cpp", ".h"):
            key.update(source.name.encode() + source.read_bytes())
    return build_folder() / f"splatting-{key.hexdigest()[:16]}.so"


def _compiler_name() -> str:
    return os.environ.get("CXX", "g++")


def build_kernel() -> Path:
    """Compile the kernels if this version of them is not there yet, and return the library's path.

    Raises:
        ToolError: there is no C++ compiler, or it fails.
    """
    path = library_path()
    if path.exists():
        return path
    compiler = shutil.which(_compiler_name())
    if compiler is None:
        raise ToolError(
            f"the C++ compiler {_compiler_name()} is missing, which the cpu renderer needs",
            fix="install the package g++ (apt-get install g++, dnf install gcc-c++, conda install cxx-compiler)",
        )
    logger.info("compiling the splatting kernels into %s", path)
    with atomic(path) as temporary:
        command = [compiler, *FLAGS, *map(str, sorted(SOURCES.glob("*.cpp"))), "-o", str(temporary)]
        result = subprocess.run(command, capture_output=True, text=True, timeout=_TIMEOUT_S, check=False)
        if result.returncode != 0:
            raise ToolError(
                f"{_compiler_name()} cannot compile the splatting kernels:\n{result.stderr[-2000:]}",
                file=SOURCES,
                fix="use g++ 9 or newer with OpenMP (package g++), or choose another one with CXX",
            )
    return path


if __name__ == "__main__":
    print(build_kernel())
