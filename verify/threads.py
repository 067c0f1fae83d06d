"""One thread in every process that solves: parallel runs are processes, timings are one thread's.

BLAS with a thread per core also costs: the quick sliver study took 82 s of two cores with it, and
35 s of one without (small matrices, whose threads wait for each other).
"""

import os

# what the libraries read when they are loaded
ONE_THREAD = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "NUMBA_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMEXPR_NUM_THREADS",
    ),
    "1",
)


def pin_to_one_thread() -> None:
    """Pin this process, and those it starts, before numpy or numba is loaded.

    Whatever the environment says: what is recorded of every run and study is one thread.
    """
    os.environ.update(ONE_THREAD)
