"""Parts of a study side by side: several processes, results as they come."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context

from verify.processes import PARENT_VARIABLE, die_with_parent


def in_processes[T](
    function: Callable[..., T], arguments: Sequence[tuple[object, ...]], processes: int
) -> Iterator[tuple[int, T]]:
    """Call a function of a module with each of `arguments`; yield (index, result) as they end.

    Parameters
    ----------
    function : callable
    arguments : sequence of tuple
    processes : int
        With one, the calls are made here, in their order.

    Raises
    ------
    ChildProcessError
        If a process is killed (out of memory, say); what the calls raise is raised as it is.
    """
    if processes == 1:
        for index, values in enumerate(arguments):
            yield index, function(*values)
        return
    os.environ[PARENT_VARIABLE] = str(os.getpid())
    spawn = get_context("spawn")  # a fork would inherit the locks of numba and BLAS
    with ProcessPoolExecutor(processes, mp_context=spawn, initializer=_begin) as pool:
        waiting = {pool.submit(function, *values): i for i, values in enumerate(arguments)}
        try:
            for done in as_completed(waiting):
                yield waiting[done], done.result()
        except BrokenProcessPool as broken:
            raise ChildProcessError(
                "a process of the study was killed; is there memory for one on each core? "
                "-j 1 takes one at a time"
            ) from broken
        finally:
            pool.shutdown(cancel_futures=True)


def _begin() -> None:
    die_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends it at once and without a traceback
