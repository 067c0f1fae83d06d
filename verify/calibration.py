"""A fixed piece of work, timed beside every solve: the unit in which slow-downs are measured.

Seconds of two runs differ because the machine does (another clock, a neighbour, a laptop on
battery). The ratio of a solve to this kernel, both timed in the same process a moment apart,
differs much less. The kernel is half arithmetic in cache, half memory traffic, as the solvers are.

It takes no memory while it is timed. The first kernel did, and took twice as long wherever the
allocator had given its pages back to the system in between, which says nothing of the machine.
"""

from collections.abc import Callable
from time import perf_counter

import numpy as np

KERNEL = 2  # another number when the work changes: ratios of different kernels do not compare
_REPETITIONS = 5


def kernel_seconds(
    repetitions: int = _REPETITIONS, clock: Callable[[], float] = perf_counter
) -> list[float]:
    """Time the kernel, after one call that is not counted.

    Parameters
    ----------
    repetitions : int
    clock : callable
        Wall time in s, or `time.thread_time` for processor time.

    Returns
    -------
    list of float
        Seconds, about 0.01 each.
    """
    rng = np.random.default_rng(0)
    matrix = rng.standard_normal((128, 128)) / 128
    values = rng.standard_normal(200_000)
    places = rng.permutation(len(values))
    product, next_product = np.empty_like(matrix), np.empty_like(matrix)
    total, gathered = np.empty_like(values), np.empty_like(values)
    seconds = []
    for repetition in range(repetitions + 1):
        start = clock()
        product[:] = matrix
        for _ in range(30):
            np.matmul(product, matrix, out=next_product)
            product, next_product = next_product, product
        total[:] = values
        for _ in range(10):
            np.take(total, places, out=gathered, mode="clip")  # "raise" would take memory
            np.add(gathered, values, out=total)
            total *= 0.5
        total += product[0, 0]
        total.sort()
        if repetition:
            seconds.append(clock() - start)
    return seconds


def calibration_note() -> str:
    """Time the kernel and write that down as a note of a solve."""
    return f"kernel {KERNEL}: {' '.join(f'{seconds:.6g}' for seconds in kernel_seconds())}"


def seconds_of_note(note: str) -> list[float] | None:
    """Read what `calibration_note` wrote; None if it is of another kernel or unreadable."""
    head, _, rest = note.partition(": ")
    if head != f"kernel {KERNEL}":
        return None
    try:
        return [float(word) for word in rest.split()] or None
    except ValueError:
        return None
