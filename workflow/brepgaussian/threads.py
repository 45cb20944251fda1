"""Bind every numeric library to the rule's number of threads before the first kernel runs."""

import os
import sys

from threadpoolctl import threadpool_limits

_VARIABLES = (
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)


def bind(threads: int) -> None:
    """Limit OpenMP, BLAS, OpenCV and torch to `threads`, in this process and those that it starts.

    Libraries imported later read the environment; those that are there already (Snakemake's own script preamble
    imports numpy) are told so. Sums of a BLAS depend on its threads: unbound, results would depend on the machine.
    """
    for variable in _VARIABLES:
        os.environ[variable] = str(threads)
    threadpool_limits(limits=threads)
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(threads)
    if "cv2" in sys.modules:
        sys.modules["cv2"].setNumThreads(threads)
