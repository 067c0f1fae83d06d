"""Time of numba's compilation, kernel by kernel.

Seconds are processor time and exclusive: a kernel compiled while another is being compiled counts
for itself only.
"""

import sys
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import process_time
from typing import Any


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
