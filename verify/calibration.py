"""Yardsticks of times: a fixed piece of work beside every solve, and the time of compilation.

The kernel is the unit in which slow-downs are measured. Seconds of two runs differ because the
machine does (another clock, a neighbour, a laptop on battery). The ratio of a solve to this kernel,
both timed in the same process a moment apart, differs much less. The kernel is half arithmetic in
cache, half memory traffic, as the solvers are.

It takes no memory while it is timed. The first kernel did, and took twice as long wherever the
allocator had given its pages back to the system in between, which says nothing of the machine.

Compilation is numba's. Its seconds are processor time and exclusive: a kernel compiled while
another is being compiled counts for itself only.
"""

import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter, process_time
from typing import Any

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


@dataclass
class CompileTimes:
    """Processor seconds of compilation by kernel, each without what it had compiled.

    Attributes
    ----------
    seconds : dict
        By ``module:kernel``, over all argument types that were compiled.
    kernels : int
        Compilations; those found in the cache are none.
    """

    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    kernels: int = 0

    @property
    def whole(self) -> float:
        """Seconds of all kernels."""
        return sum(self.seconds.values())


@contextmanager
def compile_times() -> Iterator[CompileTimes]:
    """Measure what is compiled meanwhile; nothing if numba has not been imported by then."""
    times = CompileTimes()
    if "numba" not in sys.modules:  # what does not need it is not to wait for its import
        yield times
        return
    from numba.core import event

    under_way: list[list[float]] = []  # start of each kernel, and what it has had compiled

    class Listener(event.Listener):
        def on_start(self, event_: Any) -> None:
            under_way.append([process_time(), 0.0])

        def on_end(self, event_: Any) -> None:
            start, inner = under_way.pop()
            spent = process_time() - start
            kernel = event_.data["dispatcher"].py_func
            times.seconds[f"{kernel.__module__}:{kernel.__name__}"] += spent - inner
            times.kernels += 1
            if under_way:
                under_way[-1][1] += spent

    with event.install_listener("numba:compile", Listener()):
        yield times
