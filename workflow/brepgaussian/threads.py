"""Bind every numeric library to the rule's number of threads before the first kernel runs."""

import os
import sys

_VARIABLES = (
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)


def bind(threads: int) -> None:
    """Limit OpenMP, BLAS, OpenCV and torch to `threads`; libraries imported later read the environment."""
    for variable in _VARIABLES:
        os.environ[variable] = str(threads)
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(threads)
    if "cv2" in sys.modules:
        sys.modules["cv2"].setNumThreads(threads)
