"""Binding of the numeric libraries: results must not depend on the cores of a machine."""

import subprocess
import sys
from pathlib import Path

import brepgaussian

_AFTER_NUMPY = """
import numpy, scipy.linalg
from threadpoolctl import threadpool_info, threadpool_limits
threadpool_limits(limits=3)
from brepgaussian.threads import bind
bind({threads})
assert threadpool_info(), "no BLAS is loaded"
assert {{lib["num_threads"] for lib in threadpool_info()}} == {{{threads}}}, threadpool_info()
import os
assert os.environ["OPENBLAS_NUM_THREADS"] == "{threads}"
"""


def run(code):
    library = str(Path(brepgaussian.__file__).parents[1])
    return subprocess.run([sys.executable, "-c", code], env={"PYTHONPATH": library}, capture_output=True, text=True)


def test_libraries_that_are_loaded_already_are_bound_too():
    for threads in (1, 2):
        done = run(_AFTER_NUMPY.format(threads=threads))
        assert done.returncode == 0, done.stderr
